"""Checks report no sound scene that resembles a flawed one, and find flaws that resemble sound geometry."""

from __future__ import annotations

import numpy as np
import pytest
from flawed_scenes import (
    CEILING,
    CUBE,
    FLOOR,
    GREY,
    GRID,
    GRID_TRIANGLE,
    dimmed,
    point,
    quad,
    scene,
    sun,
    with_uv,
)
from gltf_builder import QUAD_TRIANGLE, write

from baker.checks.run import check_scene
from baker.checks.settings import CheckSettings
from baker.core.settings import BakeSettings


def codes(tmp_path, data, **settings) -> set[str]:
    report = check_scene(write(tmp_path / "scene.glb", data), CheckSettings(), BakeSettings(**settings))
    return {finding.code for finding in report.findings}


def arch(without=()):
    """Return an arch of 24 segments; its feet stand on y = 0 and are open. `without` lists omitted faces."""
    ring = np.linspace(0, np.pi, 25)
    inner = np.stack([np.cos(ring), np.sin(ring)], axis=1)
    section = [(1.0, 0.0), (1.2, 0.0), (1.2, 0.2), (1.0, 0.2)]
    place = np.float32([[r * x, r * y, z] for x, y in inner for r, z in section])
    faces = []
    for k in range(24):
        for s in range(4):
            a, b = 4 * k + s, 4 * k + (s + 1) % 4
            faces += [(a, a + 4, b + 4), (a, b + 4, b)]
    return place, np.delete(np.int64(faces), list(without), axis=0)


def test_an_arch_without_bottom_has_no_hole(tmp_path):
    assert "open-edges" not in codes(tmp_path, scene(arch()))


def test_a_hole_in_the_arch_is_found(tmp_path):
    assert "open-edges" in codes(tmp_path, scene(arch(without=(20,))))


def test_an_arch_that_lies_on_its_side_has_holes(tmp_path):
    lying = {"rotation": [0.70710678, 0, 0, 0.70710678]}
    assert "open-edges" in codes(tmp_path, scene((*arch(), {}, lying)))


def test_a_missing_face_of_a_convex_mesh_is_a_hole(tmp_path):
    # One of the missing triangles is steep. The other one is in the bottom, between flat neighbours.
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    rings = [(0.3, 0.0), (0.8, 0.4), (0.8, 0.8), (0.3, 1.2)]
    place = [[r * np.cos(a), y, r * np.sin(a)] for r, y in rings for a in angle]
    faces = [
        t
        for k in range(3)
        for s in range(24)
        for a, b in [(24 * k + s, 24 * k + (s + 1) % 24)]
        for t in ((a, a + 24, b + 24), (a, b + 24, b))
    ]
    place += [[0, 0, 0], [0, 1.2, 0]]
    faces += [(s, (s + 1) % 24, 96) for s in range(24)] + [(72 + (s + 1) % 24, 72 + s, 97) for s in range(24)]
    assert "open-edges" not in codes(tmp_path, scene((np.float32(place), np.int64(faces))))
    for left in (faces[1:], [*faces[:144], *faces[145:]]):
        assert "open-edges" in codes(tmp_path, scene((np.float32(place), np.int64(left))))


def wavy():
    return 0.05 + 0.9 * (GRID[:, :2] + 0.02 * np.sin(7 * GRID[:, 1::-1]))


def test_half_floats_are_too_coarse_for_large_pages(tmp_path):
    data = with_uv(wavy().astype(np.float16), GRID, GRID_TRIANGLE)
    assert "uv.precision" in codes(tmp_path, data, resolution=4096)
    assert "uv.precision" not in codes(tmp_path, data, resolution=1024)


def test_levels_over_the_range_of_the_layout_are_found(tmp_path):
    # Draco spreads its levels over the range of the values, and not over 0..1.
    uv = wavy()
    low, wide = uv.min(axis=0), float(np.ptp(uv, axis=0).max())
    data = with_uv(low + np.round((uv - low) / wide * 1023) / 1023 * wide, GRID, GRID_TRIANGLE)
    assert "uv.precision" in codes(tmp_path, data, resolution=2048)
    assert "uv.precision" not in codes(tmp_path, data, resolution=512)


@pytest.mark.parametrize("cells", [15, 16, 17, 51, 64])
def test_a_regular_grid_is_not_rounded(tmp_path, cells):
    x, y = np.meshgrid(np.arange(cells + 1), np.arange(cells + 1))
    place = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], axis=1) / cells
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).reshape(-1)
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + cells + 2], 1),
         np.stack([corner, corner + cells + 2, corner + cells + 1], 1)]
    )  # fmt: skip
    data = with_uv(place[:, :2], np.float32(place), faces)
    assert "uv.precision" not in codes(tmp_path, data, resolution=4096)


def test_vertex_colours_that_are_the_colour_of_the_surface_are_sound(tmp_path):
    white = {"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}}
    colour = np.full((4, 3), 0.1, np.float32)
    assert "dark-colours" not in codes(tmp_path, scene(quad(COLOR_0=colour), materials=(white,)))
    assert "dark-colours" in codes(tmp_path, dimmed(0.1))


def test_walls_with_their_back_to_the_sun_are_sound(tmp_path):
    down = (-0.70710678, 0, 0, 0.70710678)
    ceiling = (FLOOR + np.float32([0, 2, 0]), QUAD_TRIANGLE[:, ::-1])
    assert "lit-from-behind" not in codes(tmp_path, scene(ceiling, lights=(sun(down),)))


def test_double_sided_surfaces_have_no_black_back(tmp_path):
    both = {**GREY, "doubleSided": True}
    data = scene((FLOOR, QUAD_TRIANGLE[:, ::-1]), lights=(point(1),), materials=(both,))
    assert "lit-from-behind" not in codes(tmp_path, data)


def test_the_sun_is_as_bright_as_daylight(tmp_path):
    down = (-0.70710678, 0, 0, 0.70710678)
    data = scene((FLOOR, QUAD_TRIANGLE), lights=(sun(down, 1e5), point(1)))
    assert "daylight-levels" not in codes(tmp_path, data)


def test_lights_are_not_blamed_for_the_light_of_emitters(tmp_path):
    bright = {"KHR_materials_emissive_strength": {"emissiveStrength": 1e7}}
    emitter = {**GREY, "emissiveFactor": [1, 1, 1], "extensions": bright}

    def found(candela):
        return codes(tmp_path, scene(
            (FLOOR, QUAD_TRIANGLE), (CEILING, QUAD_TRIANGLE, {}, {}, 1),
            lights=(point(candela),), materials=(GREY, emitter),
            extra=lambda builder: builder.json["extensionsUsed"].append("KHR_materials_emissive_strength"),
        ))  # fmt: skip

    assert "daylight-levels" not in found(1)
    assert "daylight-levels" in found(3e5)


def test_numbers_have_no_exponents(tmp_path):
    data = scene(
        (1e3 * CUBE, np.int64([[0, 1, 2]])),
        lights=(point(3e6, (0, 2000, 0)),),
        materials=({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}, "emissiveFactor": [1, 1, 1],
                    "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 2e9}}},),
        extra=lambda builder: builder.json["extensionsUsed"].append("KHR_materials_emissive_strength"),
    )  # fmt: skip
    report = check_scene(write(tmp_path / "a.glb", data), CheckSettings(), BakeSettings(resolution=8192))
    messages = [finding.message for finding in report.findings]
    assert any("3 million cd" in message for message in messages)
    assert not [message for message in messages if "e+" in message]
