"""Irradiance in levels built like those of games, sampled at surface points as an engine samples it.

The expected value is 0 where no light can arrive, and a closed form where no light is reflected. All other
values were path-traced once with 15,360 paths per point, and are given with their standard error. Tolerances
include the noise of the bake and the size of its texels.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from probes import Probe

import baker

ASSETS = Path(__file__).parents[2] / "assets"
FOLDER = ASSETS / "levels"
KEPT = ("closed", "garage", "street", "tunnel", "warehouse")
UP, DOWN, EAST, WEST, NORTH, SOUTH = (0, 1, 0), (0, -1, 0), (1, 0, 0), (-1, 0, 0), (0, 0, -1), (0, 0, 1)
# Largest E in a dark room as a share of E outside: far from other surfaces, and about a texel from another
# surface.
AWAY, BESIDE = 1e-4, 1e-3


def bake(name, resolution=192, samples=64, **settings):
    sky = tuple(json.loads((FOLDER / "levels.json").read_text("utf-8"))[name])
    how = {"channels": ["irradiance"], "resolution": resolution, "samples": samples, "sky": sky}
    return Probe(baker.bake(FOLDER / f"{name}.glb", **{**how, **settings}))


def texel(probe, name):
    """Return the width of an object's texels in metres."""
    names = [instance.name for instance in probe.result.scene.instances]
    return 1.0 / probe.result.atlas.layouts[names.index(name)].texels_per_metre


def light(probe, places):
    """Return the irradiance (n, 3) at places (x, y, z, normal)."""
    return np.array([probe.at(place[:3], place[3]) for place in places])


def test_levels_are_made_again_byte_for_byte(tmp_path):
    command = [sys.executable, str(ASSETS / "make_levels.py"), str(tmp_path)]
    subprocess.run(command, check=True, capture_output=True)
    for name in KEPT:
        assert (tmp_path / f"{name}.glb").read_bytes() == (FOLDER / f"{name}.glb").read_bytes(), name
    skies = json.loads((tmp_path / "levels.json").read_text("utf-8"))
    assert len(skies) == 20
    kept = json.loads((FOLDER / "levels.json").read_text("utf-8"))
    assert kept == {name: skies[name] for name in KEPT}


def test_closed_rooms_on_a_floor_that_runs_on_outside_are_dark():
    probe, outside = bake("closed"), np.pi * 1000.0
    width = texel(probe, "floor")
    rooms = {"thin": (-7.487, -0.009), "thin, both sides": (-2.487, -0.009)}
    rooms |= {"thick": (2.513, 0.017), "thick, both sides": (7.513, 0.017)}
    for kind, (x, z) in rooms.items():
        away = [(x + a, 0.0, z + b, UP) for a in (-1.1, 0, 1.1) for b in (-1.1, 0, 1.1)]
        away += [(x - 1.5, 1.3, z + b, EAST) for b in (-1.1, 0, 1.1)]
        ceiling = 2.5 if kind.startswith("thin") else 2.4625
        away += [(x + a, ceiling, z, DOWN) for a in (-1.1, 0, 1.1)]
        # A floor texel that lies on both sides of a wall has one value, so sample one texel away from the
        # wall.
        b = 1.5 - 1.05 * width
        beside = [(x + a, 0.0, z + c, UP) for a in (-1.2, 0.4, 1.2) for c in (-b, b)]
        beside += [(x + a, 0.05, z + 1.5, NORTH) for a in (-1.2, 0.4, 1.2)]
        assert light(probe, away).max() < AWAY * outside, kind
        assert light(probe, beside).max() < BESIDE * outside, kind
    assert light(probe, [(2.5, 2.65, 0, UP)]) == pytest.approx(outside, rel=2e-3)
    # Path-traced values outside, between the rooms and in front of the rooms, standard error 0.3 %.
    found = light(probe, [(0, 0, 0.3, UP), (-7, 0, 3.3, UP), (2.5, 1.3, 1.667, SOUTH)])[:, 1]
    assert found == pytest.approx([2199, 2679, 2830], rel=0.02)


def test_a_shut_garage_is_dark_whatever_reaches_through_its_walls():
    probe, outside = bake("garage"), np.pi * 500.0
    away = [(0, 0, 0, UP), (2.4, 0, -1.6, UP), (-2.97, 1.2, 0.7, EAST), (0.5, 1.8, 2.52, NORTH)]
    away += [(0, 2.2, 0.1, DOWN), (1, 2.32, 0.0, NORTH), (-1, 2.32, -1.5, SOUTH)]
    away += [(-0.5, 0.53, -2.2, UP), (-0.5, 0.5, -2.2, DOWN), (-2.3, 0.4, 2.2, NORTH), (-1.6, 0.85, 2.3, UP)]
    beside = [
        (0, 0, -2.48 + 1.05 * texel(probe, "floor"), UP),
        (-2.97, 2.16, 0.1, EAST),
        (-0.5, 0.53, -2.45, UP),
        (-2.3, 0.85, 2.49, UP),
    ]
    beside += [(2.97, 2.2, 1.7, DOWN), (3.03, 2.15, -1.6, WEST), (1.0, 1.06, -2.48, SOUTH)]
    assert light(probe, away).max() < AWAY * outside
    assert light(probe, beside).max() < BESIDE * outside
    assert light(probe, [(1.5, 2.65, 0.5, UP)]) == pytest.approx(outside, rel=2e-3)
    # Path-traced values on the floor outside, a beam's end and a wall, standard error 0.1 %.
    found = light(probe, [(0, 0, 4.5, UP), (3.6, 2.33, 0.1, EAST), (3.08, 1.4, -0.8, EAST)])[:, 0]
    assert found == pytest.approx([1443.6, 1436.7, 1291.2], rel=0.02)


def test_rooms_of_a_sunlit_street_have_their_own_light():
    probe, sun = bake("street", 256), 50_000.0
    shut = [(-8 + a, 0, -3 + b, UP) for a in (-1.4, 0, 1.4) for b in (-1.4, 0, 1.4)]
    shut += [(-10, 1.2, -3, EAST), (-8, 2.55, -3, DOWN), (-7, 1, -1, NORTH)]
    assert light(probe, shut).max() < AWAY * sun
    width = 1.05 * texel(probe, "street")
    beside = [(-8, 0, -5 + width, UP), (-6 - width, 0, -3, UP), (-9, 0.06, -5, SOUTH)]
    assert light(probe, beside).max() < BESIDE * sun
    # Path-traced values for a bulb of 60 cd in a closed room, standard error 0.2 to 0.5 %.
    places = [(8.8, 0, -1.9, UP), (10, 1.2, -3.6, WEST), (8, 2.55, -2.4, DOWN), (8.2, 0.75, -3, UP)]
    assert light(probe, places)[:, 1] == pytest.approx([29.32, 29.45, 77.26, 65.26], rel=0.08)
    dim = light(probe, [(7 + a, 0, -4.4 + b, UP) for a in (-0.3, 0, 0.3) for b in (-0.3, 0, 0.3)])[:, 1]
    assert dim.mean() == pytest.approx(25.84, rel=0.03)
    # Path-traced values in the sun and in the shade, standard error 0.8 %.
    found = light(probe, [(4.5, 0, -0.5, UP), (11, 0, 4, UP), (-4.5, 0, -2, UP)])[:, 1]
    assert found == pytest.approx([48105, 46769, 8571], rel=0.04)


def test_signs_of_a_few_lit_pixels_shine_with_their_power():
    probe = bake("tunnel", 128, 256, bounces=0)
    shade = np.arange(8, 64, 16)
    column, row = (a.ravel() + 0.5 for a in np.meshgrid(shade, shade))
    size = (1.0 / 64) * (0.5 / 64)
    middle = np.array([-12.0, -6.0, 0.0, 6.0, 12.0])
    z = (middle[:, None] + 0.5 - column / 64).ravel()
    pixel = np.stack([np.full_like(z, -1.99), np.tile(1.6 + 0.5 * (1 - row / 64), 5), z], axis=1)
    places = [(2, 1.2 + 0.3 * k, -9.0 + 3 * j, WEST) for k in range(5) for j in range(7)]
    places += [(-0.5 + 0.2 * k, 3, -8 + 4 * k, DOWN) for k in range(5)]
    truth = []
    for *place, normal in places:
        arm = pixel - np.array(place)
        square = (arm * arm).sum(axis=1)
        cosine = np.maximum(arm @ np.array(normal), 0) * -arm[:, 0] / square
        truth.append(20_000.0 * size * (cosine / square).sum())
    found = light(probe, places)[:, 0] / np.array(truth)
    # A single point has more noise, with 256 samples and denoising, than the mean of 40 points.
    assert found.mean() == pytest.approx(1, abs=0.01)
    assert found == pytest.approx(1, abs=0.1)


def test_a_hundred_lights_add_up():
    probe = bake("warehouse", 192, 16, bounces=0)
    k = np.arange(100)
    point = np.stack([-13.5 + 3 * (k % 10), 6.0 + 0.1 * (k % 7), -18.0 + 4 * (k // 10)], axis=1)
    # Every light is visible from these points, which lie above the racks.
    places = [(-15, 3.2, z, EAST) for z in (-15.0, -3.0, 7.0)] + [(15, 4.1, z, WEST) for z in (-9.0, 2.0)]
    places += [(x, 3.4, 20, NORTH) for x in (-8.0, 0.0, 9.0)]
    truth = []
    for *place, normal in places:
        arm = point - np.array(place)
        truth.append(((40.0 + k) * (arm @ np.array(normal)) / (arm * arm).sum(axis=1) ** 1.5).sum())
    assert light(probe, places) == pytest.approx(np.array(truth)[:, None].repeat(3, axis=1), rel=0.01)
