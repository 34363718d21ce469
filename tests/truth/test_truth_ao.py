"""Ambient occlusion equals closed forms beside walls, with and without distance limit, and in boxes."""

from __future__ import annotations

import numpy as np
import pytest
from closed_forms import cornered_ao, limited_wall_ao, wall_ao, walled_ao
from scenes import SceneBuilder, icosphere
from ztest import assert_unbiased

SEEDS = 6


def wall_and_floor(height):
    """Return a builder and a floor of 16 rows of texels, 0.1 to 2.1 m from a wall 400 m long."""
    builder = SceneBuilder(64)
    material = builder.material(0.5)
    builder.quad((0, 0, -200), (0, height, 0), (0, 0, 400), material, (8, 8))
    floor = builder.quad((0.1, 0, -1), (0, 0, 2), (2, 0, 0), material, (16, 16))
    return builder, floor


def ao_rows(builder, floor, seed, **settings):
    """Return the AO (rows,) of the rows of floor texels, each averaged along the wall."""
    result = builder.bake(channels=["ao"], ao_samples=256, seed=seed, **settings)
    return floor.values(result, "ao")[..., 0].mean(axis=1)


def test_closed_forms_agree_with_quadrature():
    """The closed forms agree with sums over the unit disc of projected directions."""
    x, y = np.meshgrid(*[(np.arange(1500) + 0.5) / 750 - 1] * 2)
    inside = x * x + y * y < 1
    x, z = x[inside], np.sqrt(1 - x[inside] ** 2 - y[inside] ** 2)
    toward = x > 0
    x, z = np.where(toward, x, 1e-9), z
    for d, h in ((0.7, 1.0), (0.2, 3.0)):
        blocked = toward & (d * z / x < h)
        assert 1 - blocked.mean() == pytest.approx(wall_ao(d, h), abs=1e-3)
        blocked = toward & (d / x < h)
        assert 1 - blocked.mean() == pytest.approx(limited_wall_ao(d, h), abs=1e-3)
    for d, h, r in ((0.3, 1.0, 0.5), (0.1, 0.2, 0.5), (0.3, 0.2, 0.33), (0.4, 3.0, 1.0)):
        blocked = toward & (d * z / x < h) & (d / x < r)
        assert 1 - blocked.mean() == pytest.approx(walled_ao(d, h, r), abs=1e-3)
    y = y[inside]
    for a, b, r in ((0.1, 0.1, 0.5), (0.3, 0.4, 0.5), (0.2, 0.45, 0.5), (0.01, 0.02, 1.0), (0.3, 0.7, 0.5)):
        blocked = (x * r > a) | (y * r > b)
        assert 1 - blocked.mean() == pytest.approx(cornered_ao(a, b, r), abs=1e-3)
    assert wall_ao(0.7, 1.0) == pytest.approx(0.7867, abs=1e-4)


@pytest.mark.parametrize("height", [0.3, 1.0])
def test_floor_beside_a_long_wall_without_limit(height):
    builder, floor = wall_and_floor(height)
    truth = floor.texel_mean(lambda p: wall_ao(p[..., 0], height))[:, 0]
    found = [ao_rows(builder, floor, seed, ao_distance="inf") for seed in range(SEEDS)]
    # `slack`: ray origins are raised by 5e-7 of the scene's size of 400 m. This offset of 0.2 mm reduces the
    # height of the wall above the ray origins.
    assert_unbiased(found, truth, least=0.002, slack=3e-4)


@pytest.mark.parametrize("reach", [0.5, 1.5])
def test_floor_beside_a_long_wall_within_a_distance(reach):
    builder, floor = wall_and_floor(10.0)
    truth = floor.texel_mean(lambda p: limited_wall_ao(p[..., 0], reach), 8)[:, 0]
    found = [ao_rows(builder, floor, seed, ao_distance=str(reach)) for seed in range(SEEDS)]
    # `slack` is a margin: measured deviations are at most 0.15 %, and at most 2.1 standard errors.
    assert_unbiased(found, truth, least=0.002, slack=1e-3)
    assert truth[-1] == 1.0
    assert (np.array(found)[:, truth == 1.0] == 1.0).all()


def test_limited_ao_from_gather_rays_is_the_same_as_alone():
    """If irradiance is also baked, AO is computed from the gather rays and equals the closed form, too."""
    builder, floor = wall_and_floor(10.0)
    truth = floor.texel_mean(lambda p: limited_wall_ao(p[..., 0], 1.5), 8)[:, 0]
    found = []
    for seed in range(SEEDS):
        result = builder.bake(
            channels=["irradiance", "ao"], samples=256, ao_distance="1.5", sky="1", seed=seed
        )
        found.append(floor.values(result, "ao")[..., 0].mean(axis=1))
    # `slack` is the margin of the test above.
    assert_unbiased(found, truth, least=0.002, slack=1e-3)


def test_percentage_is_of_the_diagonal():
    builder = SceneBuilder(64)
    material = builder.material(0.5)
    builder.quad((0, 0, 0), (0, 0, 3), (4, 0, 0), material)
    builder.quad((0, 1, 0), (4, 0, 0), (0, 0, 3), material)
    # The diagonal is sqrt(26) = 5.099 m. 19 % of the diagonal is less than the 1 m from floor to ceiling, and
    # 21 % is more.
    near = builder.bake(channels=["ao"], ao_distance="19%").lightmaps["ao"].value
    far = builder.bake(channels=["ao"], ao_distance="21%").lightmaps["ao"].value
    assert near[near > 0].min() == 1.0
    assert far[far > 0].min() < 0.99


def test_lone_plane_and_convex_body_are_open():
    builder = SceneBuilder(128)
    material = builder.material(0.5)
    builder.triangles(icosphere(1), material, 5)
    result = builder.bake(channels=["ao"], ao_distance="inf")
    assert (result.lightmaps["ao"].value[result.status == 1] == 1.0).all()
    builder = SceneBuilder(32)
    floor = builder.quad((-5, 0, -5), (0, 0, 10), (10, 0, 0), builder.material(0.5), (24, 24))
    result = builder.bake(channels=["ao"], ao_distance="inf")
    assert (floor.values(result, "ao") == 1.0).all()


@pytest.mark.parametrize("denoise", [False, True])
def test_closed_box_is_dark_without_limit_and_open_in_the_middle_with_one(denoise):
    builder = SceneBuilder(64)
    quads = builder.box((0, 0, 0), (2, 2, 2), builder.material(0.5), 12, inward=True)
    result = builder.bake(channels=["ao"], ao_distance="inf", denoise=denoise)
    for quad in quads.values():
        assert (quad.values(result, "ao") == 0.0).all()
    result = builder.bake(channels=["ao"], ao_distance="0.5", denoise=denoise)
    for quad in quads.values():
        value = quad.values(result, "ao")[..., 0]
        # Texels farther than the AO distance from every wall are unoccluded.
        assert np.allclose(value[3:9, 3:9], 1.0, atol=0.02 if denoise else 0)
        assert value[0, 0] < value[0, 6] < value[6, 6]


def test_ao_falls_towards_a_wall_and_is_the_same_on_both_sides_of_it():
    builder = SceneBuilder(64)
    material = builder.material(0.5)
    builder.quad((0, 0, -200), (0, 1, 0), (0, 0, 400), material, (8, 8))
    right = builder.quad((0.05, 0, -1), (0, 0, 2), (2, 0, 0), material, (16, 16))
    left = builder.quad((-2.05, 0, -1), (0, 0, 2), (2, 0, 0), material, (16, 16))
    both = [
        [
            ao_rows(builder, right, seed, ao_distance="inf"),
            ao_rows(builder, left, seed, ao_distance="inf")[::-1],
        ]
        for seed in range(SEEDS)
    ]
    mean = np.mean(both, axis=0)
    assert (np.diff(mean, axis=1) > 0).all()
    assert_unbiased([a - b + 1 for a, b in both], np.ones(16), least=0.003)
