"""`check_output` decides whether a bake is up to date with scene, settings, versions and its files."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from gltf_builder import quad_builder, write

import baker
from baker.core.settings import make_settings
from baker.io.load import load_scene
from baker.io.scene_hash import scene_sha256
from baker.jobs.up_to_date import check_output

ASSETS = Path(__file__).parents[3] / "assets"
SETTINGS = {"resolution": 16, "samples": 1, "sky": "1,1,1", "denoise": False}


@pytest.fixture(scope="module")
def baked(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fresh")
    scene = write(folder / "a.glb", quad_builder())
    baker.bake(scene, out=folder / "out", **SETTINGS)
    return folder


@pytest.fixture
def copy(baked, tmp_path):
    shutil.copytree(baked, tmp_path / "copy")
    return tmp_path / "copy"


def look(folder, **more):
    settings = make_settings({**SETTINGS, **more})
    return check_output(folder / "out", scene_sha256(folder / "a.glb"), settings)


def test_a_moved_and_touched_bake_is_fresh(copy):
    for path in copy.rglob("*"):
        path.touch()
    found = look(copy)
    assert (found.fresh, found.why) == (True, "nothing changed")
    assert look(copy, threads=1).fresh, "threads change nothing"


def test_a_preset_that_means_the_same_samples_is_fresh(copy):
    assert look(copy, quality="high").fresh


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        ({"resolution": 32}, "resolution 16 -> 32"),
        ({"samples": 2}, "samples 1 -> 2"),
        ({"channels": "ao"}, "channels irradiance,ao -> ao"),
        ({"sky": "1,1,2"}, "sky 1,1,1 -> 1,1,2"),
        ({"bounces": 0}, "bounces none -> 0"),
        ({"seed": 1}, "seed 0 -> 1"),
    ],
)
def test_other_settings_are_named(copy, settings, why):
    found = look(copy, **settings)
    assert not found.fresh
    assert why in found.why


def test_another_scene(copy):
    builder = quad_builder()
    builder.json["extras"] = {"note": "one byte more"}
    write(copy / "a.glb", builder)
    assert look(copy).why == "the scene, or a file that it names, changed"


def test_other_versions_are_named(copy):
    path = copy / "out" / "bake.json"
    manifest = json.loads(path.read_text())
    manifest["versions"]["numba"] = "0.1"
    path.write_text(json.dumps(manifest))
    assert look(copy).why.startswith("numba 0.1 -> ")


@pytest.mark.parametrize("name", ["irradiance_0.exr", "ao_0.exr", "scene.glb", "status_0.png"])
def test_every_file_must_be_whole(copy, name):
    path = copy / "out" / name
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    assert look(copy).why == f"{name} is not as it was baked"
    path.unlink()
    assert look(copy).why == f"{name} is missing"


@pytest.mark.parametrize("text", ["", "{}", "[]", '{"versions": 3}', "null"])
def test_a_broken_manifest(copy, text):
    (copy / "out" / "bake.json").write_text(text)
    assert not look(copy).fresh


def test_a_missing_output_folder(copy):
    shutil.rmtree(copy / "out")
    assert look(copy).why == "not baked yet"


SCENES = ["cornell.glb", *(f"third-party/{n}" for n in ("cornell-original/CornellBox-Original.obj",
          "kenney-platform-grass/platform-grass-large-round.glb", "gazebo/gazebo.obj"))]  # fmt: skip


@pytest.mark.parametrize("name", SCENES)
def test_the_quick_hash_is_that_of_the_importer(name):
    assert scene_sha256(ASSETS / name) == load_scene(ASSETS / name).sha256


def test_the_hash_sees_files_that_are_named(tmp_path):
    def hashes():
        quick = {suffix: scene_sha256(tmp_path / f"s{suffix}") for suffix in (".obj", ".gltf", ".ply")}
        assert quick == {suffix: load_scene(tmp_path / f"s{suffix}").sha256 for suffix in quick}
        return quick

    from numpy import full, uint8

    from baker.io.png import encode_png

    (tmp_path / "t.png").write_bytes(encode_png(full((2, 2, 3), 9, uint8)))
    (tmp_path / "m.mtl").write_text("newmtl m\nmap_Kd t.png\n")
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    (tmp_path / "s.obj").write_text(f"mtllib m.mtl\n{triangle}usemtl m\nf 1 2 3\n")
    (tmp_path / "s.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    builder.add("textures", {"source": builder.add("images", {"uri": "t.png"})})
    write(tmp_path / "s.gltf", builder)
    before = hashes()
    (tmp_path / "t.png").write_bytes(encode_png(full((2, 2, 3), 10, uint8)))
    after = hashes()
    assert {suffix for suffix in before if before[suffix] != after[suffix]} == {".obj", ".gltf"}
    (tmp_path / "m.mtl").write_text("newmtl m\nKd 1 0 0\n")
    assert hashes()[".obj"] != after[".obj"]
