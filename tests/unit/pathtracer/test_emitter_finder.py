"""The path tracer's emitter table agrees with closed forms and with the emitter table of the bake."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import Quad, grey, quad_scene, quad_world

from baker.core.scene import Material, Texture
from baker.kernels import emitters as bake_columns
from baker.lights.emissive import build_emitters
from baker.lights.emissive_texture import cut
from baker.pathtracer.emitters import (
    EMITTER_AREA,
    EMITTER_CORNER,
    EMITTER_NORMAL,
    EMITTER_PART,
    EMITTER_RADIANCE,
    EMITTER_TEXTURED,
    EMITTER_TWO_SIDED,
    find_emitters,
)
from baker.pathtracer.irradiance import irradiance_pass
from baker.pathtracer.point_estimate import new_estimate
from baker.pathtracer.scene import build_reference


def picture():
    """Return a (16, 16, 4) image of bright and black texels on a dark background."""
    rng = np.random.default_rng(3)
    image = np.full((16, 16, 4), 0.002, np.float32)
    image[4:6, 5:9, :3] = rng.random((2, 4, 3))
    image[11, 2, :3], image[8:, 8:, :3] = 1.0, 0.0
    return image


def screen():
    texture = Texture(picture(), nearest=True)
    return Material(base_colour=(0, 0, 0, 1), emission=(3.0, 1.0, 0.25), emission_texture=texture)


def quads():
    lit = Quad((0, 2, 0), (2, 0, 0), (0, 0, 1), grey(0.2, 4.0))
    both = Quad((3, 2, 0), (0.5, 0, 0), (0, 0.3, 1), grey(0.2, 0.5, double_sided=True))
    textured = Quad((-3, 2, 0), (2, 0, 0), (0, 0, 1), screen())
    dark = Quad((-1, -3, 0), (1, 0, 0), (0, 0, -1), grey(0.5))
    return [lit, both, textured, dark]


def found(*chosen):
    world = quad_world([quads()[k] for k in chosen])
    return world, find_emitters(world.geometry, world.shading)


def test_emitters_have_the_area_radiance_sides_and_power_of_their_triangles():
    _, emitters = found(0, 1, 3)
    assert sorted(emitters.triangle) == [0, 1, 2, 3]
    assert (emitters.code == [*np.argsort(emitters.triangle), -1, -1]).all()
    first = emitters.triangle < 2
    row = emitters.row
    np.testing.assert_allclose(row[:, EMITTER_AREA], np.where(first, 1.0, 0.25 * np.hypot(1, 0.3)), rtol=1e-6)
    np.testing.assert_allclose(row[:, EMITTER_RADIANCE], np.where(first, 4.0, 0.5))
    assert (row[:, EMITTER_TWO_SIDED] == ~first).all()
    assert not row[:, EMITTER_TEXTURED].any()
    np.testing.assert_allclose(row[first, EMITTER_NORMAL : EMITTER_NORMAL + 3], [[0, -1, 0]] * 2, atol=1e-6)
    power = np.pi * row[:, EMITTER_AREA] * np.where(first, 4.0, 2 * 0.5)
    np.testing.assert_allclose(emitters.power, power, rtol=1e-6)


def test_parts_of_a_textured_triangle_have_its_power():
    _, emitters = found(2, 3)
    image = picture()[..., :3].astype(float)
    truth = np.pi * 2.0 * (image.reshape(-1, 3).mean(axis=0) * [3.0, 1.0, 0.25]).mean()
    assert len(emitters.row) > 10
    assert emitters.power.sum() == pytest.approx(truth, rel=1e-5)
    size = emitters.row[:, EMITTER_PART + 2]
    np.testing.assert_allclose(emitters.row[:, EMITTER_AREA], size**2, rtol=1e-5)
    assert (emitters.row[:, EMITTER_TEXTURED] == 1).all()
    # The emitter table has no part for black texels, so the area of all parts is less than the quad's 2 m2.
    assert emitters.row[:, EMITTER_AREA].sum() < 2.0


@pytest.mark.parametrize("chosen", [(0, 1, 3), (0, 1, 2, 3), (3,)])
def test_both_finders_find_the_same(chosen):
    """Path tracer and bake have separate implementations, but both divide textured triangles by `cut`."""
    world, emitters = found(*chosen)
    other = build_emitters(world.geometry, world.shading, 131072)
    assert len(emitters.row) == len(other.row)
    np.testing.assert_array_equal(emitters.triangle, other.triangle)
    np.testing.assert_array_equal(emitters.code, other.root)
    np.testing.assert_array_equal(emitters.node, other.node)
    corner = slice(bake_columns.CORNER, bake_columns.CORNER + 9)
    np.testing.assert_array_equal(emitters.row[:, EMITTER_CORNER : EMITTER_CORNER + 9], other.row[:, corner])
    cluster = other.row[:, bake_columns.CLUSTER].astype(int)
    power = other.row[:, bake_columns.SHARE] * other.power[cluster]
    np.testing.assert_allclose(emitters.power, power, rtol=1e-6)


def test_parts_only_say_where_samples_go(monkeypatch):
    """If half of the parts are never sampled, irradiance is the same, because hemisphere rays hit them."""

    def forgetful(*arguments):
        parts = cut(*arguments)
        lost = np.arange(len(parts.owner)) % 2 == 0
        power = parts.inside[:, 2] ** 2 * parts.mean.mean(axis=1)
        assert power[lost].sum() > 0.3 * power.sum()
        mean = np.where(lost[:, None], 0.0, parts.mean)
        return type(parts)(parts.owner, parts.inside, mean, parts.spread, parts.node, parts.root)

    floor = Quad((-3, 0, 1), (2, 0, 0), (0, 0, -1), grey(0.5))
    scene = quad_scene([quads()[2], floor])
    position = np.array([[[-2.0, 0.0, 0.5]], [[-1.2, 0.0, 0.3]]])
    up = np.broadcast_to([0.0, 1.0, 0.0], position.shape).copy()
    mean, error, count = [], [], []
    for find in (cut, forgetful):
        monkeypatch.setattr("baker.pathtracer.emitters.cut", find)
        with build_reference(scene, lambertian=True, threads=1) as reference:
            count.append(len(reference.lights.emitter))
            estimate = new_estimate(2, 3, samples=1024)
            for _ in range(200):
                irradiance_pass(reference, estimate, position, up, up)
        mean.append(estimate.mean)
        error.append(estimate.standard_error)
    assert count[1] < 0.6 * count[0]
    assert (error[1] > error[0]).all()
    # Six numbers are compared. One of 2600 such tests exceeds 4 standard errors by chance.
    assert (abs(mean[1] - mean[0]) < 4 * np.hypot(*error)).all()
    assert (np.hypot(*error) < 0.05 * mean[0]).all()
