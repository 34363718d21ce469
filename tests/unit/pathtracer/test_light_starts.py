"""Starts of light subpaths and chosen lights match their densities, and mean flux matches total power."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import solid_angle
from inner import compiled
from numba import njit
from scipy import stats
from tiny_scenes import Quad, grey, quad_scene

from baker.core.scene import PunctualLight
from baker.pathtracer.bidirectional_lights import start_at_light
from baker.pathtracer.bidirectional_weights import N_ROWS_BOTH
from baker.pathtracer.emitters import EMITTER_AREA, EMITTER_CHANCE, EMITTER_CORNER, EMITTER_NORMAL
from baker.pathtracer.light_table import aim_at_emitter, pick_light
from baker.pathtracer.scene import build_reference
from baker.pathtracer.vertex import BETA, GO, NORMAL, POSITION

aim_at_emitter, pick_light, start_at_light = compiled(aim_at_emitter, pick_light, start_at_light)
LEVEL = 1e-4
N = 100_000
SPOT = PunctualLight("spot", "s", 0, (2.0, 2.0, 2.0), (0.1, 0.2, 0.3), (0.6, 0.0, -0.8), 0.3, 0.7)
POINT = PunctualLight("point", "p", 0, (3.0, 3.0, 3.0), (0.1, 0.2, 0.3))
SUN = PunctualLight("directional", "d", 0, (5.0, 5.0, 5.0), direction=(0.6, 0.0, -0.8))


@njit
def start_many(lights, sphere, random, n_rows):
    path = np.zeros((n_rows, 16))
    spot = np.zeros(2)
    light = np.zeros(len(random), np.int64)
    out = np.zeros((len(random), n_rows + 2))
    for i in range(len(random)):
        r = random[i]
        light[i] = start_at_light(path, 0, lights, sphere, 1.0, r[0], r[1], r[2], r[3], r[4], spot)
        out[i, :n_rows] = path[:, 0]
        out[i, n_rows:] = spot
    return light, out


def starts(scene, sky=(0.0, 0.0, 0.0), seed=1):
    with build_reference(scene, sky=sky, threads=1) as reference:
        lights = reference.lights
        random = np.random.default_rng(seed).random((N, 5))
        light, out = start_many(lights, reference.sphere, random, N_ROWS_BOTH)
        return lights, reference.sphere, light, out


def scene_with(*lights, emitter=None):
    quads = [Quad((-1, -1, 0), (2, 0, 0), (0, 2, 0), grey(0.5))]
    if emitter is not None:
        quads.append(Quad((0, 0, 1), (0, 0.5, 0), (0.8, 0, 0.2), emitter))
    return replace(quad_scene(quads), lights=lights)


def uniform(value, cells=32):
    """Assert that numbers are uniform in [0, 1]."""
    count = np.bincount(np.minimum((value * cells).astype(int), cells - 1), minlength=cells)
    assert value.min() >= -1e-9
    assert value.max() <= 1 + 1e-6
    assert stats.chisquare(count).pvalue > LEVEL


def test_lights_are_chosen_by_their_chance():
    lights, _, light, out = starts(scene_with(SPOT, POINT, SUN, emitter=grey(0.0, 4.0)), sky=(0.2, 0.2, 0.2))
    chance = np.diff(lights.cumulative, prepend=0.0)
    assert chance.min() > 0
    assert stats.chisquare(np.bincount(light, minlength=len(chance)), chance * N).pvalue > LEVEL
    # The mean flux of a light subpath is the total power of all lights.
    area = 0.5 * math.hypot(0.8, 0.2)
    flux = out[:, BETA]
    error = flux.std() / math.sqrt(N)
    with build_reference(scene_with(SPOT, emitter=grey(0.0, 4.0)), threads=1) as reference:
        assert reference.lights.emitter[:, EMITTER_AREA].sum() == pytest.approx(area, rel=1e-6)
    radius = starts(scene_with(SPOT, emitter=grey(0.0, 4.0)))[1][3]
    cosine = np.linspace(math.cos(0.7), 1, 20001)
    share = np.clip((cosine - math.cos(0.7)) / (math.cos(0.3) - math.cos(0.7)), 0, 1) ** 2
    disc = math.pi * radius**2
    power = (
        4 * math.pi * area
        + 2 * 2 * math.pi * np.trapezoid(share, cosine)
        + 3 * 4 * math.pi
        + 5 * disc
        + 0.2 * 4 * math.pi * disc
    )
    assert abs(flux.mean() - power) < 4 * error
    assert error < 0.01 * power


@pytest.mark.parametrize("two_sided", [False, True])
def test_light_leaves_triangles_evenly_and_by_the_cosine(two_sided):
    lights, _, light, out = starts(scene_with(emitter=grey(0.0, 1.0, double_sided=two_sided)))
    normal = lights.emitter[light][:, EMITTER_NORMAL : EMITTER_NORMAL + 3]
    cosine = (out[:, GO : GO + 3] * normal).sum(axis=1)
    sign = np.sign((out[:, NORMAL : NORMAL + 3] * normal).sum(axis=1))
    assert ((cosine < 0) == (sign < 0)).all()
    if two_sided:
        assert stats.binomtest(int((sign > 0).sum()), N).pvalue > LEVEL
    else:
        assert (sign > 0).all()
    uniform(cosine**2)
    # For uniform points in a triangle and a barycentric b, (1 - b)^2 is uniform.
    uniform((1 - out[:, -1]) ** 2)
    uniform((1 - out[:, -2]) ** 2)
    np.testing.assert_allclose(np.linalg.norm(out[:, GO : GO + 3], axis=1), 1, rtol=1e-6)


def test_spots_fill_their_cone():
    _, _, _, out = starts(scene_with(SPOT))
    cosine = out[:, GO : GO + 3] @ np.array(SPOT.direction)
    uniform((cosine - math.cos(0.7)) / (1 - math.cos(0.7)))


def test_point_lights_emit_in_all_directions():
    _, _, _, out = starts(scene_with(POINT))
    way = out[:, GO : GO + 3]
    uniform(0.5 * (1 + way[:, 2]))
    uniform(np.arctan2(way[:, 1], way[:, 0]) / (2 * np.pi) + 0.5)


@pytest.mark.parametrize("sky", [False, True])
def test_parallel_light_covers_the_scene(sky):
    scene = scene_with() if sky else scene_with(SUN)
    _, sphere, _, out = starts(scene, sky=(1.0, 1.0, 1.0) if sky else (0, 0, 0))
    way, place = out[:, GO : GO + 3], out[:, POSITION : POSITION + 3] - sphere[:3]
    along = (place * way).sum(axis=1)
    np.testing.assert_allclose(along, -sphere[3], rtol=1e-5)
    uniform(((place - along[:, None] * way) ** 2).sum(axis=1) / sphere[3] ** 2)
    if sky:
        uniform(0.5 * (1 + way[:, 2]))


def test_aiming_at_a_triangle_has_the_density_it_tells():
    # The mean of 1 / density is the solid angle of the triangle.
    with build_reference(scene_with(emitter=grey(0.0, 1.0)), threads=1) as reference:
        lights = reference.lights
    eye = np.array([0.3, 0.1, 0.2])
    random = np.random.default_rng(2).random((20_000, 2))
    for e in range(2):
        found = np.array([aim_at_emitter(lights.emitter, e, u, w, *eye) for u, w in random])
        lit = found[:, 3] > 0
        angle = np.where(lit, 1 / np.where(lit, found[:, 3], 1.0), 0.0) * lights.emitter[e, EMITTER_CHANCE]
        corner = lights.emitter[e, EMITTER_CORNER : EMITTER_CORNER + 9].reshape(1, 3, 3)
        truth = solid_angle(corner, eye)[0]
        facing = lights.emitter[e, EMITTER_NORMAL : EMITTER_NORMAL + 3] @ (corner[0, 0] - eye) < 0
        assert angle.mean() == pytest.approx(truth if facing else 0.0, abs=5 * angle.std() / 141 + 1e-9)
    assert pick_light(lights.cumulative, 0.0) == 0
