"""Godot 4 draws the export `godot` correctly, and changed exports incorrectly.

A web build of Godot 4.6 with the Compatibility renderer draws all cases in one run, because its start takes
several seconds.
"""

from __future__ import annotations

import json
import math

import numpy as np
import pytest
from engine_scenes import (
    ALBEDO,
    MIDDLE,
    QUADRANT,
    SIZE,
    probe_expected,
    probe_page,
    srgb_page,
    write_probe,
)
from godot_game import play
from proof import (
    changed,
    curve,
    edited,
    lower_left_quarter,
    middles,
    shows_something_else,
    shows_the_probe,
    shows_the_room,
    with_material,
)

from baker.exporters import godot

pytestmark = pytest.mark.engines
# Suggested exposure of the probe.
EXPOSURE = 0.5
# Intensity of a light 1 m in front of the probe's middle, cd.
INTENSITY = 4.0
# Radiance of an emission that is brighter than white, cd/m2.
BRIGHT = 6.0


def lit_expected():
    """Return (4, 3) radiance of the probe in the light of `with_light`, at the points `MIDDLE`."""
    off = np.array(MIDDLE) * 2.0 - 1.0
    irradiance = INTENSITY / (1.0 + (off**2).sum(axis=1)) ** 1.5
    return irradiance[:, None] * np.array(ALBEDO) / math.pi


def with_light(document):
    lights = [{"type": "point", "intensity": INTENSITY}]
    document["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    document["extensionsUsed"] = ["KHR_lights_punctual"]
    light = {
        "name": "light_n3",
        "translation": [0, 0, 1],
        "extensions": {"KHR_lights_punctual": {"light": 0}},
    }
    document["nodes"].append(light)
    document["scenes"][0]["nodes"].append(len(document["nodes"]) - 1)


def emitting(document):
    for material in document["materials"]:
        material["pbrMetallicRoughness"]["baseColorFactor"] = [0, 0, 0, 1]
        material["emissiveFactor"] = [1.0, 0.5, 0.25]
        material["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": BRIGHT}}
    document["extensionsUsed"] = ["KHR_materials_emissive_strength"]


def with_occlusion(document):
    for material in document["materials"]:
        material["occlusionTexture"] = {"index": 0, "texCoord": 1}


def first_uv_set(document):
    for mesh in document["meshes"]:
        attributes = mesh["primitives"][0]["attributes"]
        attributes["TEXCOORD_1"] = attributes["TEXCOORD_0"]


def with_objects(folder, choose):
    """Replace the objects of an export's lightmap.json by `choose(objects)`; return the folder."""
    path = folder / "lightmap.json"
    description = json.loads(path.read_text("utf-8"))
    description["objects"] = choose(description["objects"])
    path.write_text(json.dumps(description), "utf-8")
    return folder


def and_a_missing_one(objects):
    return [*objects, objects[0] | {"name": "gone_n9"}]


def write_export(folder, page=None):
    return write_probe(folder, "godot", page=page, suggested_exposure=EXPOSURE) / "godot"


def right_exports(work, probe, room):
    """Return {name: task} of correct exports."""
    quarter = with_objects(lower_left_quarter(probe, work / "quarter"), and_a_missing_one)
    lit = edited(probe, work / "lit", with_light)
    blend = edited(probe, work / "blend", with_material(0.5, alphaMode="BLEND"))
    mask = edited(probe, work / "mask", with_material(0.25, alphaMode="MASK", alphaCutoff=0.5))
    double = edited(probe, work / "double", with_material(doubleSided=True))
    bright = edited(probe, work / "bright", emitting)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(godot, "MAX_ROWS", SIZE)
        two_images = write_export(work / "two")
    tasks = {}
    for way in ("import", "fallback"):
        tasks |= {
            f"probe, {way}": {"folder": probe, "way": way},
            f"room, {way}": {"folder": room, "way": way, "camera": "inside"},
            f"quarter, {way}": {"folder": quarter, "way": way},
            f"two images, {way}": {"folder": two_images, "way": way},
            f"light, {way}": {"folder": lit, "way": way},
            f"blend, {way}": {"folder": blend, "way": way, "exposures": [1.0]},
            f"mask, {way}": {"folder": mask, "way": way},
            f"back, {way}": {"folder": probe, "way": way, "camera": "back"},
            f"double, {way}": {"folder": double, "way": way, "camera": "back"},
            f"emission, {way}": {"folder": bright, "way": way},
        }
    dynamic = with_objects(edited(probe, work / "dynamic", with_light), lambda _: [])
    return tasks | {"dynamic": {"folder": dynamic}, "not imported": {"folder": probe, "textures": False}}


def wrong_exports(work, probe):
    """Return {name: task} of exports that are wrong in one point."""
    rect = 'Rect2(entry["uv_offset"][0], entry["uv_offset"][1], entry["uv_scale"][0], entry["uv_scale"][1])'
    flipped = changed(probe, work / "flipped", "lightmap_gi.gd", rect, "Rect2(0, 1, 1, -1)")
    lit = edited(probe, work / "lit before", with_light)
    twice = changed(lit, work / "lit twice", "lightmap_gi.gd", "Light3D.BAKE_STATIC", "Light3D.BAKE_DYNAMIC")
    shader = "fallback/lightmap.gdshader"
    return {
        "v turned over": {"folder": flipped},
        "first uv set": {"folder": edited(probe, work / "first", first_uv_set)},
        "no pi": {"folder": write_export(work / "pi", probe_page() * math.pi)},
        "sRGB numbers": {"folder": write_export(work / "srgb", srgb_page())},
        "lights twice": {"folder": twice},
        "AO applied twice": {"folder": edited(probe, work / "ao", with_occlusion)},
        "fallback, first uv set": {
            "folder": changed(probe, work / "uv", shader, "UV2 * uv_scale", "UV * uv_scale"),
            "way": "fallback",
        },
        "fallback, colours not decoded": {
            "folder": changed(probe, work / "plain", shader, "if (OUTPUT_IS_SRGB)", "if (false)"),
            "way": "fallback",
        },
    }


@pytest.fixture(scope="module")
def drawn(browser, room, tmp_path_factory):
    """Return {name: picture} in units of E / pi, and the lines that Godot printed."""
    work = tmp_path_factory.mktemp("godot4")
    probe = write_export(work / "probe")
    tasks = right_exports(work, probe, room / "godot") | wrong_exports(work, probe)
    pictures, told = play(browser, work, list(tasks.values()))
    drawn = {}
    for (name, task), picture in zip(tasks.items(), pictures, strict=True):
        exposure = json.loads((task["folder"] / "lightmap.json").read_text("utf-8"))["exposure"]
        drawn[name] = picture if "exposures" in task else picture / exposure
    return drawn, told


WAYS = pytest.mark.parametrize("way", ["import", "fallback"])


@WAYS
def test_the_probe_is_shown(drawn, way):
    assert shows_the_probe(drawn[0][f"probe, {way}"]), middles(drawn[0][f"probe, {way}"])


@WAYS
def test_a_room_of_known_radiosity(drawn, way):
    assert shows_the_room(drawn[0][f"room, {way}"])


@WAYS
def test_offset_and_scale_of_an_object_are_used(drawn, way):
    expected = probe_expected() / QUADRANT.ravel()[:, None] * QUADRANT[1, 0]
    assert shows_the_probe(drawn[0][f"quarter, {way}"], expected)


@WAYS
def test_pages_in_two_images(drawn, way):
    assert shows_the_probe(drawn[0][f"two images, {way}"])


@WAYS
def test_a_baked_light_lights_no_baked_object(drawn, way):
    assert shows_the_probe(drawn[0][f"light, {way}"])


def test_a_baked_light_lights_other_objects_at_the_scale_of_the_pages(drawn):
    """The light is 1 m in front of the square. The tolerance covers the specular highlight."""
    assert middles(drawn[0]["dynamic"]) == pytest.approx(lit_expected(), rel=0.1)


@WAYS
def test_transparency_stays(drawn, way):
    """The renderer blends sRGB numbers, here with black. The tolerance is one step of 8 bits."""
    expected = 0.5 * curve(probe_expected() * EXPOSURE)
    assert middles(drawn[0][f"blend, {way}"]) == pytest.approx(expected, abs=1.0 / 255)
    assert drawn[0][f"mask, {way}"].max() == 0.0


@WAYS
def test_double_sided_materials_stay(drawn, way):
    assert drawn[0][f"back, {way}"].max() == 0.0
    assert shows_the_probe(drawn[0][f"double, {way}"], probe_expected()[[1, 0, 3, 2]])


@WAYS
def test_emission_has_the_scale_of_the_pages(drawn, way):
    """The Compatibility renderer decodes colours with a polynomial. The tolerance covers its error."""
    expected = np.tile(BRIGHT * np.array([1.0, 0.5, 0.25]), (4, 1))
    assert middles(drawn[0][f"emission, {way}"]) == pytest.approx(expected, rel=0.03)


def test_images_that_are_not_imported_get_a_sentence(drawn):
    pictures, told = drawn
    assert pictures["not imported"].max() == 0.0
    assert any("lightmap_0.exr is not imported as Texture2DArray with 2 slices" in line for line in told)
    assert not any("SCRIPT ERROR" in line for line in told), told


def test_objects_that_the_scene_lacks_are_named(drawn):
    assert any("no lightmap for 1 objects that are not in the scene: gone_n9" in line for line in drawn[1])


@pytest.mark.parametrize(
    "name",
    [
        "v turned over",
        "first uv set",
        "no pi",
        "sRGB numbers",
        "lights twice",
        "AO applied twice",
        "fallback, first uv set",
        "fallback, colours not decoded",
    ],
)
def test_a_wrong_export_fails(drawn, name):
    assert shows_something_else(drawn[0][name]), middles(drawn[0][name])


def test_physical_light_units(browser, tmp_path):
    """With physical units, the camera divides light by 1.2 x 2^EV100, and the exposure of the pages cancels.

    Emission is not tested, because the Compatibility renderer does not divide it.
    """
    probe = write_export(tmp_path / "probe")
    tasks = {
        "probe": {"folder": probe},
        "dynamic": {"folder": with_objects(edited(probe, tmp_path / "dynamic", with_light), lambda _: [])},
    }
    setting = "lights_and_shadows/use_physical_light_units=true\n"
    pictures, told = play(browser, tmp_path, [{**t, "ev100": 1.0} for t in tasks.values()], setting)
    drawn = dict(zip(tasks, (1.2 * 2.0 * picture for picture in pictures), strict=True))
    assert not any("SCRIPT ERROR" in line for line in told), told
    assert shows_the_probe(drawn["probe"]), middles(drawn["probe"])
    assert middles(drawn["dynamic"]) == pytest.approx(lit_expected(), rel=0.1)
