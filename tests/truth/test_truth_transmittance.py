"""Coloured panes multiply light by T = (1 - a) lerp(1, c, a), for all kinds of lights and all bounces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import point_irradiance, polygon_irradiance
from scenes import SceneBuilder, form_factors
from test_truth_alpha import floor_under

from baker.core.scene import Texture

COLOUR = np.array([1.0, 0.5, 0.0])
HALF = 0.5
LIGHT_AT = (0.0, 2.0, 0.0)


def glass(builder, colour=COLOUR, alpha=HALF, *, rgba=None):
    """Add a double-sided BLEND material and return its index; `rgba` (H, W, 4) is a linear texture."""
    number = builder.material(0.0, double_sided=True)
    texture = None if rgba is None else Texture(np.float32(rgba), wrap=("clamp", "clamp"))
    builder.materials[number] = replace(
        builder.materials[number],
        base_colour=(*colour, alpha),
        base_colour_texture=texture,
        alpha_mode="BLEND",
    )
    return number


def pane(colour=COLOUR, alpha=HALF, **settings):
    return lambda builder: glass(builder, colour, alpha, **settings)


def passed(colour, alpha):
    """Return the transmittance T of a surface for each colour."""
    return (1 - alpha) * (1 - alpha + alpha * np.asarray(colour))


@pytest.mark.parametrize("panes", [[(COLOUR, 0.5)], [(COLOUR, 0.5), ((0.2, 0.4, 1.0), 0.25)]])
def test_each_pane_multiplies_the_light_of_a_point(panes):
    builder, floor = floor_under(*[pane(*p) for p in panes], light="point", position=LIGHT_AT)
    found = floor.values(builder.bake(bounces=0))
    truth = floor.texel_mean(lambda p: point_irradiance(LIGHT_AT, p, (0, 1, 0)))[..., None]
    share = np.prod([passed(*p) for p in panes], axis=0)
    free_builder, free_floor = floor_under(light="point", position=LIGHT_AT)
    free = free_floor.values(free_builder.bake(bounces=0))
    # The transmittance is applied without random decisions, so every texel and colour is exact.
    np.testing.assert_allclose(found, free * share, rtol=1e-5)
    assert (found / truth).mean(axis=(0, 1)) == pytest.approx(share, rel=1e-3)


@pytest.mark.parametrize("light", ["lamp", "sun"])
def test_every_kind_of_light_is_coloured(light):
    def mean(*panes):
        kind = "directional" if light == "sun" else ""
        builder, floor = floor_under(*panes, light=kind, direction=(0, -1, 0))
        if light == "lamp":
            builder.quad((-1, 1, -1), (2, 0, 0), (0, 0, 2), builder.material(0.0, 5.0), (8, 8))
        return floor.values(builder.bake(bounces=0)).mean(axis=(0, 1))

    assert mean(pane()) / mean() == pytest.approx(passed(COLOUR, HALF), rel=0.01)


@pytest.mark.parametrize("alpha", [0.6, 0.9])
def test_a_light_behind_a_dense_pane_is_no_noisier_than_without(alpha):
    """E is T times Lambert's formula. Without a pane, the 64 samples of a texel have a noise of 2 %."""
    square = np.array([(-0.5, 1, -0.5), (0.5, 1, -0.5), (0.5, 1, 0.5), (-0.5, 1, 0.5)])
    builder, floor = floor_under(pane(alpha=alpha), light="", texels=24)
    builder.quad(square[0], square[1] - square[0], square[3] - square[0], builder.material(0.0, 5.0), (8, 8))
    found = floor.values(builder.bake(bounces=0, samples=64))
    truth = 5.0 * floor.texel_mean(lambda p: polygon_irradiance(square, p, (0, 1, 0)))
    ratio = found / (truth[..., None] * passed(COLOUR, alpha))
    assert ratio.mean(axis=(0, 1)) == pytest.approx(1, abs=0.002)
    assert ratio.std(axis=(0, 1)).max() < 0.03


def test_sky_through_black_glass_all_around_has_no_noise():
    """In a closed box of black glass, each ray of the floor crosses one pane."""
    alpha = 0.9
    builder = SceneBuilder(96)
    floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.0), (16, 16))
    builder.box((-2, -1, -2), (2, 1, 2), glass(builder, (0, 0, 0), alpha), 8)
    found = floor.values(builder.bake(sky=(1.0, 2.0, 3.0), samples=16))
    truth = np.pi * np.array([1.0, 2.0, 3.0]) * (1 - alpha) ** 2
    np.testing.assert_allclose(found, np.broadcast_to(truth, found.shape), rtol=1e-4)


def test_a_pane_elsewhere_leaves_an_unoccluded_light_its_closed_form():
    """A pane above an emitter does not change the light below it, which is computed in closed form."""

    def baked(*panes):
        builder, floor = floor_under(light="", texels=24)
        builder.quad((-0.5, 1, -0.5), (1, 0, 0), (0, 0, 1), builder.material(0.0, 5.0), (8, 8))
        for make in panes:
            builder.quad((-1, 1.5, -1), (2, 0, 0), (0, 0, 2), make(builder), (8, 8))
        return floor.values(builder.bake(bounces=0, samples=64))

    np.testing.assert_allclose(baked(pane()), baked(), rtol=1e-6)


def test_a_pane_that_stands_in_the_floor_has_a_bright_and_a_dim_side():
    """A texel that the pane crosses stores the light of one side of the pane."""
    builder = SceneBuilder(64)
    floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.0), (24, 24))
    builder.quad((0.013, -0.2, -1.2), (0, 1.6, 0), (0, 0, 2.4), glass(builder, alpha=0.9), (4, 4))
    builder.light("directional", 1.0, direction=(-(0.5**0.5), -(0.5**0.5), 0.0))
    found = floor.values(builder.bake(bounces=0, samples=16)) / 0.5**0.5
    # Rows run along x, and the pane crosses row 12.
    np.testing.assert_allclose(found[13:], 1, rtol=1e-5)
    np.testing.assert_allclose(found[:12], np.broadcast_to(passed(COLOUR, 0.9), (12, 24, 3)), rtol=1e-5)
    assert np.ptp(found[12], axis=0).max() < 1e-5
    assert min(abs(found[12, 0] - 1).max(), abs(found[12, 0] - passed(COLOUR, 0.9)).max()) < 1e-5


def test_a_light_behind_a_pane_of_hardly_any_alpha_is_not_taken_for_an_unoccluded_one():
    """The pane usually blocks none of the 256 rays that test for occluders, but transmits less than 1."""
    builder, floor = floor_under(pane((1.0, 0.0, 0.0), 1 / 1024), light="")
    builder.quad((-1, 1, -1), (2, 0, 0), (0, 0, 2), builder.material(0.0, 5.0), (8, 8))
    found = floor.values(builder.bake(bounces=0, samples=64))
    np.testing.assert_allclose(found[..., 1] / found[..., 0], 1 - 1 / 1024, rtol=1e-5)


def test_fully_transparent_surfaces_do_not_colour_light():
    def baked(make):
        builder, _ = floor_under(make, light="point", position=LIGHT_AT)
        return builder.bake(samples=16, sky=(1.0, 1.0, 1.0)).lightmaps["irradiance"].value.tobytes()

    black, white = np.zeros((4, 4, 4)), np.ones((4, 4, 4))
    white[..., 3] = 0
    assert baked(pane((1, 1, 1), 1.0, rgba=black)) == baked(pane((1, 1, 1), 1.0, rgba=white))


def test_transparent_black_beside_stained_glass():
    """One half of a texture is red with alpha 0.5, the other is transparent black. Only red colours light."""
    rgba = np.zeros((64, 64, 4))
    rgba[:, 32:] = 1.0, 0.0, 0.0, 0.5
    builder, floor = floor_under(pane((1, 1, 1), 1.0, rgba=rgba), direction=(0, -1, 0))
    found = floor.values(builder.bake(bounces=0))
    # Columns of floor and texture run along z; at the border, bilinear lookups blend the two halves.
    assert (found[:, :19] == 1).all()
    assert found[:, 21:].mean(axis=(0, 1)) == pytest.approx(passed((1, 0, 0), 0.5), rel=0.01)


def room_with_a_pane(colour=COLOUR, albedo=0.7):
    """Return a closed room with 8 x 8 texels on each wall. A pane divides the room at a texel border."""
    builder = SceneBuilder(64)
    builder.box((-1, -1, -1), (1, 1, 1), builder.material(albedo), 8, inward=True)
    builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), glass(builder, colour), (8, 8))
    return builder


def test_exchange_through_a_pane_is_reciprocal_in_each_colour():
    builder = room_with_a_pane()
    world, patches, matrix = form_factors(builder)
    row = np.repeat(np.arange(patches.n), np.diff(matrix.first))
    flux = np.zeros((3, patches.n, patches.n))
    for c in range(3):
        flux[c, row, matrix.column] = patches.area[row] * matrix.value * matrix.transmittance[:, c]
    np.testing.assert_allclose(flux, flux.transpose(0, 2, 1), rtol=1e-5)
    # Texels are above or below the pane; light from one half to the other crosses it once.
    high = world.texels.position[:, 1][patches.member[patches.first[:-1]]]
    wall = abs(high) > 0.01
    across = wall[row] & wall[matrix.column] & (high[row] * high[matrix.column] < 0)
    assert across.sum() > 1000
    np.testing.assert_allclose(
        matrix.transmittance[across], np.tile(1 - HALF * (1 - COLOUR), (across.sum(), 1)), rtol=1e-5
    )
    assert (matrix.transmittance[~across] == 1).all()


def test_no_light_is_lost_but_in_walls_and_panes():
    builder = room_with_a_pane()
    builder.light("point", 10.0, position=(0.0, 0.5, 0.0))
    energy = builder.bake(samples=64).solve["energy"]
    assert energy["absorbed"] == pytest.approx(energy["emitted"], rel=1e-3)
    assert energy["escaped"] == 0


def test_same_bytes_on_any_number_of_threads():
    builder = room_with_a_pane()
    builder.light("point", 1.0, position=(0.2, 0.5, 0.1))
    builder.quad((-0.2, 0.9, -0.2), (0.4, 0, 0), (0, 0, 0.4), builder.material(0.0, 5.0), (4, 4))
    maps = [builder.bake(threads=n, samples=16, sky=(1.0, 1.0, 1.0)).lightmaps for n in (1, 2)]
    assert maps[0]["irradiance"].value.tobytes() == maps[1]["irradiance"].value.tobytes()
