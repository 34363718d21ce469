"""Furnaces: E = pi L / (1 - rho) if all surfaces emit L, and E = pi L under a uniform sky."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder, icosphere
from ztest import assert_unbiased

SEEDS = 12


def furnace_box(albedo, size=32, texels=6):
    builder = SceneBuilder(size)
    quads = builder.box((0, 0, 0), (1, 2, 3), builder.material(albedo, 1.0), texels, inward=True)
    return builder, list(quads.values())


def covered(result, channel="irradiance"):
    """Return (n, C) values of all texels on surfaces."""
    return result.lightmaps[channel].value[result.status == 1].astype(np.float64)


@pytest.mark.parametrize(
    ("albedo", "denoise"),
    [(0.2, False), (0.5, False), (0.8, False), (0.95, False), (0.5, True), (0.95, True)],
)
def test_closed_box_emits_the_same_everywhere(albedo, denoise):
    builder, quads = furnace_box(albedo)
    truth = np.pi / (1 - albedo)
    means = []
    for seed in range(SEEDS):
        result = builder.bake(seed=seed, denoise=denoise)
        value = np.concatenate([q.values(result).reshape(-1, 3) for q in quads])
        assert len(value) == 6 * 36
        means.append(value.mean())
        # With 64 rays per texel, the sampled light of the emitters has a noise below 2 %. Reflected light is
        # the same at all texels.
        assert value.std() < 0.02 * truth
        assert np.abs(value - truth).max() < 0.12 * truth
        # The rays are the same for all three colours. The denoiser changes the colour of texels slightly.
        spread = np.ptp(value, axis=1) / value.mean(axis=1)
        assert np.median(spread) < (0.003 if denoise else 1e-6)
        assert spread.max() < (0.02 if denoise else 1e-5)
    # Patches have independent samples of direct light. Therefore the mean over all texels of 12 bakes has a
    # standard error below 0.5 % (`least`).
    assert_unbiased(means, truth, least=0.005)


@pytest.mark.parametrize("smooth", [False, True])
def test_inward_sphere_emits_the_same_everywhere(smooth):
    corner = icosphere(1, inward=True)
    means = []
    for seed in range(SEEDS):
        builder = SceneBuilder(128)
        builder.triangles(corner, builder.material(0.5, 1.0), 4, normal=-corner if smooth else None)
        result = builder.bake(seed=seed)
        value = covered(result) / (2 * np.pi)
        means.append(value.mean())
        assert value.std() < 0.03
    # Smooth normals deviate from face normals by up to 20 degrees, but all rays still hit walls.
    assert_unbiased(means, 1.0, least=0.005)


def test_coloured_furnace_keeps_colours_apart():
    albedo, emission = np.array([0.2, 0.5, 0.8]), np.array([3.0, 0.0, 1.0])
    means = []
    for seed in range(SEEDS):
        builder = SceneBuilder(64)
        quads = builder.box((0, 0, 0), (1, 1, 1), builder.material(albedo, emission), 12, inward=True)
        result = builder.bake(seed=seed)
        means.append(np.mean([q.values(result).mean(axis=(0, 1)) for q in quads.values()], axis=0))
    assert_unbiased(means, np.pi * emission / (1 - albedo), least=0.005)


@pytest.mark.parametrize("shape", ["box", "sphere"])
def test_convex_body_under_an_even_sky(shape):
    sky = (0.5, 1.0, 2.0)
    builder = SceneBuilder(128)
    material = builder.material(0.7)
    if shape == "box":
        builder.box((-1, -1, -1), (1, 2, 3), material, 12)
    else:
        builder.triangles(icosphere(2), material, 4)
    result = builder.bake(sky="0.5,1,2", channels=["irradiance", "ao"], ao_distance="inf")
    # All rays leave the scene, so the only error is the rounding of float32 sums of 64 terms.
    assert np.allclose(covered(result), np.pi * np.array(sky), rtol=2e-6)
    assert (covered(result, "ao") == 1.0).all()


def test_sky_over_a_floor_beside_a_wall_is_half_hidden():
    builder = SceneBuilder(64)
    black = builder.material(0.0)
    # The wall ends 2000 m above the floor and 2000 m to each side. The floor ends 1 m in front of the wall,
    # so the wall hides half of the sky.
    builder.quad((0, -2000, -2000), (0, 4000, 0), (0, 0, 4000), black, (8, 8))
    floor = builder.quad((1e-3, 0, -0.5), (0, 0, 1), (1, 0, 0), black, (16, 16))
    assert floor.normal @ [0, 1, 0] == 1
    values = [floor.values(builder.bake(seed=seed, sky="1", samples=64))[..., 0] for seed in range(4)]
    assert_unbiased([v.mean() for v in values], np.pi / 2, least=0.002)
    # Each of the 64 rays of a texel contributes pi / 64. The limit is an error of 8 rays that wrongly hit or
    # miss the wall.
    assert np.abs(np.array(values) - np.pi / 2).max() < np.pi / 8


def test_sky_light_bounces_once_from_a_wall():
    """Half of a floor texel's hemisphere is sky, the other half a huge wall of albedo 0.6.

    The floor is so small that it hides no sky from the wall, so the wall has E = pi.
    """
    builder = SceneBuilder(64)
    builder.quad((0, -2000, -2000), (0, 4000, 0), (0, 0, 4000), builder.material(0.6), (8, 8))
    speck = builder.quad((1e-3, 0, -0.5), (0, 0, 1), (1, 0, 0), builder.material(0.0), (16, 16))
    means = [speck.values(builder.bake(seed=seed, sky="1"))[..., 0].mean() for seed in range(SEEDS)]
    assert_unbiased(means, np.pi * (0.5 + 0.5 * 0.6), least=0.002)


@pytest.mark.parametrize("denoise", [False, True])
def test_rough_ground_under_an_even_sky_is_never_brighter_than_flat_ground(denoise):
    """E <= pi L and 0 <= AO <= 1 at every texel, also at chart borders and in dilated texels."""
    builder = SceneBuilder(64)
    rng = np.random.default_rng(5)
    for texels in ((40.3, 17.6), (23.7, 25.2), (11.4, 9.7)):
        x, y = np.meshgrid(np.linspace(0, 4, 14), np.linspace(0, 3, 10))
        point = np.stack([x, y, 10.0 * len(builder.meshes) + 0.25 * rng.random(x.shape)], axis=-1)
        builder.sheet(point, builder.material(0.5), texels)
    result = builder.bake(
        sky="1", bounces=0, channels=["irradiance", "ao"], ao_distance="inf", denoise=denoise, samples=32
    )
    for channel, most in (("irradiance", np.pi), ("ao", 1.0)):
        value = result.lightmaps[channel].value
        # The tolerance covers the rounding of sums over 32 rays.
        assert value.max() <= most * (1 + 1e-5)
        assert value.max() > 0.95 * most
        assert value.min() >= 0.0
        assert value[result.status == 1].min() > 0.05 * most
        # The denoiser and the extrapolation leave no dilated texel black.
        assert value[result.status == 2].min() > 0.0
