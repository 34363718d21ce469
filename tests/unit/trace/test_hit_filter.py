"""Rays ignore hits that a hit filter rejects. A reported hit has the index of its triangle in the scene."""

from __future__ import annotations

from functools import cache

import naive
import numpy as np
import pytest
from numba import carray, cfunc, types
from packet_driver import cast

from baker.trace.embree import HitFilter, RayScene
from baker.trace.packets import HIT_U, NG_X, PRIM_ID
from baker.trace.pointers import pointer

N = 60
U, PRIM = HIT_U - NG_X, PRIM_ID - NG_X


def refuse(arguments):
    """Reject hits with u < 0.3 on triangles whose byte in the table is not 0."""
    given = carray(arguments, (6,), np.int64)
    n = given[5] & 0xFFFFFFFF
    valid = carray(pointer(given[0]), (n,), np.int32)
    table = carray(pointer(given[1]), (N,), np.uint8)
    hit = carray(pointer(given[4]), (6 * n,), np.float32)
    words = carray(pointer(given[4]), (6 * n,), np.uint32)
    for lane in range(n):
        if valid[lane] == -1 and table[words[PRIM * n + lane]] and hit[U * n + lane] < np.float32(0.3):
            valid[lane] = 0


@cache
def compiled():
    """Return the compiled filter, which must exist as long as Embree has its address."""
    return cfunc(types.void(types.voidptr))(refuse)


@pytest.fixture(scope="module")
def case():
    rng = np.random.default_rng(5)
    position = np.float32(rng.uniform(-1, 1, (N, 1, 3)) + rng.normal(0, 0.3, (N, 3, 3))).reshape(-1, 3)
    triangle = np.arange(3 * N, dtype=np.int32).reshape(-1, 3)
    origin = np.float32(rng.uniform(-1.5, 1.5, (403, 3)))
    direction = np.float32(rng.uniform(-1, 1, (403, 3)) - origin)
    chosen = rng.random(N) < 0.6
    refused = chosen & (rng.random(N) < 0.7)
    truth = np.array([first_that_counts(position, triangle, refused, o, d) for o, d in
                      zip(origin, direction, strict=True)])  # fmt: skip
    table = refused.astype(np.uint8)
    see = HitFilter(chosen, compiled().address, table.ctypes.data, table)
    return position, triangle, origin, direction, see, truth


def first_that_counts(position, triangle, refused, origin, direction):
    """Return (distance, triangle) of the nearest hit that is not rejected, by a loop over all triangles."""
    best, found = np.inf, -1
    for k in range(len(triangle)):
        reach, prim = naive.intersect(position, triangle[k : k + 1], origin, direction)
        if prim < 0 or reach >= best:
            continue
        u, _ = naive.barycentric(position[triangle[k]], origin + reach * direction)
        if not (refused[k] and u < 0.3):
            best, found = reach, k
    return best, found


@pytest.mark.parametrize("width", [4, 8, 16])
def test_refused_hits_do_not_count(case, width):
    position, triangle, origin, direction, see, truth = case
    rays = RayScene(position, triangle, threads=1, hit_filter=see)
    geom, prim, _, _, reach = cast(rays, origin, direction, width=width)
    hit = truth[:, 1] >= 0
    # By rounding, a ray near an edge or near u = 0.3 may hit or miss.
    assert (hit != (geom >= 0)).sum() <= 1
    both = hit & (geom >= 0)
    assert both.sum() > 150
    same = prim[both] == truth[both, 1]
    assert (~same).sum() <= 1
    np.testing.assert_allclose(reach[both][same], truth[both, 0][same], rtol=2e-5)
    # Embree geometry 1 has the triangles with a hit filter, and geometry 0 has all other triangles.
    assert (geom[both] == see.chosen[prim[both]]).all()
    assert set(geom[both]) == {0, 1}
    plain = cast(RayScene(position, triangle, threads=1), origin, direction, width=width)
    assert (plain[1] != prim).sum() > 30
    dark = cast(rays, origin, direction, width=width, occluded=True)[4] < 0
    assert (dark == (geom >= 0)).all()


@pytest.mark.parametrize("chosen", [True, False])
def test_all_triangles_or_none_may_be_chosen(case, chosen):
    position, triangle, origin, direction = case[:4]
    nothing = np.zeros(N, np.uint8)
    all_or_none = HitFilter(np.full(N, chosen), compiled().address, nothing.ctypes.data, nothing)
    rays = RayScene(position, triangle, threads=1, hit_filter=all_or_none)
    plain = RayScene(position, triangle, threads=1)
    found, truth = (cast(scene, origin, direction) for scene in (rays, plain))
    hit = truth[0] >= 0
    assert hit.sum() > 150
    assert (found[0][hit] == chosen).all()
    assert (found[0][~hit] == -1).all()
    for a, b in zip(found[1:], truth[1:], strict=True):
        np.testing.assert_array_equal(a[hit], b[hit])


def test_shared_edges_do_not_leak_between_the_geometries():
    """Rays aimed at the edge between a triangle with a hit filter and one without a hit filter all hit."""
    position = np.float32([[0, 0, 0], [1, 0, 0.1], [1, 1, 0], [0, 1, 0.1]])
    nothing = np.zeros(N, np.uint8)
    see = HitFilter(np.array([True, False]), compiled().address, nothing.ctypes.data, nothing)
    rays = RayScene(position, np.int32([[0, 1, 2], [0, 2, 3]]), threads=1, hit_filter=see)
    rng = np.random.default_rng(0)
    share = rng.uniform(0.01, 0.99, (4000, 1))
    target = share * position[2].astype(float)
    origin = np.float32(target + rng.uniform(-0.5, 0.5, (4000, 3)) + [0, 0, 2])
    assert (cast(rays, origin, np.float32(target - origin))[0] >= 0).all()
