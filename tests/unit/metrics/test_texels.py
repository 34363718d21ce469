"""Texels, points and lookups that `verify` and `diff` choose, compared with the geometry of simple scenes."""

from __future__ import annotations

import numpy as np
from tiny_scenes import Quad, quad_atlas, quad_scene, quad_world

from baker.core.geometry import world_geometry
from baker.kernels.surface import ROUNDING
from baker.metrics.misalignment import best_shift, exponent
from baker.metrics.sample_texels import choose_texels
from baker.metrics.texel_area import instance_map, look_up, surface_points


def two_quads():
    quads = [Quad((0, 0, 0), (4, 0, 0), (0, 1, 0)), Quad((0, 0, 2), (0, 3, 0), (1, 0, 1))]
    scene = quad_scene(quads)
    return world_geometry(scene, quad_atlas(scene, 32, inset=0.3))


def test_objects_of_texels_are_those_of_the_bake():
    quads = [Quad((0, 0, 0), (4, 0, 0), (0, 1, 0)), Quad((0, 0, 2), (0, 3, 0), (1, 0, 1))]
    world = quad_world(quads, 32, inset=0.3)
    owner = instance_map(world.geometry, 1, world.texels.resolution).reshape(-1)
    front = slice(0, world.texels.n_front)
    np.testing.assert_array_equal(owner[world.texels.pixel[front]], world.texels.instance[front])
    rest = np.setdiff1d(np.arange(len(owner)), world.texels.pixel[front])
    assert (owner[rest] == -1).all()


def test_points_lie_in_their_texel_and_fill_it_evenly():
    geometry = two_quads()
    size = round(np.sqrt(len(instance_map(geometry, 1, 32).reshape(-1))))
    pixel = np.flatnonzero(instance_map(geometry, 1, size).reshape(-1) == 0)
    found = surface_points(geometry, pixel, size, 64, 1)
    # Quad 0 lies in the plane z = 0. `fit` (3, 2) maps (x, y, 1) to its uv.
    corner = geometry.triangle[geometry.instance == 0].reshape(-1)
    uv, position = geometry.uv[corner], geometry.position[corner]
    fit, *_ = np.linalg.lstsq(np.c_[position[:, :2], np.ones(len(position))], uv, rcond=None)
    at = (
        np.concatenate([found.position[..., :2], np.ones((*found.position.shape[:2], 1))], axis=2)
        @ fit
        * size
    )
    row, column = np.divmod(pixel, size)
    assert (np.abs(at[..., 0] - column[:, None] - 0.5) <= 0.5 + 1e-4).all()
    assert (np.abs(at[..., 1] - row[:, None] - 0.5) <= 0.5 + 1e-4).all()
    # The points are offset from the surface by `ROUNDING` times the triangle's size, 4 m.
    np.testing.assert_allclose(found.position[..., 2], 4 * ROUNDING, atol=1e-9)
    np.testing.assert_allclose(np.abs(found.normal[..., 2]), 1, atol=1e-6)
    whole = found.area > 0.999
    assert whole.any()
    assert (~whole).any(), "border texels are cut"
    spread = at[whole] - np.stack([column, row], axis=1)[whole][:, None]
    np.testing.assert_allclose(spread.mean(axis=(0, 1)), 0.5, atol=0.01)
    np.testing.assert_allclose(spread.var(axis=(0, 1)), 1 / 12, rtol=0.05)


def test_border_texels_are_looked_up_where_their_surface_is():
    geometry = two_quads()
    size = round(np.sqrt(len(instance_map(geometry, 1, 32).reshape(-1))))
    pixel = np.flatnonzero(instance_map(geometry, 1, size).reshape(-1) >= 0)
    found = surface_points(geometry, pixel, size, 64, 1)
    whole = found.area > 0.999
    np.testing.assert_array_equal(found.offset[whole], 0)
    half = (found.area > 0.2) & (found.area < 0.8)
    assert half.any()
    assert (np.abs(found.offset[half]).max(axis=1) > 0.1).all()
    # The page contains its own row and column coordinates, so a lookup returns the position of the lookup.
    row, column = np.mgrid[:size, :size]
    page = np.stack([row + 0.5, column + 0.5], axis=2)[None].astype(np.float32)
    inside = ((pixel % size) % (size - 1) > 0) & ((pixel // size) % (size - 1) > 0)
    value = look_up(page, pixel[inside], found.offset[inside])
    at = np.stack([pixel // size, pixel % size], axis=1) + 0.5 + found.offset[:, ::-1]
    np.testing.assert_allclose(value, at[inside], atol=1e-5)


def test_every_object_and_every_brightness_is_chosen():
    owner = np.repeat([0, 1, 2, -1], [5000, 100, 3, 50]).astype(np.int32)
    light = np.random.default_rng(0).random(len(owner))
    eligible = np.ones(len(owner), bool)
    eligible[::7] = False
    chosen = choose_texels(owner, eligible, light, 300, 0)
    assert (np.diff(chosen) > 0).all()
    assert eligible[chosen].all()
    count = np.bincount(owner[chosen], minlength=3)
    assert abs(len(chosen) - 300) < 20
    assert count[1] >= 6
    assert count[2] >= 1
    # Texels are chosen at regular steps of their rank by light, so their distribution is that of all texels.
    mine, all_of = np.sort(light[chosen[owner[chosen] == 0]]), light[eligible & (owner == 0)]
    rank = np.searchsorted(np.sort(all_of), mine) / len(all_of)
    assert np.abs(rank - (np.arange(len(mine)) + 0.5) / len(mine)).max() < 0.01
    np.testing.assert_array_equal(choose_texels(owner, eligible, light, 300, 0), chosen)
    assert not np.array_equal(choose_texels(owner, eligible, light, 300, 1), chosen)
    assert len(choose_texels(owner, eligible, light, 10**6, 0)) == (eligible & (owner >= 0)).sum()


def test_shifts_and_power_curves_are_detected():
    y, x = np.mgrid[:64, :64] / 64
    page = (1.5 + np.sin(7 * x) * np.cos(5 * y))[None]
    pixel = np.random.default_rng(0).choice(64 * 64, 500, replace=False)
    covered = np.ones(page.shape, bool)
    truth = page.reshape(-1)[pixel]
    noisy = truth * (1 + 0.01 * np.random.default_rng(1).standard_normal(500))
    assert best_shift(page, covered, pixel, noisy) == (0, 0)
    assert best_shift(np.roll(page, 1, axis=1), covered, pixel, noisy) == (1, 0)
    assert best_shift(np.roll(page, -1, axis=2), covered, pixel, noisy) == (0, -1)
    assert best_shift(page, ~covered, pixel, noisy) == (0, 0)
    assert abs(exponent(truth, noisy) - 1) < 0.02
    assert abs(exponent(truth**0.4545, noisy) - 0.4545) < 0.02
    assert exponent(truth[:10], noisy[:10]) is None
    assert exponent(np.ones(500), np.ones(500)) is None
