"""If the input is renamed, only `bake.json` changes, and in it only the path of the input."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

import baker

ASSETS = Path(__file__).parents[3] / "assets"
OBJ = "v 0 0 0\nv 1 0 0\nv 1 0 1\nv 0 0 1\nf 1 4 3 2\n"
OFF = "OFF\n4 2 0\n0 0 0\n1 0 0\n1 0 1\n0 0 1\n3 0 2 1\n3 0 3 2\n"


def bake_as(scene, out):
    exports = ["bevy", "gltf", "godot", "three", "unity", "unreal"]
    baker.bake(scene, out=out, resolution=16, samples=1, denoise=False, sky=(1, 1, 1), export=exports)
    files = {p.relative_to(out).as_posix(): p.read_bytes() for p in out.rglob("*") if p.is_file()}
    manifest = json.loads(files.pop("bake.json"))
    del manifest["input"]["path"], manifest["timings"], manifest["created"]
    return files, manifest


@pytest.mark.parametrize("suffix", [".glb", ".obj", ".off"])
def test_two_names_of_one_scene(tmp_path, suffix):
    first, second = tmp_path / f"first{suffix}", tmp_path / f"the other{suffix}"
    if suffix == ".glb":
        shutil.copy(ASSETS / "cornell.glb", first)
    else:
        first.write_text(OBJ if suffix == ".obj" else OFF)
    shutil.copy(first, second)
    one, two = bake_as(first, tmp_path / "a"), bake_as(second, tmp_path / "b")
    assert [name for name in one[0] if one[0][name] != two[0].get(name)] == []
    assert one == two
