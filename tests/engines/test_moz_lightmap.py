"""Loaders of MOZ_lightmap in three.js draw `gltf/lightmaps.glb` correctly, and changed files incorrectly."""

from __future__ import annotations

import json
import struct

import pytest
from engine_scenes import ALBEDO, probe_expected
from proof import draw, middles, shows_something_else, shows_the_probe
from shared_probe import shows_the_squares, write_shared_probe

pytestmark = pytest.mark.engines
# A standard material shows up to 2 % less than albedo x E / pi, because it also reflects specularly. In the
# PNG, the darkest quadrant has level 32 of 255, so rounding adds an error of up to 0.5 / 32.
REL = 0.02 + 0.5 / 32


@pytest.fixture(scope="module")
def standard(browser, probe):
    """Return what standard materials show of the same bake in the export `three`."""
    return middles(draw(browser, probe / "three", camera="front", options='{"matte": false}'))


@pytest.mark.parametrize(("loader", "rel"), [("hubs", 0.005), ("addon", 0.5 / 32)])
def test_the_probe_is_shown(browser, probe, standard, loader, rel):
    """`hubs` reads the Radiance image, whose values three.js decodes 1/255 too large; `addon` the PNG."""
    picture = draw(browser, probe / "gltf", camera="front", moz=loader)
    assert middles(picture) == pytest.approx(standard, rel=rel)
    assert shows_the_probe(picture, rel=REL), middles(picture)


def edited(folder, target, change):
    """Copy lightmaps.glb into `target` and change each light map in it."""
    data = (folder / "lightmaps.glb").read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    document = json.loads(data[20 : 20 + length])
    for material in document["materials"]:
        if "MOZ_lightmap" in material.get("extensions", {}):
            change(document, material, material["extensions"]["MOZ_lightmap"])
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + length :]
    head = struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A)
    (target / "lightmaps.glb").write_bytes(head + text + rest)
    return target


def wrong_set(document, material, lightmap):
    lightmap["texCoord"] = 0


def no_pi(document, material, lightmap):
    lightmap["intensity"] *= 3.14159


def no_intensity(document, material, lightmap):
    del lightmap["intensity"]


def metal(document, material, lightmap):
    material["pbrMetallicRoughness"]["metallicFactor"] = 1.0


def occluded(document, material, lightmap):
    occlusion = next(m["occlusionTexture"] for m in document["materials"] if "occlusionTexture" in m)
    material["occlusionTexture"] = occlusion


@pytest.mark.parametrize("change", [wrong_set, no_pi, no_intensity, occluded])
def test_a_wrong_file_fails(browser, probe, tmp_path, change):
    picture = draw(browser, edited(probe / "gltf", tmp_path, change), camera="front", moz="addon")
    assert shows_something_else(picture, rel=REL)


def test_metals_would_be_black(browser, probe, tmp_path):
    picture = draw(browser, edited(probe / "gltf", tmp_path, metal), camera="front", moz="hubs")
    assert middles(picture).max() < 0.01 * min(ALBEDO) * probe_expected().max()


@pytest.mark.parametrize("loader", ["hubs", "addon"])
def test_instances_of_a_mesh_have_their_own_places(browser, tmp_path, loader):
    out = write_shared_probe(tmp_path, "gltf")
    picture = draw(browser, out / "gltf", camera="front", moz=loader)
    assert shows_the_squares(picture, REL)
