"""Texture lookups and the albedo of texels agree with Python loops over pixels."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from inner import compiled
from tiny_scenes import Quad, quad_world

from baker.core.colour import linear_from_srgb
from baker.core.scene import Material, Texture
from baker.kernels.surface import N_POINTS, place_points
from baker.kernels.texel_info import texel_footprint, uv_at
from baker.kernels.textures import PackImage, pack_textures, sample_texture, value_limits

sample_texture, texel_footprint, uv_at = compiled(sample_texture, texel_footprint, uv_at)

MODES = ("repeat", "mirror", "clamp")


def lookup(pack, k, u, v, footprint=0.0):
    out = np.zeros(4)
    sample_texture(pack, k, float(u), float(v), float(footprint), out)
    return out


def test_the_srgb_curve():
    np.testing.assert_allclose(linear_from_srgb([0, 1]), [0, 1])
    assert float(linear_from_srgb(0.5)) == pytest.approx(0.21404114, abs=1e-7)
    assert float(linear_from_srgb(0.04)) == pytest.approx(0.04 / 12.92)


@pytest.mark.parametrize("shape", [(4, 6), (1, 5), (7, 1), (1, 1)])
def test_lookups_are_bilinear_for_every_wrap(shape):
    rng = np.random.default_rng(sum(shape))
    image = rng.random((*shape, 4)).astype(np.float32)
    pairs = [(a, b) for a in MODES for b in MODES]
    pack = pack_textures([PackImage(image, pair) for pair in pairs])
    for k, wrap in enumerate(pairs):
        for u, v in [*rng.uniform(-3, 4, (40, 2)), (0, 0), (1, 1), (0.5, -1), (1e4 + 0.25, 0.5)]:
            np.testing.assert_allclose(lookup(pack, k, u, v), naive.bilinear(image, u, v, wrap), atol=2e-5)


@pytest.mark.parametrize("shape", [(8, 8), (6, 10), (5, 3), (1, 9)])
def test_footprints_read_the_halved_image(shape):
    rng = np.random.default_rng(sum(shape))
    image = rng.random((*shape, 4)).astype(np.float32)
    pack = pack_textures([PackImage(image, ("repeat", "clamp"))])
    levels = naive.pyramid(image)
    assert pack.n_levels[0] == len(levels)
    for n, level in enumerate(levels):
        footprint = 2.0**n / max(shape)
        for u, v in rng.uniform(0, 1, (10, 2)):
            truth = naive.bilinear(level, u, v, ("repeat", "clamp"))
            np.testing.assert_allclose(lookup(pack, 0, u, v, footprint), truth, atol=1e-5)
    np.testing.assert_allclose(lookup(pack, 0, 0.3, 0.3, 1e6), levels[-1][0, 0], atol=1e-5)


def test_bytes_are_decoded_before_they_are_averaged():
    image = np.zeros((2, 2, 4), np.uint8)
    image[0] = [255, 0, 128, 64]
    pack = pack_textures([PackImage(image, ("repeat", "repeat"))])
    grey = float(linear_from_srgb(128 / 255))
    np.testing.assert_allclose(lookup(pack, 0, 0.25, 0.25), [1, 0, grey, 64 / 255], atol=1e-6)
    # The mean of linear 0 and 1 is 0.5. The mean of the sRGB codes would decode to 0.21.
    np.testing.assert_allclose(lookup(pack, 0, 0.5, 0.5, 1.0), [0.5, 0, grey / 2, 32 / 255], atol=1e-6)
    assert pack_textures([]).pixels.shape == (1, 4)


@pytest.mark.parametrize("shape", [(8, 8), (600, 3), (5, 301), (1, 9)])
@pytest.mark.parametrize("linear", [False, True])
def test_lookups_in_bytes_equal_those_in_floats(shape, linear):
    rng = np.random.default_rng(sum(shape))
    image = rng.integers(0, 256, (*shape, 4)).astype(np.uint8)
    value = image / np.float32(255)
    if not linear:
        value[..., :3] = linear_from_srgb(image[..., :3] / 255.0)
    in_bytes = pack_textures([PackImage(image, ("repeat", "mirror"), linear=linear)])
    in_floats = pack_textures([PackImage(value, ("repeat", "mirror"))])
    assert in_bytes.coded.nbytes == image.nbytes
    assert in_bytes.pixels.nbytes == in_floats.pixels.nbytes - value.nbytes
    for n in range(4):
        for u, v in rng.uniform(-2, 2, (20, 2)):
            footprint = 2.0**n / max(shape)
            assert (lookup(in_bytes, 0, u, v, footprint) == lookup(in_floats, 0, u, v, footprint)).all()
    for found, truth in zip(value_limits(in_bytes, 0), value_limits(in_floats, 0), strict=True):
        assert np.array_equal(found, truth)
    assert np.array_equal(value_limits(in_floats, 0)[0], value.reshape(-1, 4).min(axis=0))


def test_each_texture_of_a_pack_has_its_own_texels():
    rng = np.random.default_rng(5)
    shapes = [(3, 4), (6, 2), (1, 1), (2, 5), (1, 1)]
    images = [
        rng.integers(0, 256, (*shape, 4)).astype(np.uint8) if k % 2 else rng.random((*shape, 4), np.float32)
        for k, shape in enumerate(shapes)
    ]
    together = pack_textures([PackImage(image, ("clamp", "repeat")) for image in images])
    for k, image in enumerate(images):
        alone = pack_textures([PackImage(image, ("clamp", "repeat"))])
        for n, (u, v) in enumerate(rng.uniform(-1, 2, (12, 2))):
            footprint = 0.5 * (n % 3)
            assert (lookup(together, k, u, v, footprint) == lookup(alone, 0, u, v, footprint)).all()


@pytest.fixture(scope="module")
def painted():
    """Return (world, quads, (noise, ramp, turn)) of four quads.

    Quad 0 has a noise texture with the transform `turn` and wrap modes, quad 1 a linear ramp as texture,
    quad 2 vertex colours, and quad 3 a constant colour.
    """
    rng = np.random.default_rng(3)
    noise = rng.integers(0, 256, (13, 9, 4)).astype(np.uint8)
    ramp = np.ones((64, 64, 4), np.float32)
    ramp[..., 0] = (np.arange(64) + 0.5) / 64
    ramp[..., 1] = ramp[..., 0].T
    turn = np.array([[0.0, -3.0, 0.4], [2.0, 0.5, -0.2]])
    quads = [
        Quad(
            (0, 0, 0),
            (1, 0, 0),
            (0, 1, 0),
            Material("noise", (0.5, 0.7, 0.9, 1), Texture(noise, 0, turn, ("mirror", "repeat"))),
        ),
        Quad(
            (2, 0, 0),
            (1, 0, 0),
            (0, 1, 0),
            Material("ramp", (1, 1, 1, 1), Texture(ramp, wrap=("clamp", "clamp"))),
        ),
        Quad((4, 0, 0), (1, 0, 0), (0, 1, 0), Material("corners", (0.5, 1, 1, 1)), rng.random((4, 4))),
        Quad((6, 0, 0), (1, 0, 0), (0, 1, 0), Material("plain", (0.2, 0.4, 0.6, 1))),
    ]
    return quad_world(quads, 24, inset=0.3), quads, (noise, ramp, turn)


def test_albedo_is_the_mean_over_the_points(painted):
    world, quads, (noise, ramp, turn) = painted
    texels, geometry = world.texels, world.geometry
    levels = [
        naive.pyramid(np.dstack([linear_from_srgb(noise[..., :3] / 255), noise[..., 3:] / 255])),
        naive.pyramid(ramp),
    ]
    transform = [turn, np.eye(2, 3)]
    wrap = [("mirror", "repeat"), ("clamp", "clamp")]
    points = np.zeros((1, N_POINTS, 3), np.float32), np.zeros((1, N_POINTS, 3), np.float32)
    every = np.arange(N_POINTS, dtype=np.uint8)[None]
    hit, bary = np.zeros((1, N_POINTS), np.int32), np.zeros((1, N_POINTS, 2), np.float32)
    for i in np.random.default_rng(0).choice(texels.n_front, 60, replace=False):
        k = int(texels.instance[i])
        place_points(world.surface, world.free, np.array([i]), every, *points, hit, bary)
        mesh = world.scene.meshes[k]
        total = np.zeros(3)
        for t, (b1, b2) in zip(hit[0], bary[0].astype(float), strict=True):
            source = geometry.vertex_source[geometry.triangle[t]]
            share = np.array([1 - b1 - b2, b1, b2])
            value = np.array(quads[k].material.base_colour[:3])
            if k < 2:
                u, v = transform[k] @ [*(share @ mesh.texcoord[0][source]), 1.0]
                image_area = abs(np.linalg.det(transform[k][:, :2]))
                # A quad covers 10.4 x 10.4 texels, and each of the 16 points represents 1/16 of a texel.
                footprint = np.sqrt(image_area / 10.4**2 / N_POINTS)
                width = max(levels[k][0].shape[:2])
                n = int(np.floor(np.log2(max(footprint * width, 1)) + 0.5))
                value = value * naive.bilinear(levels[k][n], u, v, wrap[k])[:3]
            elif k == 2:
                value = value * (share @ mesh.colour[source].astype(float))[:3]
            total += value / N_POINTS
        np.testing.assert_allclose(texels.albedo[i], total, atol=3e-5)


def test_albedo_is_the_mean_over_the_area(painted):
    world, quads, _ = painted
    texels = world.texels
    own = np.flatnonzero(texels.instance[: texels.n_front] == 1)
    # The mean of a linear ramp over a texel is the ramp's value at the centroid. The tolerance is needed
    # because the albedo is a mean over 16 points only.
    ramp = texels.position[own, :2] - [2, 0]
    inner = (np.abs(ramp - 0.5) < 0.4).all(axis=1)
    assert inner.sum() > 40
    np.testing.assert_allclose(texels.albedo[own][inner][:, :2], ramp[inner], atol=0.02)
    # The area-weighted mean over all texels of a quad is the mean over the quad. Corners 0 and 2 belong to
    # both triangles, so their vertex colours have twice the weight.
    colours = np.array(quads[2].colour)[[0, 0, 1, 2, 2, 3], :3].mean(axis=0) * [0.5, 1, 1]
    for k, truth in ((1, [0.5, 0.5, 1.0]), (2, colours)):
        own = texels.instance[: texels.n_front] == k
        mean = np.average(
            texels.albedo[: texels.n_front][own], axis=0, weights=texels.area[: texels.n_front][own]
        )
        np.testing.assert_allclose(mean, truth, atol=2e-3)
    own = texels.instance[: texels.n_front] == 3
    np.testing.assert_allclose(
        texels.albedo[: texels.n_front][own], np.tile([0.2, 0.4, 0.6], (own.sum(), 1)), rtol=1e-6
    )


def test_footprint_of_a_uv_without_area(painted):
    world, *_ = painted
    assert texel_footprint(world.surface, np.zeros_like(world.geometry.uv), 0) == 0.0
    flat = world.surface._replace(uv=np.zeros_like(world.geometry.uv))
    assert np.isfinite(texel_footprint(flat, world.geometry.uv, 0))
    u, v = uv_at(world.geometry.uv, world.geometry.triangle, 1, 0.25, 0.5)
    corner = world.geometry.uv[world.geometry.triangle[1]]
    np.testing.assert_allclose([u, v], [0.25, 0.25, 0.5] @ corner, rtol=1e-6)


@pytest.mark.parametrize("footprint", [1e20, 3e38, np.inf, np.nan])
def test_a_footprint_without_bounds_reads_the_coarsest_image(footprint):
    image = np.random.default_rng(3).random((8, 8, 4)).astype(np.float32)
    pack = pack_textures([PackImage(image, ("repeat", "repeat"))])
    out = np.zeros(4, np.float32)
    sample_texture(pack, 0, 0.3, 0.6, footprint, out)
    if np.isnan(footprint):
        assert np.isfinite(out).all()
    else:
        np.testing.assert_allclose(out, image.mean((0, 1)), rtol=1e-5)
