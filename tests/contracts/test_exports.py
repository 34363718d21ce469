"""Contract of every export. For engines that the tests cannot run, the formulas of exports are tested."""

from __future__ import annotations

import hashlib
import json
import math
import re
import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from export_bake import NAMES, NODES, SIZE, document, result

from baker.core.errors import SettingsError
from baker.core.export import EXPORTS, check_exports
from baker.encodings.exr import decode_exr
from baker.encodings.hdr import HdrEncoding
from baker.exporters.common import black_lights, unique_name
from baker.io.bake.write_bake import write_bake

# Encoding for web pages -> suffix.
WEB = {"ktx2": "ktx2", "webp": "rgbm.webp"}


@pytest.fixture(scope="module")
def bake(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bake")
    manifest = write_bake(result(folder / "in", export=NAMES), folder / "out")
    return folder / "out", manifest


def test_the_exports_of_the_contract_are_there():
    assert {
        "gltf", "unity", "unreal", "godot", "three", "bevy", "babylon", "blender", "playcanvas", "unlit",
    } <= set(NAMES)  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_a_readme_of_ten_lines_says_scale_uv_and_rows(bake, name):
    text = (bake[0] / name / "README.md").read_text("utf-8")
    assert 6 <= len(text.splitlines()) <= 12
    for key in ("- Scale: ", "- UV set: ", "- Row order: ", "- Exposure: "):
        assert text.count(key) == 1
    assert "by 0.0625 (`suggested_exposure`)" in text
    assert "TEXCOORD_" in text
    assert "v = 0 is the" in text or name == "blender"


@pytest.mark.parametrize("name", [name for name in NAMES if name != "gltf"])
def test_lightmap_json_has_the_suggested_exposure(bake, name):
    assert json.loads((bake[0] / name / "lightmap.json").read_text("utf-8"))["suggested_exposure"] == 0.0625


def test_a_bake_without_irradiance_suggests_no_exposure(tmp_path):
    made = replace(result(tmp_path / "in", export=("gltf",)), suggested_exposure=None)
    write_bake(made, tmp_path / "out")
    assert "Exposure" not in (tmp_path / "out" / "gltf" / "README.md").read_text("utf-8")


@pytest.mark.parametrize("name", NAMES)
def test_every_file_is_in_the_manifest(bake, name):
    out, manifest = bake
    listed = {e["file"]: e["sha256"] for e in manifest["files"] if e["file"].startswith(f"{name}/")}
    found = {p.relative_to(out).as_posix(): p for p in (out / name).rglob("*") if p.is_file()}
    assert set(listed) == set(found)
    for file, path in found.items():
        assert hashlib.sha256(path.read_bytes()).hexdigest() == listed[file]
    assert json.loads((out / "bake.json").read_text("utf-8"))["files"] == manifest["files"]


@pytest.mark.parametrize("name", NAMES)
def test_the_docs_name_every_file(bake, name):
    page = (Path(__file__).parents[2] / "docs" / "engines" / f"{name}.md").read_text("utf-8")
    rows = re.search(r"^\| file in .*?\n\n", page, re.DOTALL | re.MULTILINE).group()
    first = " ".join(row.split("|")[1] for row in rows.splitlines()[2:] if row)
    found = {p.relative_to(bake[0] / name).as_posix() for p in (bake[0] / name).rglob("*") if p.is_file()}
    files = {re.sub(r"(irradiance|lightmap)_\d+", r"\1_N", file) for file in found}
    assert set(re.findall(r"`(.+?)`", first)) == files


def test_the_same_bake_gives_the_same_bytes(bake, tmp_path):
    write_bake(result(tmp_path / "in", export=NAMES), tmp_path / "again")
    for name in NAMES:
        for path in sorted(p for p in (bake[0] / name).rglob("*") if p.is_file()):
            again = tmp_path / "again" / path.relative_to(bake[0])
            assert path.read_bytes() == again.read_bytes(), path.name


def test_a_bake_without_exports_takes_the_old_ones_away(tmp_path):
    write_bake(result(tmp_path / "in", export=["three"]), tmp_path / "out")
    assert (tmp_path / "out" / "three").is_dir()
    write_bake(result(tmp_path / "in"), tmp_path / "out")
    assert not (tmp_path / "out" / "three").exists()


def test_what_cannot_be_exported_is_refused():
    check_exports(("gltf",), ("ao",))
    with pytest.raises(SettingsError, match="known are babylon, bevy"):
        check_exports(("cryengine",), ("irradiance",))
    with pytest.raises(SettingsError, match="needs the channel irradiance; add it to `channels`"):
        check_exports(("three",), ("ao",))


@pytest.mark.parametrize("name", ["three", "babylon"])
def test_web_exports_keep_scene_and_pages(bake, name):
    out, _ = bake
    for file in ("scene.glb", "irradiance_0.exr", "irradiance_1.exr"):
        assert (out / name / file).read_bytes() == (out / file).read_bytes()
    found = json.loads((out / name / "lightmap.json").read_text("utf-8"))
    assert [(o["node"], o["page"]) for o in found["objects"]] == [(i, i % 2) for i in range(len(NODES))]


@pytest.mark.parametrize("name", ["three", "babylon"])
def test_web_exports_have_the_pages_for_the_web(tmp_path, name):
    made = result(tmp_path / "in", export=name, encode="ktx2,hdr,webp")
    manifest = write_bake(made, tmp_path / "out")
    folder = tmp_path / "out" / name
    pages = json.loads((folder / "lightmap.json").read_text("utf-8"))["pages"]
    top = float(made.lightmaps["irradiance"].value.max())
    for number, page in enumerate(pages):
        files = {key: {"file": f"irradiance_{number}.{end}"} for key, end in WEB.items()}
        assert page["encodings"] == {
            "ktx2": {**files["ktx2"], "max": 65408.0},
            "webp": {**files["webp"], "max": top},
        }
        for entry in (page, *page["encodings"].values()):
            assert (folder / entry["file"]).read_bytes() == (tmp_path / "out" / entry["file"]).read_bytes()
    assert not list(folder.glob("*.hdr"))
    assert f"{name}/rgbm.js" in {entry["file"] for entry in manifest["files"]}


@pytest.mark.parametrize("name", ["three", "babylon"])
def test_web_exports_without_webp_pages_need_no_module_for_them(bake, name):
    pages = json.loads((bake[0] / name / "lightmap.json").read_text("utf-8"))["pages"]
    assert [page["encodings"] for page in pages] == [{}, {}]
    assert not (bake[0] / name / "rgbm.js").exists()


def test_moz_lightmap_holds_the_irradiance(bake, tmp_path):
    """Texel x intensity is E in the HDR and the PNG image of a page; each object has its page's texture."""
    from io import BytesIO

    from PIL import Image

    out, _ = bake
    path = out / "gltf" / "lightmaps.glb"
    glb, old = document(path), document(out / "scene.glb")
    lightmaps = [m["extensions"]["MOZ_lightmap"] for m in glb["materials"][len(old["materials"]) :]]
    (intensity,) = {entry["intensity"] for entry in lightmaps}
    assert f"is an irradiance of {intensity:.6g} lx" in (out / "gltf" / "README.md").read_text("utf-8")
    assert {entry["texCoord"] for entry in lightmaps} == {1}
    for number in range(2):
        light = decode_exr(out / f"irradiance_{number}.exr").pixels
        texture = next(t for t in glb["textures"] if t["name"] == f"irradiance_{number}")
        (tmp_path / "page.hdr").write_bytes(
            picture(path, texture["extensions"]["MOZ_texture_rgbe"]["source"])
        )
        exact = HdrEncoding().decode(tmp_path / "page.hdr").pixels * intensity
        assert np.abs(exact - light).max() <= light.max() / 256
        # The PNG is clipped at `intensity`; at most 2 % of the texels are brighter.
        levels = np.asarray(Image.open(BytesIO(picture(path, texture["source"])))) / 255.0 * intensity
        assert np.abs(levels - np.minimum(light, intensity)).max() <= 0.51 / 255 * intensity
        assert (light.max(axis=-1) > intensity).mean() <= 0.02
    for index, node in enumerate(glb["nodes"]):
        (primitive,) = glb["meshes"][node["mesh"]]["primitives"]
        material = glb["materials"][primitive["material"]]
        texture = material["extensions"]["MOZ_lightmap"]["index"]
        assert glb["textures"][texture]["name"] == f"irradiance_{index % 2}"
        assert material["pbrMetallicRoughness"]["metallicFactor"] == 0.0
        assert "occlusionTexture" not in material


def picture(path, image):
    """Return the bytes of an image of a GLB."""
    data, glb = path.read_bytes(), document(path)
    (length,) = struct.unpack_from("<I", data, 12)
    view = glb["bufferViews"][glb["images"][image]["bufferView"]]
    start = 28 + length + view["byteOffset"]
    return data[start : start + view["byteLength"]]


def test_moz_lightmap_keeps_unlit_materials_and_makes_lights_black():
    """A material on two pages is copied for each page; a primitive without a material gets one."""
    from baker.exporters.moz_lightmap import _add_lightmaps

    glb = {
        "materials": [{"name": "a"}, {"extensions": {"KHR_materials_unlit": {}}}],
        "meshes": [
            {"primitives": [{"material": 0}, {}]},
            {"primitives": [{"material": 0}, {"material": 1}]},
            {"primitives": [{"material": 0}]},
        ],
        "extensions": {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 5.0}]}},
    }
    _add_lightmaps(glb, {0: 7, 1: 8}, 2.0)
    black_lights(glb)
    used = [[p["material"] for p in mesh["primitives"]] for mesh in glb["meshes"]]
    assert used == [[2, 3], [4, 1], [0]]
    textures = [m.get("extensions", {}).get("MOZ_lightmap", {}).get("index") for m in glb["materials"]]
    assert textures == [None, None, 7, 7, 8]
    assert glb["extensions"]["KHR_lights_punctual"]["lights"] == [{"type": "point", "intensity": 0.0}]


@pytest.mark.parametrize("name", ["blender", "godot", "unity", "unreal", "bevy"])
def test_engines_that_go_by_names_get_a_name_for_each_node(bake, name):
    out, _ = bake
    new, old = document(out / name / "scene.glb"), document(out / "scene.glb")
    names = [node["name"] for node in new["nodes"]]
    assert len(set(names)) == len(names)
    for index, node in enumerate(new["nodes"]):
        # Names have only letters, digits and underscores. Therefore importers change no name and find no hint
        # such as -col. Names have at most 63 bytes, the limit of Blender.
        assert re.fullmatch(r"\w{1,63}", node["name"], re.ASCII)
        assert node["name"].endswith(f"_n{index}")
        assert node["extras"]["baker_node"] == index
        assert new["meshes"][node["mesh"]]["name"] == node["name"]
    found = json.loads((out / name / "lightmap.json").read_text("utf-8"))["objects"]
    assert [entry["name"] for entry in found] == names
    if name in ("godot", "unity"):
        # These engines would multiply the lightmap by the occlusion texture, and the pages contain occlusion.
        for material in old["materials"]:
            del material["occlusionTexture"]
    if name == "unreal":
        # The script makes the materials, from lightmap.json.
        assert new["materials"] == [{"name": f"material_m{index}"} for index in range(len(NODES))]
        old["materials"] = new["materials"]
    for key in ("accessors", "bufferViews", "materials"):
        assert new[key] == old[key]


def test_a_name_in_an_engine():
    assert unique_name("a.b c", 3) == "a_b_c_n3"
    assert unique_name("", 0) == "node_n0"
    assert unique_name("...", 1) == "node_n1"


def test_unlit_holds_light_times_albedo(bake, tmp_path):
    """A texture with the sRGB codes of albedo x E / pi x exposure is on TEXCOORD_0, the only uv set."""
    from io import BytesIO

    from PIL import Image

    out, _ = bake
    path = out / "unlit" / "scene.glb"
    data, glb = path.read_bytes(), document(path)
    (length,) = struct.unpack_from("<I", data, 12)
    exposure = json.loads((out / "unlit" / "lightmap.json").read_text("utf-8"))["exposure"]
    assert glb["asset"]["extras"]["baker"]["exposure"] == exposure
    assert glb["extensionsUsed"] == ["KHR_materials_unlit"]
    for primitive in (p for mesh in glb["meshes"] for p in mesh["primitives"]):
        assert "TEXCOORD_0" in primitive["attributes"]
        assert "TEXCOORD_1" not in primitive["attributes"]
        assert "KHR_materials_unlit" in glb["materials"][primitive["material"]]["extensions"]
    pages = [glb["meshes"][node["mesh"]]["primitives"][0]["material"] for node in glb["nodes"]]
    textures = [m["pbrMetallicRoughness"]["baseColorTexture"]["index"] for m in glb["materials"]]
    assert [textures[material] for material in pages] == [i % 2 for i in range(len(NODES))]
    clipped = 0
    for page in range(2):
        view = glb["bufferViews"][glb["images"][page]["bufferView"]]
        start = 28 + length + view["byteOffset"]
        stored = np.asarray(Image.open(BytesIO(data[start : start + view["byteLength"]]))) / 255.0
        assert stored.shape == (SIZE, SIZE, 3)
        stored = stored[:, :12]
        light = decode_exr(out / f"irradiance_{page}.exr").pixels[:, :12].astype(np.float64)
        linear = np.array([0.8, 0.5, 0.25]) * light / math.pi * exposure
        curve = np.where(linear > 0.0031308, 1.055 * linear ** (1 / 2.4) - 0.055, 12.92 * linear)
        assert np.abs(stored - np.minimum(curve, 1.0)).max() <= 0.5 / 255 + 1e-6
        clipped += int((linear.max(axis=2) > 1.0).sum())
    assert clipped <= 0.01 * 2 * SIZE * 12 + 1


@pytest.mark.parametrize("name", ["three", "godot"])
def test_lights_that_loaders_do_not_know_are_replaced(name, tmp_path):
    bake = result(tmp_path)
    out = tmp_path / "out"
    write_bake(bake, out)
    text = (out / "scene.glb").read_bytes()
    (length,) = struct.unpack_from("<I", text, 12)
    document, rest = json.loads(text[20 : 20 + length]), text[20 + length :]
    lights = [{"type": "wallwash", "name": "wash", "spread": 2.0}, {"type": "spot", "intensity": 3.0}]
    document["extensions"] = {"KHR_lights_punctual": {"lights": lights}}
    changed = json.dumps(document).encode()
    changed += b" " * (-len(changed) % 4)
    head = struct.pack("<IIIII", 0x46546C67, 2, 20 + len(changed) + len(rest), len(changed), 0x4E4F534A)
    (out / "scene.glb").write_bytes(head + changed + rest)
    (out / name).mkdir()
    EXPORTS.require(name, "export").write(out, out / name)
    data = (out / name / "scene.glb").read_bytes()
    (length,) = struct.unpack_from("<I", data, 12)
    written = json.loads(data[20 : 20 + length])["extensions"]["KHR_lights_punctual"]["lights"]
    assert written == [{"name": "wash", "type": "point", "intensity": 0.0}, lights[1]]
    assert (out / "scene.glb").read_bytes() == head + changed + rest
