"""Bakes of the project's scenes, sampled at world points where the light or AO is known at least roughly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from probes import Probe

import baker

ASSETS = Path(__file__).parents[2] / "assets"
UP, DOWN = (0.0, 1.0, 0.0), (0.0, -1.0, 0.0)


def bake(name, **settings):
    return Probe(baker.bake(ASSETS / f"{name}.glb", resolution=256, quality="preview", **settings))


@pytest.fixture(scope="module")
def interior():
    return bake("interior", ao_distance="0.5")


@pytest.fixture(scope="module")
def hall():
    return bake("hall", sky="500", ao_distance="1.0")


def mean(probe, points, normal, channel="irradiance"):
    return float(np.mean([probe.at(p, normal, channel).mean() for p in points]))


def sunlit(y):
    """Return the floor point that the sun lights through the window's left half at height y."""
    way = np.array([0.72, -0.62, 0.31])
    start = np.array([-0.2, y, 1.55])
    return start + way * (y / 0.62)


def test_sun_lies_on_the_floor_where_the_window_lets_it(interior):
    # Direct irradiance: 20000 lx x cosine at the floor x mean of the sun's colour.
    direct = 20000 * 0.62 / np.linalg.norm([0.72, 0.62, 0.31]) * (1.0 + 0.93 + 0.82) / 3
    spots = [sunlit(y) for y in (1.14, 1.17, 1.2)]
    lit = [interior.at(p, UP, within=0.02).mean() for p in spots]
    # Texels are 10 cm wide, and the sunlit area between sill and rug is 25 cm wide, so texels may be partly
    # shaded. Reflected light is added.
    assert 0.85 * direct < np.median(lit) < 1.6 * direct
    # Points mirrored in z, on the other side of the room, are in the shade.
    assert mean(interior, [(1.5, 0, 3.8), (4.5, 0, 3.6), (3.5, 0, 3.8)], UP) < 0.2 * direct


def test_floor_under_the_table_and_the_sofa_is_darker(interior):
    open_floor = mean(interior, [(3.9, 0, 1.0), (4.3, 0, 2.0), (1.0, 0, 3.7)], UP)
    sofa = mean(interior, [(2.2, 0, 0.5), (2.5, 0, 0.45), (2.9, 0, 0.5)], UP)
    assert sofa < 0.3 * open_floor
    assert mean(interior, [(2.2, 0, 0.5), (2.9, 0, 0.5)], UP, "ao") < 0.3
    assert mean(interior, [(3.9, 0, 1.0), (6.9, 0, 2.2)], UP, "ao") > 0.97


def test_ao_falls_into_corners(interior):
    middle = mean(interior, [(6.9, 0, 2.3)], UP, "ao")
    edge = mean(interior, [(6.9, 0, 3.93)], UP, "ao")
    corner = mean(interior, [(5.27, 0, 3.93)], UP, "ao")
    # The point is 7 cm from a wall and the AO distance is 50 cm. With c = 7 / 50 = 0.14, AO is 1 - (acos c -
    # c sqrt(1 - c c)) / pi = 0.59.
    assert middle > 0.97
    assert edge == pytest.approx(0.59, abs=0.08)
    assert corner < 0.8 * edge


def test_no_light_leaks_behind_walls(interior):
    """Outside, there is only the sun and a black sky: the sun lights the -x wall, and the +x wall is dark."""
    for z in (0.3, 1.0, 2.0, 3.0, 3.9):
        for y in (0.05, 0.8, 1.7, 2.55):
            assert interior.at((8.8, y, z), (1, 0, 0)).max() < 1e-3
    # The study has no window. Only the panel and the doorway light its far wall.
    study = mean(interior, [(8.6, 1.0, 1.0), (8.6, 1.5, 3.0)], (-1, 0, 0))
    assert 20 < study < 3000


def test_panel_lights_the_study_from_above(interior):
    below = interior.at((6.9, 0, 2.3), UP).mean()
    aside = interior.at((5.4, 0, 3.8), UP).mean()
    assert below > 1.5 * aside
    # Direct light of the panel, L A cos / r^2, is at most 2730 * 0.72 / 2.545^2 = 303 lx. Reflected light is
    # added.
    assert 200 < below < 900


def test_hall_sun_and_shade(hall):
    # Each bay of 3 m has a window from 0.9 to 2.1 m along the bay, at heights of 3.2 to 5.2 m.
    way = np.array([0.25, -0.72, -0.65])
    spot = np.array([-12.0 + 3 * 3 + 1.25, 4.6, 6.2]) + way * 4.6 / 0.72
    lit = hall.at((spot[0], 0, spot[2]), UP).mean()
    direct = 30000 * 0.72 / np.linalg.norm(way) * (1.0 + 0.95 + 0.87) / 3
    # Texels are 34 cm wide, and the sunlit area is 1.2 m wide.
    assert 0.75 * direct < lit < 1.2 * direct
    dark = mean(hall, [(-9.5, 0, -5.6), (0.0, 0, -5.7), (9.5, 0, -5.6)], UP)
    assert dark < 0.1 * direct


def test_hall_outside_under_the_sky(hall):
    """Outside, on the wall away from the sun, E = pi L: only sky is visible, as the scene has no ground."""
    values = [hall.at((x, 2.8, -6.4), (0, 0, -1)).mean() for x in (-10.0, -3.0, 4.0, 11.0)]
    assert np.mean(values) == pytest.approx(np.pi * 500, rel=0.01)


def test_hall_columns_stand_in_their_own_shade(hall):
    foot = mean(hall, [(-3.0 + 0.5, 0, 3.2), (3.0 + 0.5, 0, -3.2)], UP, "ao")
    free = mean(hall, [(-1.5, 0, 3.2), (1.5, 0, -5.0)], UP, "ao")
    assert foot < 0.85 < 0.95 < free


def test_values_are_finite_and_in_range(interior, hall):
    for probe in (interior, hall):
        for lightmap in probe.result.lightmaps.values():
            assert np.isfinite(lightmap.value).all()
            assert lightmap.value.min() >= 0
        assert probe.result.lightmaps["ao"].value.max() <= 1
        energy = probe.result.solve["energy"]
        assert energy["absorbed"] + energy["escaped"] == pytest.approx(energy["emitted"], rel=5e-3)
        assert probe.result.solve["residual"] < 1e-4
