"""The lookup from a hit to a lightmap pixel agrees with a reference function in Python."""

from __future__ import annotations

import naive
import numpy as np
from inner import compiled
from tiny_scenes import Quad, grey, quad_world

from baker.kernels.triangle_lookup import BACK_FACE, DOUBLE_SIDED, front_facing, hit_pixel

front_facing, hit_pixel = compiled(front_facing, hit_pixel)


def test_hits_find_the_texel_that_lies_there():
    quads = [
        Quad((0, 0, 0), (1, 0, 0), (0, 1, 0), grey(double_sided=True)),
        Quad((0, 0, 2), (2, 0, 0), (0, 0.7, 0.4)),
        Quad((0, 0, 3), (0.2, 0, 0), (0, 1, 0), grey(emission=2.0)),
    ]
    world = quad_world(quads, 20, inset=0.41)
    table, geometry, texels = world.table, world.geometry, world.texels
    entry_at = texels.hit_image(np.arange(texels.n), -1)
    assert len(entry_at) == 2 * 400
    rng = np.random.default_rng(0)
    corner = geometry.uv[geometry.triangle]
    found = {"front": 0, "back": 0, "black": 0, "border": 0}
    for _ in range(1500):
        t = int(rng.integers(len(geometry.triangle)))
        b1, b2 = np.float32(rng.dirichlet([1, 1, 1])[:2])
        if rng.random() < 0.2:
            b1, b2 = (np.float32(x) for x in [(0, 0), (1, 0), (0, 1), (0.5, 0.5), (0, 0.3)][rng.integers(5)])
        front = bool(rng.random() < 0.6)
        truth = naive.hit_pixel(corner, geometry.page, geometry.double_sided, 20, 1, t, b1, b2, front)
        ours = hit_pixel(table.row, table.size, table.n_pixels, t, b1, b2, front)
        # By rounding, a point on the border between two texels may be assigned to either texel.
        if ours != truth:
            where = ((1 - b1 - b2) * corner[t, 0] + b1 * corner[t, 1] + b2 * corner[t, 2]) * 20
            assert np.abs(where - np.rint(where)).min() < 1e-4
            found["border"] += 1
        if truth == BACK_FACE:
            found["black"] += 1
            continue
        found["front" if front else "back"] += 1
        # Whether or not the result equals the reference, the texel belongs to the hit object and side.
        entry = entry_at[ours]
        assert 0 <= entry < texels.n
        assert texels.instance[entry] == geometry.instance[t]
        assert texels.back[entry] == (not front)
        point = np.array([1 - b1 - b2, b1, b2]) @ geometry.position[geometry.triangle[t]]
        assert np.linalg.norm(point - texels.position[entry]) < 0.35
    assert min(found["front"], found["back"], found["black"]) > 100
    assert found["border"] < 20


def test_uv_beyond_the_page_stays_in_it():
    row = np.zeros((1, 16), np.float32)
    row[0, :7] = [0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 2.0]
    for (u, v), (r, c) in {
        (-0.5, 0.2): (1, 0),
        (1.0, 1.0): (7, 7),
        (9, 0.5): (4, 7),
        (0.99, -3): (0, 7),
    }.items():
        assert hit_pixel(row, 8, 3 * 64, 0, np.float32(u), np.float32(v), True) == 2 * 64 + r * 8 + c
    assert hit_pixel(row, 8, 3 * 64, 0, np.float32(0), np.float32(0), False) == BACK_FACE
    row[0, 7] = 1
    assert hit_pixel(row, 8, 3 * 64, 0, np.float32(0), np.float32(0), False) == 3 * 64 + 2 * 64


def test_pixels_beside_a_chart_know_its_texels():
    world = quad_world([Quad((0, 0, 0), (1, 0, 0), (0, 1, 0))], 16, inset=4.0)
    lookup = world.texels.lookup.reshape(16, 16)
    covered = np.zeros((16, 16), bool)
    covered.reshape(-1)[world.texels.pixel] = True
    for r in range(16):
        for c in range(16):
            near = [
                lookup[y, x]
                for y in range(max(r - 1, 0), min(r + 2, 16))
                for x in range(max(c - 1, 0), min(c + 2, 16))
                if covered[y, x]
            ]
            assert (
                lookup[r, c] == (world.texels.lookup[r * 16 + c] if covered[r, c] else -1)
                or lookup[r, c] in near
            )
            assert (lookup[r, c] >= 0) == bool(near)
    beside = lookup[:, :-1][(~covered[:, :-1]) & covered[:, 1:]]
    np.testing.assert_array_equal(beside, lookup[:, 1:][(~covered[:, :-1]) & covered[:, 1:]])


def test_backs_without_texels_are_not_looked_up():
    """If no two-sided triangle has texels, the texel buffer has no entries for backs.

    The table must then mark all triangles as one-sided, so that no hit on a back is looked up.
    """
    from baker.radiosity.triangle_lookup import build_triangle_lookup

    world = quad_world([Quad((0, 0, 0), (1, 0, 0), (0, 1, 0)), Quad((2, 0, 0), (1, 0, 0), (0, 1, 0))], 16)
    world.geometry.double_sided[2] = True
    table = build_triangle_lookup(world.geometry, world.texels, world.emitters)
    assert (table.row[:, DOUBLE_SIDED] == 0).all()
    assert len(world.texels.hit_image(np.zeros(world.texels.n))) == 256


def test_the_side_of_a_hit():
    row = np.zeros((1, 16), np.float32)
    row[0, 8:11] = [0, 0, 1]
    assert front_facing(row, 0, np.float32(0.3), np.float32(0), np.float32(-1))
    assert not front_facing(row, 0, np.float32(0.3), np.float32(0), np.float32(1))
    assert not front_facing(row, 0, np.float32(1), np.float32(0), np.float32(0))
