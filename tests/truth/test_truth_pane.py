"""Panes (KHR_materials_transmission) multiply light by t c (1 - F) at each crossing in bake and reference."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from closed_forms import point_irradiance
from reference_runs import copies_of, traced
from scenes import SceneBuilder
from test_truth_alpha import floor_under
from test_truth_transmittance import glass
from tiny_scenes import Quad, quad_scene

from baker.core.scene import Material, PunctualLight

COLOUR = np.array([1.0, 0.5, 0.0])
F0 = 0.04


def pane(transmission=1.0, colour=COLOUR):
    """Return a function that adds a pane to a builder."""

    def add(builder):
        number = glass(builder, colour, 1.0 - transmission)
        builder.materials[number] = replace(builder.materials[number], reflectance=F0)
        return number

    return add


def fresnel(cosine):
    """Return Schlick's reflectance."""
    return F0 + (1 - F0) * (1 - cosine) ** 5


@pytest.mark.parametrize("degrees", [0.0, 40.0, 60.0])
@pytest.mark.parametrize("transmissions", [[1.0], [0.75], [1.0, 0.5]])
def test_the_sun_passes_by_its_angle(degrees, transmissions):
    angle = math.radians(degrees)
    where = {"direction": (math.sin(angle) / math.sqrt(2), -math.cos(angle), math.sin(angle) / math.sqrt(2))}
    builder, floor = floor_under(*map(pane, transmissions), half=0.2, texels=8, **where)
    found = floor.values(builder.bake(bounces=0, samples=16))
    share = np.prod([t * COLOUR * (1 - fresnel(math.cos(angle))) for t in transmissions], axis=0)
    np.testing.assert_allclose(found, np.broadcast_to(math.cos(angle) * share, found.shape), rtol=1e-5)


def test_a_sky_passes_by_the_mean_of_all_angles():
    builder = SceneBuilder(96)
    floor = builder.quad((-0.1, 0, -0.1), (0, 0, 0.2), (0.2, 0, 0), builder.material(0.0), (8, 8))
    builder.quad((-99, 0.1, -99), (0, 0, 198), (198, 0, 0), pane(0.75)(builder), (8, 8))
    found = floor.values(builder.bake(bounces=0, samples=1024, sky="1")).mean(axis=(0, 1))
    # The mean of (1 - cos)^5 over the hemisphere, weighted by the cosine, is 1 / 21.
    truth = math.pi * 0.75 * COLOUR * (1 - F0) * (1 - 1 / 21)
    # 64 texels x 1024 rays pass with probability 0.75, so one standard error is 0.23 %.
    np.testing.assert_allclose(found, truth, rtol=0.008)
    lid = Material(
        base_colour=(*COLOUR.tolist(), 0.25), alpha_mode="BLEND", double_sided=True, reflectance=F0
    )
    scene = quad_scene([Quad((-99, -99, 0.1), (198, 0, 0), (0, 198, 0), lid)])
    seen = traced(
        scene, copies_of((0.0, 0.03, 0.0), copies=2), sky=(1, 1, 1), passes=16, samples=512, max_bounces=0
    )
    np.testing.assert_allclose(seen.mean.mean(axis=0), truth, rtol=0.012)


@pytest.mark.parametrize("place", [(0.1, 0.03, 0.0), (0.25, 0.25, 0.0), (0.0, 0.0, 0.0)])
def test_the_reference_sees_a_point_light_by_its_angle(place):
    """The last two places see the light through the diagonal of the pane, which counts once."""
    lid = Material(base_colour=(*COLOUR.tolist(), 0.0), alpha_mode="BLEND", double_sided=True, reflectance=F0)
    scene = quad_scene([Quad((-1, -1, 1), (2, 0, 0), (0, 2, 0), lid)])
    scene = replace(scene, lights=(PunctualLight("point", "p", 0, (4.0, 4.0, 4.0), (0.0, 0.0, 2.0)),))
    found = traced(scene, copies_of(place, copies=2), max_bounces=0)
    free = point_irradiance((0.0, 0.0, 2.0), np.float64(place), (0, 0, 1)) * 4.0
    cosine = 2.0 / np.linalg.norm(np.subtract((0.0, 0.0, 2.0), place))
    truth = free * COLOUR * (1 - fresnel(cosine))
    np.testing.assert_allclose(found.mean, np.broadcast_to(truth, found.mean.shape), rtol=1e-5, atol=1e-9)
