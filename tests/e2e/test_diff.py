"""`baker diff` reports no difference between equal bakes, and the object and size of known differences."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from tiny_scenes import Quad, box_quads, grey, joined, quad_scene

from baker.cli.app import run
from baker.core.geometry import world_geometry
from baker.core.scene import PunctualLight
from baker.core.settings import make_settings
from baker.encodings.exr import decode_exr, encode_exr
from baker.io.bake.read_bake import read_bake
from baker.metrics.texel_area import instance_map
from baker.pipeline.bake import bake

ROOM = box_quads((0, 0, 0), (2, 3, 2), inward=True, material=grey(0.6))
EMITTER = Quad((0.5, 1.9, 1.95), (0.8, 0, 0), (0, -0.6, 0), grey(0, 8.0))
BULB = PunctualLight("point", "bulb", 0, (0.4, 0.4, 0.5), (1.6, 0.5, 1.2))
SHELF = Quad((0.2, 0.4, 0.9), (0.9, 0, 0), (0, 0.8, 0), grey(0.4))


def bake_room(out, *quads, **settings):
    scene = replace(quad_scene([*ROOM, EMITTER, *quads]), lights=(BULB,))
    values = {"resolution": 96, "samples": 64, "ao_distance": "0.7", "denoise": False, **settings}
    bake(scene, settings=make_settings(values), out=out)
    return out


@pytest.fixture(scope="module")
def first(tmp_path_factory) -> Path:
    return bake_room(tmp_path_factory.mktemp("diff") / "first")


@pytest.fixture(scope="module")
def other(tmp_path_factory) -> Path:
    where = tmp_path_factory.mktemp("diff") / "other"
    return bake_room(where, resolution=128, padding=2, seed=3)


@pytest.fixture(scope="module")
def doubled(first, tmp_path_factory) -> tuple[Path, int]:
    """Return a copy of the bake in which one object has twice the light, and the node of that object."""
    out = tmp_path_factory.mktemp("diff") / "doubled"
    shutil.copytree(first, out)
    stored = read_bake(out)
    owner = instance_map(world_geometry(stored.scene, stored.atlas), 1, 96)[0]
    largest = int(np.argmax(np.bincount(owner[owner >= 0])))
    pixels = decode_exr(out / "irradiance_0.exr").pixels.copy()
    pixels[owner == largest] *= 2
    encode_exr(out / "irradiance_0.exr", pixels, half=True, header={})
    return out, stored.scene.instances[largest].node


def told(*argv):
    stream = StringIO()
    code = run(["diff", *map(str, argv), "--json", "-q"], out=stream)
    return code, json.loads(stream.getvalue())


def test_a_bake_does_not_differ_from_itself(first):
    code, found = told(first, first)
    assert (code, found["passed"]) == (0, True)
    for entry in (found, *found["objects"]):
        for figures in entry["channels"].values():
            assert figures["texels"] > 0
            for name in ("bias", "rmse", "nrmse", "relmse", "median", "p95", "p99", "max", "flip"):
                assert figures[name] == 0.0
            assert figures["noise_floor"] is figures["z_rms"] is None
    assert found["differences"] == found["worst"] == found["only_in_a"] == found["only_in_b"] == []
    assert found["unmatched"] == 0
    assert len(found["objects"]) == 7


def test_another_layout_differs_by_noise_alone(first, other):
    code, found = told(first, other)
    assert code == 0
    light, ao = found["channels"]["irradiance"], found["channels"]["ao"]
    # Differences come from the noise of 64 rays a texel, and from the blur of shadow edges by half a texel.
    assert abs(light["bias"]) < 0.002
    assert abs(ao["bias"]) < 0.002
    assert 0 < light["median"] < 0.01
    assert light["nrmse"] < 0.015
    assert ao["nrmse"] < 0.03
    assert 0 < light["flip"] < 0.02
    assert found["unmatched"] == 0
    differing = {entry["what"]: (entry["a"], entry["b"]) for entry in found["differences"]}
    assert differing == {
        "settings.resolution": (96, 128),
        "settings.padding": (4, 2),
        "settings.seed": (0, 3),
        "pages.resolution": (96, 128),
    }


def test_the_object_whose_light_was_doubled_is_named(first, other, doubled):
    out, node = doubled
    code, found = told(out, first)
    assert code == 0
    bias = {entry["node"]: entry["channels"]["irradiance"]["bias"] for entry in found["objects"]}
    # Near chart borders, lookups include texels whose light was not doubled.
    assert bias.pop(node) == pytest.approx(1.0, abs=0.02)
    assert all(abs(value) < 1e-6 for value in bias.values())
    assert {entry["node"] for entry in found["worst"]} == {node}
    worst = found["worst"][0]
    assert worst["error"] == pytest.approx(1.0, abs=0.01)
    np.testing.assert_allclose(worst["value"], 2 * np.array(worst["reference"]), rtol=0.01)
    assert worst["in_b"]["row"] == pytest.approx(worst["row"], abs=1)
    flip = {entry["node"]: entry["channels"]["irradiance"]["flip"] for entry in found["objects"]}
    assert max(flip, key=flip.__getitem__) == node
    assert found["channels"]["ao"]["max"] == 0.0
    assert [w["object"] for w in found["warnings"]] == ["irradiance_0.exr"]
    # In a comparison with a bake of another layout, only the same object differs by more than noise.
    _, found = told(out, other, "--no-flip", "--texels", "3000")
    bias = {entry["node"]: entry["channels"]["irradiance"]["bias"] for entry in found["objects"]}
    assert bias.pop(node) == pytest.approx(1.0, abs=0.05)
    assert all(abs(value) < 0.01 for value in bias.values())
    assert found["channels"]["irradiance"]["flip"] is None
    assert found["channels"]["irradiance"]["texels"] == pytest.approx(3000, abs=200)


@pytest.mark.parametrize(
    ("limit", "code"),
    [
        ("irradiance.bias > 0.5, ao.max > 0", 0),
        ("irradiance.bias > 0.01", 1),
        ("ao.max > 0, irradiance.p99 >= 0.5", 1),
        ("irradiance.flip > 0.01", 1),
    ],
)
def test_limits_decide_the_exit_code(first, doubled, limit, code):
    got, found = told(doubled[0], first, "--fail-if", limit)
    assert (got, found["passed"]) == (code, code == 0)


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["--fail-if", "irradiance.p59 > 1"], "did you mean"),
        (["--fail-if", "light.p95 > 1"], "no channel 'light'"),
        (["--fail-if", "ao.noise_floor > 1"], "no figure 'noise_floor'"),
        (["--fail-if", "nonsense"], "not of the form"),
        (["--texels", "0"], "--texels"),
        (["--no-flip", "--fail-if", "ao.flip > 1"], "--fail-if limits flip, which --no-flip leaves out"),
    ],
)
def test_wrong_use(first, argv, said):
    code, found = told(first, first, *argv)
    assert code == 2
    assert said in found["error"]["message"]


def test_what_is_no_bake(first, tmp_path):
    for pair in ((first, tmp_path), (tmp_path, first)):
        code, found = told(*pair)
        assert code == 3
        assert "holds no bake" in found["error"]["message"]
        assert found["error"]["file"] == str(tmp_path)


def test_a_room_that_was_joined_into_one_object_is_found(first, tmp_path):
    scene = joined(quad_scene([*ROOM, EMITTER]), np.random.default_rng(1).permutation(14))
    settings = make_settings({"resolution": 96, "samples": 64, "ao_distance": "0.7", "denoise": False})
    bake(replace(scene, lights=(BULB,)), settings=settings, out=tmp_path / "joined")
    for pair in ((tmp_path / "joined", first), (first, tmp_path / "joined")):
        code, found = told(*pair, "--no-flip")
        assert code == 0
        assert found["only_in_a"] == found["only_in_b"] == []
        assert found["unmatched"] == 0
        assert abs(found["channels"]["irradiance"]["bias"]) < 0.002
        assert found["channels"]["irradiance"]["nrmse"] < 0.015


def test_an_object_of_one_side_only(first, tmp_path):
    shelf = bake_room(tmp_path / "shelf", SHELF, samples=16, channels=["irradiance"])
    code, found = told(shelf, first, "--no-flip")
    assert code == 0
    assert [entry["node"] for entry in found["only_in_a"]] == [7]
    assert found["only_in_b"] == []
    assert list(found["channels"]) == ["irradiance"]
    # The largest difference is on the floor, in the shadow of the shelf.
    floor = next(entry for entry in found["objects"] if entry["node"] == found["worst"][0]["node"])
    assert floor["channels"]["irradiance"]["max"] > 0.5
    _, found = told(first, shelf, "--no-flip")
    assert [entry["node"] for entry in found["only_in_b"]] == [7]


def test_bakes_of_different_scenes(first, tmp_path):
    quad = Quad((50, 0, 0), (1, 0, 0), (0, 1, 0), grey(0.5))
    scene = quad_scene([quad])
    scene = replace(scene, instances=(replace(scene.instances[0], name="elsewhere"),), lights=(BULB,))
    out = tmp_path / "elsewhere"
    bake(scene, settings=make_settings({"resolution": 16, "samples": 16}), out=out)
    code, found = told(first, out)
    assert code == 3
    assert "no surface in common" in found["error"]["message"]


def test_the_table(first, doubled, capsys):
    stream = StringIO()
    assert run(["diff", str(doubled[0]), str(first), "--no-flip"], out=stream) == 0
    text = stream.getvalue()
    assert "irradiance" in text
    assert f"(node {doubled[1]}): bias +" in text
    assert "worst: irradiance of" in text


def test_a_change_of_hue_at_equal_brightness_is_reported(first, tmp_path):
    out = tmp_path / "out"
    shutil.copytree(first, out)
    pixels = decode_exr(out / "irradiance_0.exr").pixels.copy()
    pixels *= np.float32([1.2, 1.0, 0.8])
    encode_exr(out / "irradiance_0.exr", pixels / pixels.mean() * decode_exr(
        first / "irradiance_0.exr").pixels.mean(), half=True, header={})  # fmt: skip
    manifest = json.loads((out / "bake.json").read_text())
    manifest["lights"][0]["intensity"] = [0.48, 0.4, 0.4]
    (out / "bake.json").write_text(json.dumps(manifest))
    code, found = told(out, first, "--no-flip")
    assert code == 0
    light = found["channels"]["irradiance"]
    assert light["colour_p95"] > 0.1
    assert found["worst"][0]["error"] > 0.1
    stream = StringIO()
    assert run(["diff", str(out), str(first), "--no-flip"], out=stream) == 0
    text = stream.getvalue()
    assert "but in colour by up to" in text
    assert "intensity [0.48, 0.4, 0.4] | " in text
    assert "object: irradiance of" in text
    assert run(["diff", str(first), str(first), "--no-flip"], out=stream) == 0
    assert "A and B are equal at all compared points" in stream.getvalue()
