"""The files of each export hold the numbers that its engine expects."""

from __future__ import annotations

import ast
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from export_bake import NAMES, NODES, SIZE, document, result

from baker.channels.channel import make_lightmap
from baker.core.encoding import ENCODINGS
from baker.core.export import EXPORTS
from baker.encodings.exr import decode_exr
from baker.encodings.hdr import HdrEncoding
from baker.exporters.bevy import ev100
from baker.exporters.common import template, unique_name
from baker.exporters.unity import scale_offset
from baker.io.bake.write_bake import write_bake


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bake")
    manifest = write_bake(result(folder / "in", export=NAMES), folder / "out")
    return folder / "out", manifest


def test_playcanvas_pages_hold_lx_and_objects_their_own_meshes(bake):
    out, _ = bake
    found = json.loads((out / "playcanvas" / "lightmap.json").read_text("utf-8"))
    for number, page in enumerate(found["pages"]):
        light = decode_exr(out / f"irradiance_{number}.exr").pixels
        image = HdrEncoding().decode(out / "playcanvas" / page["file"])
        assert np.abs(image.pixels - light).max() <= light.max() / 256
        assert image.header["unit"] == "lx"
    nodes = document(out / "playcanvas" / "scene.glb")["nodes"]
    meshes = [entry["mesh"] for entry in found["objects"]]
    assert meshes == [nodes[entry["node"]]["mesh"] for entry in found["objects"]]
    assert len(set(meshes)) == len(NODES)


def test_unity_pages_hold_what_a_white_surface_sends_out(bake):
    """Unity shows albedo x page without 1 / pi, so a page must store E / pi."""
    for page in range(2):
        light = decode_exr(bake[0] / f"irradiance_{page}.exr").pixels
        image = decode_exr(bake[0] / "unity" / f"irradiance_{page}.exr")
        assert image.pixels == pytest.approx(light / math.pi, rel=2**-10)
        assert image.header["unit"] == "cd/m2"
        assert image.dtype == "half"


def test_unity_scale_and_offset_are_for_v_upwards():
    """With v' = 1 - v in mesh and image, as in Unity, the lookup finds the same texel as in glTF."""
    rng = np.random.default_rng(3)
    for _ in range(100):
        scale, offset, uv = rng.random(2), rng.random(2), rng.random(2)
        su, sv, ou, ov = scale_offset(scale.tolist(), offset.tolist())
        u, v = uv[0] * su + ou, (1.0 - uv[1]) * sv + ov
        assert [u, 1.0 - v] == pytest.approx((uv * scale + offset).tolist())
    assert scale_offset([1.0, 1.0], [0.0, 0.0]) == [1.0, 1.0, 0.0, 0.0]


def test_unity_json_has_the_fields_of_the_script(bake):
    found = json.loads((bake[0] / "unity" / "lightmap.json").read_text("utf-8"))
    source = template("unity", "Editor/BakerLightmapsMenu.cs")
    for kind, entry in (("Page", found["pages"][0]), ("BakedObject", found["objects"][0])):
        body = re.search(rf"class {kind}\s*{{(.*?)}}", source, re.DOTALL).group(1)
        assert set(re.findall(r"public \S+ (\w+) =", body)) == set(entry)


@pytest.mark.parametrize("name", ["unreal", "blender"])
def test_python_scripts_compile(name):
    source = template(name, "import_lightmaps.py")
    tree = ast.parse(source)
    assert "math.pi" in source
    assert ast.get_docstring(tree)


def test_bevy_rectangles_are_offset_and_offset_plus_scale(bake):
    source = (bake[0] / "bevy" / "baker_lightmaps.rs").read_text("utf-8")
    row = r'Baked \{ node: (\d+), name: "(\w+)", page: (\d), min: \[(.*?)\], max: \[(.*?)\] \}'
    rows = re.findall(row, source)
    assert [(int(node), name, int(page)) for node, name, page, _, _ in rows] == [
        (i, unique_name(name, i), i % 2) for i, name in enumerate(NODES)
    ]
    assert {(low, high) for *_, low, high in rows} == {("0.0, 0.0", "1.0, 1.0")}
    assert re.findall(r'^    "(.+)",$', source, re.MULTILINE) == ["irradiance_0.ktx2", "irradiance_1.ktx2"]
    assert "PAGE_SCALE: f32 = 1.0;" in source
    assert "/*" not in source


def test_bevy_pages_hold_the_irradiance(bake):
    for page in range(2):
        light = decode_exr(bake[0] / f"irradiance_{page}.exr").pixels
        path = bake[0] / "bevy" / f"irradiance_{page}.ktx2"
        image = ENCODINGS.require("ktx2", "encoding").decode(path)
        assert (np.abs(image.pixels - light) <= light.max(axis=2, keepdims=True) / 511.5).all()
        assert image.header["unit"] == "lx"


def test_bevy_pages_above_the_limit_of_their_format_are_scaled_down(tmp_path):
    made = result(tmp_path / "in", export=("bevy",), dtype="float")
    light = made.lightmaps["irradiance"].value * 5000.0
    write_bake(replace(made, lightmaps={"irradiance": make_lightmap("irradiance", light)}), tmp_path / "out")
    folder = tmp_path / "out" / "bevy"
    assert light.max() > 2 * 65408.0
    assert "PAGE_SCALE: f32 = 4.0;" in (folder / "baker_lightmaps.rs").read_text("utf-8")
    assert json.loads((folder / "lightmap.json").read_text("utf-8"))["scale"] == 4.0
    assert "E in lx = page x 4;" in (folder / "README.md").read_text("utf-8")
    image = ENCODINGS.require("ktx2", "encoding").decode(folder / "irradiance_0.ktx2")
    assert image.pixels.max() * 4.0 == pytest.approx(light[0].max(), rel=0.002)


def test_bevy_exposure_values():
    """A Bevy camera multiplies by 1 / (1.2 x 2^EV100)."""
    for exposure in (1e-4, 0.0625, 1.0, 30.0):
        assert 2.0 ** -ev100(exposure) / 1.2 == pytest.approx(exposure, rel=1e-3)
    assert ev100(None) == 9.7


def test_godot_images_hold_scaled_pages_one_below_the_other(bake):
    """Godot multiplies a lightmap by the albedo only, so an image holds E / pi x exposure."""
    folder = bake[0] / "godot"
    pages = [decode_exr(bake[0] / f"irradiance_{page}.exr").pixels for page in range(2)]
    image = decode_exr(folder / "lightmap_0.exr")
    assert image.pixels == pytest.approx(np.concatenate(pages) / math.pi * 0.0625, rel=2**-10)
    assert (image.dtype, image.header["exposure"]) == ("half", "0.0625")
    found = json.loads((folder / "lightmap.json").read_text("utf-8"))
    assert found["exposure"] == 0.0625
    assert found["textures"] == [{"file": "lightmap_0.exr", "slices": 2}]
    size = {"width": SIZE, "height": SIZE}
    assert found["pages"] == [{"file": "lightmap_0.exr", **size, "slice": i, "slices": 2} for i in range(2)]
    assert "slices/vertical=2\n" in (folder / "lightmap_0.exr.import").read_text("utf-8")


def test_godot_pages_that_exceed_an_image_go_into_the_next(bake, tmp_path, monkeypatch):
    monkeypatch.setattr("baker.exporters.godot.MAX_ROWS", SIZE)
    EXPORTS.require("godot", "export").write(bake[0], tmp_path)
    whole = decode_exr(bake[0] / "godot" / "lightmap_0.exr").pixels
    for number, half in enumerate(np.split(whole, 2)):
        name = f"lightmap_{number}.exr"
        assert np.array_equal(decode_exr(tmp_path / name).pixels, half)
        assert "slices/vertical=1\n" in (tmp_path / f"{name}.import").read_text("utf-8")
        assert (tmp_path / "godot3" / f"{name}.import").is_file()
    found = json.loads((tmp_path / "lightmap.json").read_text("utf-8"))
    assert [(page["file"], page["slice"]) for page in found["pages"]] == [
        ("lightmap_0.exr", 0),
        ("lightmap_1.exr", 0),
    ]


def test_godot_without_a_suggested_exposure_keeps_the_scale(tmp_path):
    made = replace(result(tmp_path / "in", export=("godot",)), suggested_exposure=None)
    write_bake(made, tmp_path / "out")
    folder = tmp_path / "out" / "godot"
    assert json.loads((folder / "lightmap.json").read_text("utf-8"))["exposure"] == 1.0
    assert "E / pi x 1 (`exposure`)" in (folder / "README.md").read_text("utf-8")


def test_godot_imports_the_scene_with_the_script_beside_it(bake):
    text = (bake[0] / "godot" / "scene.glb.import").read_text("utf-8")
    assert 'import_script/path="import_scene.gd"' in text
    # 2 would replace the second uv set.
    assert "meshes/light_baking=1\n" in text


def test_godot_shaders_decode_no_page(bake):
    """A page has no hint that would make Godot decode it as sRGB."""
    for name in ("fallback/lightmap.gdshader", "godot3/lightmap.shader"):
        source = template("godot", name)
        assert "UV2 * uv_scale + uv_offset" in source
        assert re.search(r"uniform sampler2D(Array)? pages\b", source)
        assert not re.search(r"pages\s*:.*(source_color|hint_albedo)", source)
