"""Lights without area: E is 1.0 lx at 1 m, inverse-square fall-off, glTF's spot cone, shadow edges."""

from __future__ import annotations

import numpy as np
import pytest
from closed_forms import point_irradiance
from scenes import SceneBuilder

UP = (0.0, 1.0, 0.0)


def floor_scene(size=64, half=2.0, texels=40, albedo=0.0):
    builder = SceneBuilder(size)
    floor = builder.quad(
        (-half, 0, -half), (0, 0, 2 * half), (2 * half, 0, 0), builder.material(albedo), (texels, texels)
    )
    return builder, floor


def assert_texels(found, truth, relative):
    """Compare texels (rows, columns) with their truth; each texel is a mean over 16 stratified points."""
    assert np.abs(found - truth).max() <= relative * truth.max()
    assert abs(found.mean() / truth.mean() - 1) < 1e-3


@pytest.mark.parametrize("denoise", [False, True])
def test_one_candela_gives_one_lux_at_one_metre(denoise):
    builder, floor = floor_scene(half=0.02, texels=9)
    builder.light("point", 1.0, position=(0.0, 1.0, 0.0))
    value = floor.values(builder.bake(denoise=denoise))
    # In the corners of the floor, 2.8 cm from its centre, E is 1 - 1.5 * 0.028**2 = 0.9988. Ray origins are
    # 1e-5 m above the floor, which raises E by 2e-5.
    assert value[4, 4] == pytest.approx([1.0, 1.0, 1.0], abs=1e-4 if not denoise else 2e-3)
    assert value.min() > 0.997


def test_inverse_square_and_cosine_at_every_texel():
    light = (0.7, 0.8, -0.4)
    builder, floor = floor_scene()
    builder.light("point", 3.0, position=light)
    found = floor.values(builder.bake())[..., 0]
    truth = floor.texel_mean(lambda p: 3.0 * point_irradiance(light, p, UP))
    # Texels are 0.1 m wide and the light is 0.8 m away, so E varies by up to 20 % within a texel. The
    # tolerance is for the mean over 16 points per texel.
    assert_texels(found, truth, 0.02)
    row, column = np.unravel_index(found.argmax(), found.shape)
    brightest = floor.points(1)[row, column, 0]
    # Rows run along x, columns along z. The brightest texel is below the light, so no axis is flipped.
    assert np.abs(brightest - [0.7, 0, -0.4]).max() < 0.2


def test_a_range_is_faded_out_to_as_gltf_says():
    light, reach = (0.7, 0.8, -0.4), 1.4
    builder, floor = floor_scene()
    builder.light("point", 3.0, position=light, range=reach)
    found = floor.values(builder.bake())[..., 0]

    def irradiance(p):
        window = np.clip(1 - (np.linalg.norm(p - light, axis=-1) / reach) ** 4, 0, 1)
        return 3.0 * point_irradiance(light, p, UP) * window

    assert_texels(found, floor.texel_mean(irradiance), 0.02)
    far = np.linalg.norm(floor.points(16) - light, axis=-1).min(axis=2) > reach
    assert far.sum() > 100
    assert (found[far] == 0).all()


def test_lights_add_up_and_keep_their_colours():
    builder, floor = floor_scene()
    builder.light("point", (1.0, 0.5, 0.0), position=(1.0, 1.0, 1.0))
    builder.light("point", (0.0, 0.5, 4.0), position=(-1.0, 1.5, 0.5))
    found = floor.values(builder.bake())
    first = floor.texel_mean(lambda p: point_irradiance((1, 1, 1), p, UP))
    second = floor.texel_mean(lambda p: point_irradiance((-1, 1.5, 0.5), p, UP))
    truth = first[..., None] * [1.0, 0.5, 0.0] + second[..., None] * [0.0, 0.5, 4.0]
    for c in range(3):
        assert_texels(found[..., c], truth[..., c], 0.02)


@pytest.mark.parametrize(("inner", "outer"), [(0.2, 0.6), (0.0, np.pi / 4), (0.5, 0.5000001)])
def test_spot_falls_off_between_its_cones_as_gltf_says(inner, outer):
    builder, floor = floor_scene(half=1.0)
    light, aim = np.array([0.1, 1.0, -0.2]), np.array([0.2, -1.0, 0.1])
    aim /= np.linalg.norm(aim)
    builder.light(
        "spot", 5.0, position=tuple(light), direction=tuple(aim), inner_cone=inner, outer_cone=outer
    )

    def irradiance(p):
        cosine = ((p - light) @ aim) / np.linalg.norm(p - light, axis=-1)
        scale = 1.0 / max(0.001, np.cos(inner) - np.cos(outer))
        share = np.clip((cosine - np.cos(outer)) * scale, 0, 1)
        return 5.0 * share**2 * point_irradiance(light, p, UP)

    found = floor.values(builder.bake())[..., 0]
    truth = floor.texel_mean(irradiance, 16)
    # The edge of a hard cone crosses texels. There, the lit share of 16 points differs from the lit area.
    assert_texels(found, truth, 0.03 if outer - inner > 0.1 else 0.15)
    outside = floor.points(16)
    cosine = ((outside - light) @ aim) / np.linalg.norm(outside - light, axis=-1)
    assert (found[(cosine < np.cos(outer) - 1e-3).all(axis=2)] == 0).all()
    assert (found[(cosine > np.cos(outer) + 2e-3).all(axis=2)] > 0).all()


def test_directional_light_is_even_and_follows_the_cosine():
    builder, floor = floor_scene()
    wall = builder.quad((9, 0, 0), (0, 0, 1), (0, 1, 0), builder.material(0.0), (8, 8))
    toward = np.array([0.6, -0.64, 0.48])
    builder.light("directional", 1000.0, direction=tuple(toward))
    result = builder.bake()
    assert np.allclose(floor.values(result), 640.0, rtol=1e-5)
    assert np.allclose(wall.values(result), 1000.0 * max(-toward @ wall.normal, 0.0), rtol=1e-5)


@pytest.mark.parametrize("double_sided", [False, True])
@pytest.mark.parametrize("facing", ["to the light", "away"])
@pytest.mark.parametrize("kind", ["point", "directional"])
def test_shadow_edges_lie_where_they_belong(kind, facing, double_sided):
    """Every surface blocks light from both sides; the blocker is not centred, so a flipped axis fails."""
    builder, floor = floor_scene(half=2.0, texels=40)
    edges = ((0.0, 0.0, 0.7), (0.5, 0.0, 0.0))
    edges = edges if facing == "to the light" else edges[::-1]
    black = builder.material(0.0, double_sided=double_sided)
    builder.quad((-0.3, 0.6, 0.25), *edges, black, (4, 4))
    light, toward = np.array([0.23, 1.87, 0.11]), np.array([0.43, -1.0, 0.27])
    toward /= np.linalg.norm(toward)
    if kind == "point":
        builder.light("point", 10.0, position=tuple(light))
    else:
        builder.light("directional", 10.0, direction=tuple(toward))

    def irradiance(p):
        arm = (light - p) if kind == "point" else np.broadcast_to(-toward, p.shape)
        cross = p + arm * ((0.6 - p[..., 1]) / arm[..., 1])[..., None]
        inside = (
            (cross[..., 0] > -0.3) & (cross[..., 0] < 0.2) & (cross[..., 2] > 0.25) & (cross[..., 2] < 0.95)
        )
        even = (
            10.0 * point_irradiance(light, p, UP)
            if kind == "point"
            else np.full(inside.shape, -10 * toward[1])
        )
        return np.where(inside, 0.0, even)

    found = floor.values(builder.bake(bounces=0))[..., 0]
    points = irradiance(floor.points(16))
    truth = floor.texel_mean(irradiance, 16)
    dark, cut = (points == 0).all(axis=2), (points == 0).any(axis=2) & ~(points == 0).all(axis=2)
    assert dark.sum() > 20
    assert cut.sum() > 15
    assert (found[dark] == 0).all()
    lit = ~dark & ~cut
    assert np.abs(found[lit] / truth[lit] - 1).max() < 0.02
    # In a texel crossed by the edge, the lit share of the 16 stratified points differs from the lit area by
    # at most 3 / 16.
    assert np.abs(found - truth)[cut].max() < 0.2 * truth.max()
    assert abs((found - truth)[cut].mean()) < 0.03 * truth.max()


def test_light_below_the_floor_does_not_reach_its_top():
    builder, floor = floor_scene(albedo=0.8)
    builder.light("point", 100.0, position=(0.0, -0.5, 0.0))
    assert (floor.values(builder.bake()) == 0).all()


def test_nearer_to_the_light_is_brighter():
    builder, floor = floor_scene()
    builder.light("point", 1.0, position=(-2.0, 0.5, 0.0))
    value = floor.values(builder.bake())[..., 0].mean(axis=1)
    assert (np.diff(value[3:]) < 0).all()


def test_mirrored_scene_has_the_mirrored_map():
    builder, floor = floor_scene()
    builder.light("point", 1.0, position=(0.5, 0.7, 0.2))
    mirrored, other = floor_scene()
    mirrored.light("point", 1.0, position=(-0.5, 0.7, 0.2))
    value, image = floor.values(builder.bake()), other.values(mirrored.bake())
    # The two texels have different points, so they differ by the noise of 16 points.
    assert np.abs(value - image[::-1]).max() < 0.03 * value.max()
