"""Textured emitters are divided into parts. Hits and samples find the same part, and power is preserved."""

from __future__ import annotations

import numpy as np
import pytest
from inner import compiled
from tiny_scenes import Quad, grey, quad_world

from baker.core.scene import Material, Texture
from baker.kernels.emitters import (
    AREA,
    INSIDE,
    RADIANCE,
    TEXTURED,
    emitted_radiance,
    emitter_at,
    emitter_density,
    needed_shading,
    on_triangle,
    sample_emitter,
    tile_emitters,
)
from baker.lights.emissive import MOST_PARTS, build_emitters

emitted_radiance, emitter_at, emitter_density = compiled(emitted_radiance, emitter_at, emitter_density)
on_triangle, sample_emitter = compiled(on_triangle, sample_emitter)


def emissive(image, emission=(1.0, 1.0, 1.0), **how):
    rgba = np.ones((*image.shape[:2], 4), np.float32)
    rgba[..., :3] = image
    return Material(base_colour=(0, 0, 0, 1), emission=emission, emission_texture=Texture(rgba, **how))


def one_texel(n=64, row=50, column=5):
    image = np.zeros((n, n, 3), np.float32)
    image[row, column] = 1.0
    return image


def blobs(n=48):
    """Return an (n, n, 3) image of round spots in several colours on a dark background."""
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:n, :n] + 0.5
    image = np.full((n, n, 3), 0.002, np.float32)
    for _ in range(12):
        cx, cy, r = *rng.uniform(0, n, 2), rng.uniform(0.6, 4)
        image[(x - cx) ** 2 + (y - cy) ** 2 < r * r] = rng.random(3)
    return image


def plate(material, far=0.0):
    """Return the world of an emitting plate of 2 x 1 m that faces down and of a grey quad at x = `far`."""
    quads = [Quad((0, 1, 0), (2, 0, 0), (0, 0, 1), material)]
    return quad_world([*quads, Quad((far, -3, 0), (1, 0, 0), (0, 0, -1), grey(0.5))])


@pytest.mark.parametrize("nearest", [False, True])
@pytest.mark.parametrize("image", [one_texel(), one_texel(33, 0, 32), blobs()])
def test_power_is_that_of_the_texture(image, nearest):
    emission = (3.0, 1.0, 0.25)
    emitters = plate(emissive(image, emission, nearest=nearest)).emitters
    truth = np.pi * 2.0 * (image.reshape(-1, 3).astype(float).mean(axis=0) * emission).mean()
    assert emitters.power.sum() == pytest.approx(truth, rel=1e-6)
    assert len(emitters.row) < MOST_PARTS


@pytest.mark.parametrize("far", [0.0, 300.0])
@pytest.mark.parametrize("image", [one_texel(), blobs()])
def test_a_hit_finds_the_part_that_is_there(image, far):
    world = plate(emissive(image), far)
    emitters = world.emitters
    rng = np.random.default_rng(1)
    seen = 0
    for t in (0, 1):
        b = rng.random((4000, 2))
        b = np.where(b.sum(axis=1, keepdims=True) > 1, 1 - b, b).astype(np.float32)
        out = np.zeros(4)
        own = np.flatnonzero(emitters.triangle == t)
        inside = emitters.row[own, INSIDE : INSIDE + 3].astype(float)
        for b1, b2 in b:
            m = emitter_at(emitters.node, int(emitters.root[t]), b1, b2)
            u, v = ((np.array([b1, b2]) - inside[:, :2]) / inside[:, 2:]).T
            holds = own[(u >= -1e-6) & (v >= -1e-6) & (u + v <= 1 + 1e-6)]
            emitted_radiance(world.shading, t, b1, b2, out)
            if m < 0:
                # No part is stored where the texture is black.
                assert not out[:3].any()
                assert len(holds) <= 2
            else:
                seen += 1
                assert m in holds
                assert emitters.triangle[m] == t
                if emitters.row[m, TEXTURED] == 0 and emitters.row[m, INSIDE + 2] ** 2 > 0.01:
                    np.testing.assert_allclose(emitters.row[m, RADIANCE : RADIANCE + 3], out[:3], rtol=0.01)
    assert seen > 3
    # If the radiance of all parts is constant, kernels read no textures.
    if (emitters.row[:, TEXTURED] == 0).all():
        assert needed_shading(emitters, world.shading) is None


def test_parts_do_not_overlap_and_leave_out_what_is_black():
    emitters = plate(emissive(blobs())).emitters
    whole = emitters.row[:, INSIDE + 2].astype(float) ** 2
    assert whole[emitters.triangle == 0].sum() == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(emitters.row[:, AREA], whole, rtol=1e-5)
    lit = plate(emissive(one_texel())).emitters.row
    # With bilinear lookup, one lit texel lights an area of 2 x 2 texels. Parts cover at most 3 x 3 texels.
    assert 4 / 4096 <= lit[:, AREA].sum() / 2 <= 9 / 4096


def test_sampled_points_lie_where_their_density_says():
    world = plate(emissive(blobs()), 300.0)
    chosen = tile_emitters(world.emitters, np.full((1, 16, 3), [0.5, -1, 0.5], np.float32))
    rng, point, out = np.random.default_rng(0), np.zeros(3, np.float32), np.zeros(4)
    found = np.zeros(3)
    n, choice = 20000, (chosen.row, chosen.first, chosen.chance, chosen.cumulative)
    for u, v in rng.random((n, 2), np.float32):
        m, density, b1, b2 = sample_emitter(*choice, u, v, point)
        a1, a2 = on_triangle(chosen.row, m, b1, b2)
        # A point on the edge between two parts may be assigned to either part.
        if min(b1, b2, 1 - b1 - b2) > 1e-4:
            assert emitter_at(chosen.node, int(world.emitters.root[chosen.triangle[m]]), a1, a2) == m
        corner = world.geometry.position[world.geometry.triangle[chosen.triangle[m]]].astype(float)
        np.testing.assert_allclose(point, corner.T @ [1 - a1 - a2, a1, a2], atol=1e-6)
        out[:3] = chosen.row[m, RADIANCE : RADIANCE + 3]
        if chosen.row[m, TEXTURED] > 0:
            emitted_radiance(world.shading, chosen.triangle[m], a1, a2, out)
        found += out[:3] / density / n
    truth = 2.0 * blobs().reshape(-1, 3).mean(axis=0)
    np.testing.assert_allclose(found, truth, rtol=0.02)


def test_equal_uv_give_one_part_per_triangle():
    """If all uv are equal, each triangle is a single part with the constant radiance of one texel."""
    image = blobs(8)
    world = plate(emissive(image))
    shading = world.shading._replace(emission_uv=np.full_like(world.shading.emission_uv, 3.5 / 8))
    emitters = build_emitters(world.geometry, shading)
    assert len(emitters.row) == 2
    assert (emitters.row[:, TEXTURED] == 0).all()
    np.testing.assert_allclose(emitters.row[:, RADIANCE : RADIANCE + 3], [image[3, 3]] * 2, rtol=1e-6)


def test_a_dim_emitter_is_cut_as_finely_beside_a_bright_one():
    faint, bright = emissive(one_texel(), (1e-3,) * 3), emissive(blobs(200), (1e6,) * 3)
    emitters = quad_world(
        [Quad((0, 1, 0), (2, 0, 0), (0, 0, 1), faint), Quad((9, 1, 0), (2, 0, 0), (0, 0, 1), bright)]
    ).emitters
    size = np.abs(emitters.row[emitters.triangle < 2, INSIDE + 2])
    assert len(size) > 3
    assert size.max() < 0.05


def test_more_lit_texels_than_parts_keep_their_power():
    """200 x 200 lit texels exceed the limit of 2000 parts, so each part has the mean radiance of its area."""
    image = one_texel()
    world = plate(emissive(image, (8.0,) * 3))
    shading = world.shading._replace(emission_uv=world.shading.emission_uv * np.float32(200))
    emitters = build_emitters(world.geometry, shading, 2000)
    assert len(emitters.row) <= 2002
    assert emitters.power.sum() == pytest.approx(np.pi * 2 * 8 / 4096, rel=1e-5)
    assert (emitters.row[:, TEXTURED] == 0).all()
    assert emitters.row[:, RADIANCE].max() < 5 * 8 / 4096


def test_many_parts_leave_other_emitters_their_clusters():
    near = [Quad((0.2 * k, 0, 3), (0.1, 0, 0), (0, 0, 0.1), grey(0, 1.0)) for k in range(100)]
    screen = Quad((0, 1, 0), (2, 0, 0), (0, 0, 1), emissive(np.random.default_rng(0).random((64, 64, 3))))
    emitters = quad_world([screen, *near], size=64).emitters
    assert (emitters.triangle < 2).sum() > 1000
    cluster = emitters.row[emitters.triangle >= 2, 16]
    assert len(np.unique(cluster)) > 60
