"""Ray origins are uniform over the part of a texel that triangles cover, and offset to the correct side."""

from __future__ import annotations

from itertools import pairwise

import naive
import numpy as np
import pytest
from inner import compiled
from tiny_scenes import Quad, grey, quad_world

from baker.core.progress import silent
from baker.kernels.sampling import sobol_reversed
from baker.kernels.surface import (
    BORDER,
    INWARD,
    N_POINTS,
    OFFSET,
    ROUNDING,
    place_point,
    place_points,
    valid_point,
)
from baker.radiosity.texels import build_texels

valid_point, place_point = compiled(valid_point, place_point)

EVERY = np.arange(N_POINTS, dtype=np.uint8)[None]


def points(surface, chosen=None, mask=None, wanted=EVERY):
    chosen = np.arange(len(surface.pixel)) if chosen is None else np.array(chosen)
    mask = np.full(len(surface.pixel), 0xFFFF, np.uint16) if mask is None else mask
    shape = len(chosen), wanted.shape[1]
    origin, normal = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    hit, bary = np.zeros(shape, np.int32), np.zeros((*shape, 2), np.float32)
    place_points(surface, mask, chosen, wanted, origin, normal, hit, bary)
    return origin, normal, hit, bary


@pytest.fixture(scope="module")
def slanted():
    """Return (geometry, texels, surface) of a parallelogram and a two-sided square, off the texel grid."""
    quads = [
        Quad((0, 0, 0), (1, 0, 0), (0.4, 0.9, 0)),
        Quad((3, 0, 0), (0, 0, 1), (0, 1, 0), grey(double_sided=True)),
    ]
    world = quad_world(quads, 16, inset=0.37)
    # In uv, the first quad is an irregular quadrilateral.
    uv = world.geometry.uv.copy()
    uv[:4] += np.float32([[0, 0], [-0.05, 0.06], [-0.01, -0.08], [0.09, 0.01]])
    world.geometry.uv[:] = uv
    texels, surface = build_texels(
        world.geometry, world.shading, world.atlas, seed=0, threads=1, progress=silent
    )
    return world.geometry, texels, surface


def in_page(geometry, hit, bary):
    """Return the uv (0 to 1) of points with the barycentrics `bary` on the triangles `hit`."""
    corner = geometry.uv[geometry.triangle[hit]].astype(float)
    b1, b2 = bary[..., :1].astype(float), bary[..., 1:].astype(float)
    return corner[..., 0, :] * (1 - b1 - b2) + corner[..., 1, :] * b1 + corner[..., 2, :] * b2


def test_points_lie_in_their_texel_and_triangle(slanted):
    geometry, texels, surface = slanted
    origin, normal, hit, bary = points(surface)
    assert texels.n > texels.n_front > 40
    where = in_page(geometry, hit, bary) * 16
    cell = np.stack([texels.pixel % 16, texels.pixel // 16], axis=1)[:, None]
    assert (np.abs(where - cell - 0.5) <= 0.5 + 2e-5).all()
    assert bary.min() > -2e-5
    assert bary.sum(axis=2).max() < 1 + 2e-5
    for i in range(texels.n):
        f = surface.front[i]
        assert set(hit[i]) <= set(texels.entry[texels.first[f] : texels.first[f + 1]].tolist())
    # On a flat surface, an origin is the barycentric position, offset along the normal of its side.
    corner = geometry.position[geometry.triangle[hit]].astype(float)
    b1, b2 = bary[..., :1], bary[..., 1:]
    flat = corner[..., 0, :] * (1 - b1 - b2) + corner[..., 1, :] * b1 + corner[..., 2, :] * b2
    side = np.where(texels.back, -1.0, 1.0)[:, None, None] * geometry.face_normal[hit]
    far, edges = np.abs(flat).max(axis=2), corner[..., 1:, :] - corner[..., :1, :]
    size = np.abs(edges).max(axis=(2, 3))
    away = np.maximum(
        ROUNDING * np.maximum(far, size), OFFSET * np.minimum(np.maximum(far, surface.min_offset_scale), size)
    )[..., None]
    # Near an edge, the origin is also moved towards the triangle's middle. Otherwise rounding might put it
    # behind an adjacent wall.
    clipped = np.clip(np.concatenate([1 - b1 - b2, b1, b2], axis=2), 0, 1)
    near = clipped.min(axis=2, keepdims=True) < BORDER
    assert near.any()
    assert not near.all()
    middle = corner.mean(axis=2) - flat
    inward = near * np.minimum(INWARD * away / np.linalg.norm(middle, axis=2, keepdims=True), 0.5)
    np.testing.assert_allclose(origin, flat + away * side + inward * middle, atol=1e-6)
    np.testing.assert_allclose(normal, side, atol=1e-6)
    assert (((origin - flat) * side).sum(axis=2) > 0.5 * away[..., 0]).all()


def test_points_are_uniform_in_what_is_covered(slanted):
    geometry, texels, surface = slanted
    chosen = np.argsort(np.abs(np.diff(texels.first) - 2))[:3].tolist()
    coverage = np.array([texels.entry_area[a:b].sum() for a, b in pairwise(texels.first)])
    chosen += np.argsort(np.abs(coverage - 0.4))[:4].tolist() + np.argsort(-coverage)[:3].tolist()
    chance = []
    where = {i: [] for i in chosen}
    for seed in range(120):
        other = surface._replace(sobol_points=sobol_reversed(N_POINTS, seed, 7))
        _, _, hit, bary = points(other, chosen)
        for n, i in enumerate(chosen):
            where[i].append(in_page(geometry, hit[n], bary[n]) * 16)
    for i in chosen:
        x0, y0 = texels.pixel[i] % 16, texels.pixel[i] // 16
        table = np.histogram2d(
            *np.clip(np.concatenate(where[i]) - [x0, y0], 0, 1).T, bins=5, range=[[0, 1], [0, 1]]
        )[0]
        area = np.zeros((5, 5))
        for t in texels.entry[texels.first[i] : texels.first[i + 1]]:
            corner = geometry.uv[geometry.triangle[t]].astype(float) * 16
            area += [
                [naive.cut_area(corner, x0 + a / 5, y0 + b / 5, 0.2) for b in range(5)] for a in range(5)
            ]
        assert area.sum() == pytest.approx(coverage[i], abs=1e-5)
        # By rounding, up to two points may lie just inside an empty cell. The chi-square test leaves out such
        # cells.
        assert table[area < 1e-7].sum() <= 2
        table[area < 1e-7], area[area < 1e-7] = 0, 0
        chance.append(naive.chi_square_chance(table, area / area.sum() * table.sum()))
    assert min(chance) > naive.sidak(len(chance))


def test_areas_and_centroids(slanted):
    geometry, texels, _ = slanted
    # The areas of an object's texels sum to its area, and a back has the same area as its front.
    for k, area in ((0, 0.9), (1, 1.0)):
        own = texels.instance[: texels.n_front] == k
        assert texels.area[: texels.n_front][own].sum() == pytest.approx(area, rel=1e-5)
    back = np.flatnonzero(texels.back)
    np.testing.assert_array_equal(texels.back_entry[texels.back_entry >= 0], back)
    front = np.flatnonzero(texels.back_entry >= 0)
    for name in ("area", "pixel", "chart", "instance", "position", "albedo"):
        np.testing.assert_array_equal(getattr(texels, name)[back], getattr(texels, name)[front])
    np.testing.assert_array_equal(texels.normal[back], -texels.normal[front])
    for i in range(texels.n_front):
        x0, y0 = texels.pixel[i] % 16, texels.pixel[i] // 16
        entries = texels.entry[texels.first[i] : texels.first[i + 1]]
        corners = [geometry.uv[geometry.triangle[t]].astype(float) * 16 for t in entries]
        parts = [naive.shoelace(naive.cut_polygon(c, x0, y0)) for c in corners]
        total = sum(area for area, _ in parts)
        if total < 1e-4:
            continue
        centre = sum(area * middle for area, middle in parts) / total
        np.testing.assert_allclose(texels.centroid[i] + [x0 + 0.5, y0 + 0.5], centre, atol=1e-3)
        main = int(np.argmax([area for area, _ in parts]))
        b1, b2 = naive.barycentric(corners[main], centre)
        corner = geometry.position[geometry.triangle[entries[main]]].astype(float)
        b1, b2 = np.clip(b1, 0, 1), np.clip(b2, 0, 1 - np.clip(b1, 0, 1))
        spot = corner[0] + b1 * (corner[1] - corner[0]) + b2 * (corner[2] - corner[0])
        np.testing.assert_allclose(texels.position[i], spot, atol=1e-4)
    assert len(np.unique(texels.pixel[: texels.n_front])) == texels.n_front
    np.testing.assert_array_equal(texels.lookup[texels.pixel[: texels.n_front]], np.arange(texels.n_front))


def place_one(position, normal, b1, b2, flip=False):
    triangle = np.int32([[0, 1, 2]])
    position, normal = np.float32(position), np.float32(normal)
    cross = np.cross(position[1] - position[0], position[2] - position[0])
    face = np.float32([cross / max(np.linalg.norm(cross), 1e-30)])
    origin, facing = np.zeros((1, 1, 3), np.float32), np.zeros((1, 1, 3), np.float32)
    place_point(
        position,
        normal,
        face,
        triangle,
        np.float32(0),
        np.int32(0),
        float(b1),
        float(b2),
        flip,
        origin,
        facing,
        0,
        0,
    )
    return origin[0, 0].astype(float), facing[0, 0].astype(float)


def test_a_rounded_facet_is_lifted_to_the_curve():
    """If a facet has the vertex normals of a sphere, its middle is moved to the sphere. Its corners stay."""
    corner = np.array([[0.3, 0.0, 1.0], [-0.2, 0.3, 1.0], [-0.2, -0.3, 1.0]])
    corner /= np.linalg.norm(corner, axis=1, keepdims=True)
    middle = corner.mean(axis=0)
    origin, normal = place_one(corner, corner, 1 / 3, 1 / 3)
    # Hanika 2021: at the centroid, the result is the mean of the projections onto the three tangent planes.
    planes = [middle - min((middle - c) @ c, 0) * c for c in corner]
    np.testing.assert_allclose(origin, np.mean(planes, axis=0), atol=2e-5)
    assert np.linalg.norm(middle) < 1 < np.linalg.norm(origin) < 1.05
    np.testing.assert_allclose(normal, middle / np.linalg.norm(middle), atol=1e-5)
    np.testing.assert_allclose(place_one(corner, corner, 0, 0)[0], corner[0], atol=2e-5)
    # A point is not moved if it is on the back, or if vertex normals deviate too far from the face normal.
    np.testing.assert_allclose(place_one(corner, corner, 1 / 3, 1 / 3, flip=True)[0], middle, atol=2e-5)
    leaning = np.tile([[0.9, 0.0, 0.43589]], (3, 1))
    np.testing.assert_allclose(place_one(corner, leaning, 1 / 3, 1 / 3)[0], middle, atol=2e-5)


def test_normals_that_make_no_sense_give_the_face_normal():
    corner = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]])
    for normal in (np.zeros((3, 3)), np.tile([0, 0, -1], (3, 1)), [[1, 0, 0], [-1, 0, 0], [0, 0, 0]]):
        np.testing.assert_allclose(place_one(corner, normal, 0.2, 0.3)[1], [0, 0, 1])
        np.testing.assert_allclose(place_one(corner, normal, 0.2, 0.3, flip=True)[1], [0, 0, -1])
    # Barycentrics outside of the triangle are clamped, and the point is moved towards the middle.
    spot = place_one(corner, np.tile([0, 0, 1], (3, 1)), 1.1, -0.1)[0]
    step = 1e-5 * INWARD * np.array([-2.0, 1.0]) / 5**0.5
    np.testing.assert_allclose(spot, [1 + step[0], step[1], 1e-5], atol=1e-6)


def test_a_point_inside_geometry_is_replaced_by_a_valid_one(slanted):
    _, texels, surface = slanted
    rng = np.random.default_rng(8)
    mask = rng.integers(0, 65536, texels.n).astype(np.uint16)
    mask[:6] = [0, 0xFFFF, 1 << 5, 0x7FFF, 1, 0x8000]
    chosen = np.concatenate([np.arange(6), rng.integers(0, texels.n, 40)])
    wanted = rng.integers(0, 16, (46, 5)).astype(np.uint8)
    free = points(surface, chosen)
    ours = points(surface, chosen, mask, wanted)
    same = points(surface, chosen, mask, wanted[:1])
    for n, i in enumerate(chosen):
        good = [k for k in range(N_POINTS) if int(mask[i]) >> k & 1] or list(range(N_POINTS))
        for w, k in enumerate(wanted[n]):
            # Invalid points are replaced by the valid points in turn, so that all valid points are used about
            # equally often.
            truth = int(k) if k in good else good[k % len(good)]
            assert valid_point(mask[i], k) == truth
            for mine, every in zip(ours, free, strict=True):
                np.testing.assert_array_equal(mine[n, w], every[n, truth])
        np.testing.assert_array_equal(same[0][n], points(surface, [i], mask, wanted[:1])[0][0])
    used = np.bincount([valid_point(0b0101_0001_0000_0100, k) for k in range(16)], minlength=16)
    assert used[[2, 8, 12, 14]].sum() == 16
    assert used.max() <= 5
