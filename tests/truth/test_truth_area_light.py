"""The irradiance of far, near, many and textured emitters equals Lambert's polygon formula."""

from __future__ import annotations

import numpy as np
import pytest
from closed_forms import polygon_irradiance
from scenes import SceneBuilder
from ztest import assert_unbiased

SEEDS = 6
UP = (0.0, 1.0, 0.0)


def square_over(height, half=0.5):
    """Return the corners of a square at `height` whose front faces down."""
    return np.array(
        [(-half, height, -half), (half, height, -half), (half, height, half), (-half, height, half)]
    )


def test_the_polygon_formula_agrees_with_form_factors():
    """The mean of the formula over a facing unit square is pi times the form factor 0.1998249."""
    axis = (np.arange(40) + 0.5) / 40 - 0.5
    x, z = np.meshgrid(axis, axis)
    point = np.stack([x, 0 * x, z], axis=-1)
    mean = polygon_irradiance(square_over(1.0), point, UP).mean()
    assert mean / np.pi == pytest.approx(0.1998249, rel=1e-4)


@pytest.mark.parametrize("denoise", [False, True])
def test_parallel_square_at_every_texel(denoise):
    found = []
    for seed in range(SEEDS):
        builder = SceneBuilder(64)
        floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.0), (20, 20))
        builder.quad((-0.5, 1, -0.5), (1, 0, 0), (0, 0, 1), builder.material(0.0, (2.0, 4.0, 0.0)), (12, 12))
        found.append(floor.values(builder.bake(seed=seed, denoise=denoise)))
    truth = floor.texel_mean(lambda p: polygon_irradiance(square_over(1.0), p, UP))[..., None] * [
        2.0,
        4.0,
        0.0,
    ]
    mean = np.mean(found, axis=0)
    # The denoiser adds a little of the other colours to a colour without light.
    assert mean[..., 2].max() <= (0.01 * mean.max() if denoise else 0)
    # Six bakes have 6 x 64 = 384 stratified light samples per texel, whose mean has a noise below 2 %.
    lit = truth[..., :2]
    assert np.abs(mean[..., :2] / lit - 1).max() < (0.04 if denoise else 0.03)
    if not denoise:
        assert_unbiased([f[..., 0].mean(axis=1) for f in found], truth[..., 0].mean(axis=1), least=0.005)


@pytest.mark.parametrize("height", [0.01, 0.03, 0.1, 0.3, 1.0, 2.0])
def test_near_emitters_have_neither_bias_nor_bright_outliers(height):
    """From 1 cm to 2 m below an emitter, E equals the polygon formula, and no texel exceeds 1.25 pi L."""
    found, worst = [], 0.0
    for seed in range(SEEDS):
        builder = SceneBuilder(64)
        floor = builder.quad((-0.6, 0, -0.6), (0, 0, 1.2), (1.2, 0, 0), builder.material(0.0), (24, 24))
        builder.quad((-0.5, height, -0.5), (1, 0, 0), (0, 0, 1), builder.material(0.0, 1.0), (12, 12))
        value = floor.values(builder.bake(seed=seed, samples=64))[..., 0]
        worst = max(worst, value.max())
        found.append(value)
    # At the rim of an emitter 1 cm away, E changes within a texel of 5 cm, so average over 24 x 24 points.
    truth = floor.texel_mean(lambda p: polygon_irradiance(square_over(height), p, UP), 24)
    assert worst < 1.25 * np.pi
    middle = slice(8, 16)
    assert_unbiased([v[middle, middle].mean() for v in found], truth[middle, middle].mean(), least=0.004)
    # `slack`: the quadrature at the rim has an error of 0.2 % for a distance of 1 cm.
    assert_unbiased([v.mean() for v in found], truth.mean(), least=0.004, slack=0.002)
    assert np.abs(np.mean(found, axis=0) - truth).max() < 0.08 * truth.max()


def test_penumbra_equals_the_polygon_formula():
    """Depending on a texel's x, a screen hides the whole emitter, a rectangle of the emitter, or nothing."""
    found = []
    for seed in range(SEEDS):
        builder = SceneBuilder(64)
        floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.0), (24, 24))
        builder.quad((-0.5, 1, -0.5), (1, 0, 0), (0, 0, 1), builder.material(0.0, 1.0), (12, 12))
        builder.quad((-9, 0.5, -9), (9, 0, 0), (0, 0, 18), builder.material(0.0), (4, 4))
        found.append(floor.values(builder.bake(seed=seed, denoise=False))[..., 0])

    def visible(p):
        # The edge of the screen is at x = 0, half way between floor and emitter. From a floor point p, the
        # screen hides emitter points with x < -p_x.
        edge = np.clip(-p[..., 0], -0.5, 0.5)
        corners = np.broadcast_to(square_over(1.0), (*p.shape[:-1], 4, 3)).copy()
        corners[..., [0, 3], 0] = edge[..., None]
        return polygon_irradiance(corners, p, UP)

    # Average over columns, since rows run along x.
    profile, expected = [f.mean(axis=1) for f in found], floor.texel_mean(visible, 8).mean(axis=1)
    assert expected.min() == 0 < expected.max()
    assert_unbiased(profile, expected, least=0.004)


def test_wall_that_touches_an_emitter():
    """Perpendicular squares with a common edge: E rises to pi L / 2 at the edge, without bright outliers."""
    found = []
    for seed in range(SEEDS):
        builder = SceneBuilder(64)
        wall = builder.quad((0, 0, 0), (0, 0, 1), (1, 0, 0), builder.material(0.0), (16, 16))
        builder.quad((0, 0, 0), (0, 1, 0), (0, 0, 1), builder.material(0.0, 1.0), (12, 12))
        found.append(wall.values(builder.bake(seed=seed))[..., 0])
    square = np.array([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)], float)
    truth = wall.texel_mean(lambda p: polygon_irradiance(square, p, UP), 16)
    assert truth.mean() / np.pi == pytest.approx(0.2000438, rel=1e-3)
    # `slack` is a margin: measured deviations are at most 0.016 %, and at most 3.3 standard errors.
    assert_unbiased([f.mean(axis=1) for f in found], truth.mean(axis=1), least=0.02, slack=0.001)
    assert np.max(found) < 1.1 * np.pi / 2


def test_textured_emission_conserves_its_flux():
    rng = np.random.default_rng(1)
    image = np.zeros((8, 8, 3))
    image[rng.random((8, 8)) < 0.3] = (5.0, 1.0, 0.2)
    absorbed = []
    for seed in range(SEEDS):
        builder = SceneBuilder(128)
        walls = list(builder.box((0, 0, 0), (2, 2, 2), builder.material(0.0), 20, inward=True).values())
        emissive = builder.material(0.0, (2.0, 2.0, 2.0), texture=image)
        builder.quad((0.5, 1.9, 0.5), (1, 0, 0), (0, 0, 1), emissive, (12, 12))
        result = builder.bake(seed=seed)
        absorbed.append(sum(w.values(result).mean(axis=(0, 1)) * w.area for w in walls))
    # The mean of clamped bilinear lookups is the mean of the image.
    truth = np.pi * 2.0 * image.mean(axis=(0, 1))
    assert_unbiased(absorbed, truth, least=0.01)


def test_texture_lies_the_right_way_round():
    """If one corner of the image is bright, the wall is brightest opposite that corner of the emitter."""
    image = np.zeros((8, 8, 3))
    image[0:2, 6:8] = 10.0
    builder = SceneBuilder(64)
    floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.0), (16, 16))
    emitter = builder.quad(
        (-1, 0.3, -1), (2, 0, 0), (0, 0, 2), builder.material(0.0, 1.0, texture=image), (12, 12)
    )
    value = floor.values(builder.bake())[..., 0]
    # Image row 0 is v = 0 and columns run along u, so the bright spot is at u = 7 / 8, v = 1 / 8.
    bright = emitter.at(7 / 8, 1 / 8)
    row, column = np.unravel_index(value.argmax(), value.shape)
    assert np.abs((floor.points(1)[row, column, 0] - bright)[[0, 2]]).max() < 0.15


def test_a_thousand_emitters_against_the_sum_of_their_closed_forms():
    rng = np.random.default_rng(3)
    n = 1000
    # Small coplanar triangles of very different power, facing down; none occludes another.
    cell = np.stack(np.divmod(np.arange(n), 32), axis=1) / 16.0 - 1.0
    centre = np.stack([cell[:, 0], np.full(n, 0.8), cell[:, 1]], axis=1) + 0.03
    turn = rng.random(n) * 2 * np.pi
    radius = 0.005 + 0.02 * rng.random(n) ** 3
    angle = turn[:, None] + np.array([0, 2, 4]) * np.pi / 3
    arm = np.stack([np.cos(angle), 0 * angle, np.sin(angle)], axis=2)
    corner = centre[:, None] + radius[:, None, None] * arm
    level = np.array([1.0, 30.0, 1000.0])
    kind = rng.integers(0, 3, n)
    found = []
    for seed in range(SEEDS):
        builder = SceneBuilder(256)
        floor = builder.quad((-1, 0, -1), (0, 0, 2), (2, 0, 0), builder.material(0.0), (12, 12))
        for k, radiance in enumerate(level):
            builder.triangles(corner[kind == k], builder.material(0.0, radiance), 2)
        found.append(floor.values(builder.bake(seed=seed, samples=64))[..., 0])
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert (normal[:, 1] < 0).all()

    def irradiance(p):
        return sum(level[kind[t]] * polygon_irradiance(corner[t], p, UP) for t in range(n))

    truth = floor.texel_mean(irradiance, 2)
    assert_unbiased([f.mean() for f in found], truth.mean(), least=0.01)
    # The 64 light rays of a texel choose among 1000 triangles. The mean over six bakes has a noise of 5 %,
    # and the bound is four times this noise.
    assert np.abs(np.mean(found, axis=0) / truth - 1).max() < 0.2
