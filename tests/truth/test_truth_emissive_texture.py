"""The light of emissive textures with few lit texels, in bake and path tracer, equals closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from reference_runs import copies_of, traced
from scenes import SceneBuilder
from tiny_scenes import Quad, box_quads, grey, quad_scene
from ztest import critical

from baker.core.scene import Material, Texture
from baker.pathtracer.estimators import ESTIMATORS

N = 64
RED, GREEN, BLUE = np.eye(3)
# (x, z) centres and side of three emissive panels at a height of 1 m, metres.
PANELS, SIDE = ((-0.7, 0.1), (0.0, -0.2), (0.7, 0.3)), 0.6
# Radiance of the lit texels of each panel, cd/m2. The values give all panels the same power.
BRIGHT = (143 * 3e4, 143 * 3e4, 3e4)


def lit(*texels):
    image = np.zeros((N, N, 3))
    for row, column in texels:
        image[row, column] = 1.0
    return image


def panels(size=48):
    """Return a builder with three panels over a black floor, and the floor.

    The texture of the red panel has one lit texel. The green panel has 5 x 5 mirrored repeats of a texture
    with one lit texel. The texture of the blue panel has a grid of lit texels.
    """
    builder = SceneBuilder(size)
    floor = builder.quad((-1.5, 0, -1.5), (0, 0, 3), (3, 0, 0), builder.material(0.0), (16, 16))
    leds = lit(*((r, c) for r in range(3, 64, 6) for c in range(2, 64, 5)))
    # With `nearest`, a lit texel is a square. The bilinear lookups of the other two panels spread its light
    # over 2 x 2 texels.
    looks = (
        (RED, lit((50, 5)), 1.0, {}),
        (GREEN, lit((20, 40)), 5.0, {"wrap": ("mirror", "mirror")}),
        (BLUE, leds, 1.0, {"nearest": True}),
    )
    for (x, z), bright, (colour, image, repeats, how) in zip(PANELS, BRIGHT, looks, strict=True):
        material = builder.material(0.0, bright * colour, texture=image)
        texture = replace(builder.materials[material].emission_texture, **how)
        builder.materials[material] = replace(builder.materials[material], emission_texture=texture)
        corner = (x - SIDE / 2, 1.0, z - SIDE / 2)
        builder.quad(corner, (SIDE, 0, 0), (0, 0, SIDE), material, (4, 4))
        uv = builder.meshes[-1].texcoord
        builder.meshes[-1] = replace(builder.meshes[-1], texcoord=(uv[0] * np.float32(repeats), uv[1]))
    return builder, floor


def spots():
    """Return for each panel the uv (n, 2) of its lit spots, and the area of a spot, (SIDE / N)^2."""
    one = np.array([[5.5, 50.5]]) / N
    way = np.arange(5)
    fold = [np.where(way % 2 == 0, way + s, way + 1 - s) / 5 for s in (40.5 / N, 20.5 / N)]
    many = np.stack(np.meshgrid(*fold), axis=-1).reshape(-1, 2)
    axes = [(np.arange(a, 64, b) + 0.5) / N for a, b in ((2, 5), (3, 6))]
    leds = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    return (one, 1.0), (many, 1.0 / 25.0), (leds, 1.0)


def irradiance(points, panel):
    """Return E of one panel at floor points (..., 3), treating spots as points, since they are small."""
    place, share = spots()[panel]
    middle = np.array(PANELS[panel]) + (place - 0.5) * SIDE
    away = points[..., None, [0, 2]] - middle
    square = (away**2).sum(axis=-1) + 1.0
    return BRIGHT[panel] * (SIDE / N) ** 2 * share * (square**-2).sum(axis=-1)


def test_lit_texels_give_the_right_light_everywhere():
    builder, floor = panels()
    value = floor.values(builder.bake(samples=256, bounces=0))
    for panel in range(3):
        truth = floor.texel_mean(lambda p, k=panel: irradiance(p, k))
        away = value[..., panel] / truth - 1
        # Noise: the 256 samples of a texel are divided among three panels and their 1, 25 and 143 spots.
        assert abs(away.mean()) < 0.003
        assert away.std() < 0.02
        assert np.abs(away).max() < 0.08


def test_the_reference_finds_a_lit_texel():
    builder, _ = panels()
    points = np.array([[0.3, 0, 0.4], [-0.7, 0, 0.1], [1.4, 0, -1.4]])
    for name in ("light", "mis", "bdpt"):
        found = traced(builder.build(), copies_of(points, (0, 1, 0), 32), estimator=name, passes=2)
        mean = found.mean.reshape(3, 32, 3)
        for panel in range(3):
            truth = irradiance(points, panel)
            error = mean[..., panel].std(axis=1) / math.sqrt(32)
            assert (np.abs(mean[..., panel].mean(axis=1) - truth) < critical(27) * error + 1e-3 * truth).all()
            # If chance hits of a spot had the weight 1, an estimate would be about a hundred times the truth.
            assert mean[..., panel].max() < 2.0 * truth.max()


def test_estimators_agree_on_a_screen():
    """In this room, a screen has an emissive texture of 3 x 4 texels, so that random rays hit lit texels."""
    image = np.zeros((3, 4, 4), np.float32)
    image[1, 2], image[0, 1], image[2, 0] = (9, 2, 4, 1), (3, 8, 3, 1), (5, 5, 5, 0)
    base = np.ones((3, 4, 4), np.float32)
    base[..., 3] = image[..., 3] + (np.indices((3, 4)).sum(axis=0) % 2)
    texture = Texture(image, wrap=("mirror", "repeat"), nearest=True)
    screen = Material(
        base_colour=(0.2, 0.2, 0.2, 1), base_colour_texture=Texture(base, wrap=("mirror", "repeat")),
        emission=(1, 1, 2), emission_texture=texture, alpha_mode="MASK", double_sided=True,
    )  # fmt: skip
    walls = box_quads((0, 0, 0), (2, 2, 2), inward=True, material=grey(0.5))
    scene = quad_scene([*walls, Quad((0.5, 1.2, 1.3), (1.0, 0, 0.2), (0, -0.8, 0.1), screen)])
    where = copies_of(np.random.default_rng(2).uniform((0.3, 0.3, 0), (1.7, 1.7, 0), (16, 3)), copies=1)
    found = {name: traced(scene, where, estimator=name, passes=16) for name in ESTIMATORS}
    mean = {name: e.mean.sum(axis=0) for name, e in found.items()}
    error = {name: np.sqrt((e.standard_error**2).sum(axis=0)) for name, e in found.items()}
    pairs = [(a, b) for i, a in enumerate(mean) for b in list(mean)[:i]]
    bound = critical(3 * len(pairs), 15 * 16)
    for a, b in pairs:
        assert (np.abs(mean[a] - mean[b]) < bound * np.hypot(error[a], error[b])).all(), f"{a} and {b}"
    for name, how in ESTIMATORS.items():
        assert (error[name] < (0.02 if how.aim else 0.12) * mean[name]).all(), name


@pytest.mark.parametrize("nearest", [False, True])
def test_a_panel_close_to_a_wall_has_no_sparks(nearest):
    """For gather rays that hit a lit texel, the MIS density is correct, so there are no bright outliers."""
    builder = SceneBuilder(32)
    floor = builder.quad((-0.3, 0, -0.3), (0, 0, 0.6), (0.6, 0, 0), builder.material(0.0), (12, 12))
    image = np.zeros((16, 16, 3))
    image[4:12:3, 4:12:3] = 1.0
    material = builder.material(0.0, 100.0, texture=image)
    texture = replace(builder.materials[material].emission_texture, nearest=nearest)
    builder.materials[material] = replace(builder.materials[material], emission_texture=texture)
    builder.quad((-0.3, 0.1, -0.3), (0.6, 0, 0), (0, 0, 0.6), material, (4, 4))
    value = floor.values(builder.bake(samples=256, bounces=0))[..., 0]
    # The truth is the light of nine square emitters with sides of 3.75 cm. Bilinear lookups turn the
    # squares into tents with the same integral.
    axis = (np.arange(4, 12, 3) + 0.5) / 16 * 0.6 - 0.3
    step = (np.arange(8) + 0.5) / 8 * 0.0375 - 0.01875
    place = (axis[:, None] + step).reshape(-1)
    x, z = (a.reshape(-1) for a in np.meshgrid(place, place))

    def light(p):
        square = (p[..., 0, None] - x) ** 2 + (p[..., 2, None] - z) ** 2 + 0.01
        return (100.0 * (0.0375 / 8) ** 2 * 0.01 / square**2).sum(axis=-1)

    truth = floor.texel_mean(light)
    assert value.mean() == pytest.approx(truth.mean(), rel=0.01)
    # With `nearest`, the parts of the emitter have constant radiance, and their light is computed in closed
    # form. With bilinear lookups, it is sampled.
    assert np.abs(value / truth - 1).max() < (0.02 if nearest else 0.15)
