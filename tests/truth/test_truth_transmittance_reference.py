"""Coloured panes in the path tracer: closed forms, agreement of estimators, agreement with a bake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from closed_forms import point_irradiance
from reference_runs import copies_of, traced
from scenes import SceneBuilder
from test_truth_transmittance import COLOUR, HALF, glass, passed
from tiny_scenes import Quad, box_quads, grey, quad_scene
from ztest import critical

from baker.core.scene import Camera, Material, PunctualLight
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.point_estimate import new_estimate
from baker.pathtracer.radiance import radiance_pass
from baker.pathtracer.scene import build_reference

STAINED = Material(base_colour=(*COLOUR.tolist(), HALF), alpha_mode="BLEND", double_sided=True)
VIEW = Camera("view", 0, (0.0, 0.0, 2.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0), 0.5)
# One estimator for each code path: scalar vertices, hits by chance, light sampling, MIS, bidirectional.
ESTIMATORS = ("uniform", "cosine", "light", "mis", "bdpt")


def room():
    """Return a closed room with an emitter and a point light above a pane, and a block below the pane."""
    walls = box_quads((0, 0, 0), (2, 2, 2), inward=True, material=grey(0.6))
    emitter = Quad((0.7, 1.3, 1.8), (0.6, 0, 0), (0, -0.6, 0), grey(0, 5.0))
    block = box_quads((0.3, 0.3, 0.01), (0.8, 0.8, 0.6), inward=False, material=grey(0.4))
    pane = Quad((0, 0, 1.0), (2, 0, 0), (0, 2, 0), STAINED)
    scene = quad_scene([*walls, emitter, *block, pane])
    return replace(scene, lights=(PunctualLight("point", "p", 0, (0.3, 0.3, 0.3), (1.6, 0.4, 1.5)),))


def test_estimators_agree_pairwise_below_a_pane():
    where = copies_of(np.random.default_rng(2).uniform((1.0, 1.0, 0), (1.9, 1.9, 0), (32, 3)), copies=1)
    found = {name: traced(room(), where, estimator=name, passes=24) for name in ESTIMATORS}
    mean = {name: e.mean.mean(axis=0) for name, e in found.items()}
    error = {name: np.sqrt((e.standard_error**2).sum(axis=0)) / 32 for name, e in found.items()}
    pairs = [(a, b) for i, a in enumerate(mean) for b in list(mean)[:i]]
    bound = critical(3 * len(pairs), 23 * 32)
    for a, b in pairs:
        away = np.abs(mean[a] - mean[b]) / np.hypot(error[a], error[b])
        assert (away < bound).all(), f"{a} and {b}: {away}"
    for name in ESTIMATORS:
        assert (error[name] < (0.006 if name in ("light", "mis", "bdpt") else 0.03) * mean[name]).all(), name


@pytest.mark.parametrize("estimator", ["mis", "bdpt"])
@pytest.mark.parametrize("place", [(0.1, 0.03, 0.0), (0.25, 0.25, 0.0), (0.0, 0.0, 0.0)])
def test_shadow_rays_to_a_point_light_are_multiplied_by_the_transmittance(estimator, place):
    """All shadow rays of a point are equal and are multiplied by T, also through the pane's diagonal."""
    scene = quad_scene([Quad((-1, -1, 1), (2, 0, 0), (0, 2, 0), STAINED)])
    scene = replace(scene, lights=(PunctualLight("point", "p", 0, (4.0, 4.0, 4.0), (0.0, 0.0, 2.0)),))
    found = traced(scene, copies_of(place, copies=2), estimator=estimator, max_bounces=0)
    free = point_irradiance((0.0, 0.0, 2.0), np.float64(place), (0, 0, 1)) * 4.0
    np.testing.assert_allclose(found.mean, np.tile(free * passed(COLOUR, HALF), (2, 1)), rtol=1e-5)
    assert found.standard_error.max() < 1e-6


@pytest.mark.parametrize("estimator", ["uniform", "mis", "bdpt"])
def test_a_pane_before_the_sky_in_a_picture(estimator):
    """Before a sky of radiance 1, a pane has the radiance T (transmitted) + alpha x colour (reflected)."""
    pane = Quad((-4, -4, 0), (8, 0, 0), (0, 8, 0), STAINED)
    estimate = new_estimate(64, 3, 16)
    with build_reference(quad_scene([pane]), sky=(1.0, 1.0, 1.0), lambertian=True, threads=2) as reference:
        for _ in range(16):
            radiance_pass(reference, estimate, VIEW, 8, 8, options=PassOptions(estimator))
    found, error = estimate.mean.mean(axis=0), np.sqrt((estimate.standard_error**2).sum(axis=0)) / 64
    assert (np.abs(found - passed(COLOUR, HALF) - HALF * COLOUR) < 4 * error + 1e-4).all()
    assert (error < 0.005).all()


def test_first_hits_have_the_colour_factor_of_crossed_panes():
    quads = [Quad((-4, -4, z), (8, 0, 0), (0, 8, 0), m) for z, m in ((-1, grey()), (0, STAINED))]
    way = np.random.default_rng(0).normal((0, 0, -4), (1, 1, 0), (400, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    with build_reference(quad_scene(quads), threads=1) as reference:
        hits = first_hits(reference, np.array([0.0, 0.0, 2.0]), way)
    floor = hits.triangle < 2
    assert 150 < floor.sum() < 250
    once = np.broadcast_to(passed(COLOUR, HALF) / (1 - HALF), (floor.sum(), 3))
    np.testing.assert_allclose(hits.kept[floor], once, rtol=1e-6)
    assert (hits.kept[~floor] == 1).all()


def test_a_bake_is_as_bright_as_the_reference_in_each_colour():
    builder = SceneBuilder(128)
    walls = builder.box((-1, -1, -1), (1, 1, 1), builder.material(0.6), 24, inward=True)
    builder.quad((-1, -0.25, -1), (0, 0, 2), (2, 0, 0), glass(builder), (24, 24))
    builder.quad((-0.4, 0.5, -0.4), (0.8, 0, 0), (0, 0, 0.8), builder.material(0.0, 5.0), (8, 8))
    builder.light("point", 0.5, position=(0.6, 0.2, 0.5))
    result = builder.bake(samples=256)
    for side in ("-y", "+x", "+y"):
        quad = walls[side]
        baked = quad.values(result)[2:-2, 2:-2].reshape(-1, 3)
        place = quad.points(4)[2:-2, 2:-2].reshape(len(baked), 16, 3)
        found = traced(builder.build(), (place, np.broadcast_to(quad.normal, place.shape).copy()), passes=12)
        error = found.standard_error / found.mean
        assert (np.median(np.abs(baked / found.mean - 1), axis=0) < 1.2 * error.mean(axis=0)).all(), side
        assert baked.mean(axis=0) / found.mean.mean(axis=0) == pytest.approx(np.ones(3), abs=0.008), side
