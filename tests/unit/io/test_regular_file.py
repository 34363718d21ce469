"""Inputs that are not regular files, are too large or are Git LFS pointers give an error with their name."""

from __future__ import annotations

import io
import json
import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from gltf_builder import GltfBuilder, quad_builder, write

from baker.cli.app import run
from baker.core.errors import InputError
from baker.io.bake.read_manifest import read_manifest
from baker.io.load import load_scene
from baker.io.regular_file import read_regular

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes in the file system")
POINTER = b"version https://git-lfs.github.com/spec/v1\noid sha256:4d7a2146\nsize 12345\n"
KINDS = ["pipe", "device", "socket", "folder", "endless link", "pointer", "link to a pipe"]


def odd_file(path: Path, kind: str) -> Path:
    """Create a file of the kind `kind`, one of `KINDS`, at `path`."""
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "device":
        path.symlink_to("/dev/zero")
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as made:
            made.bind(os.path.relpath(path))
    elif kind == "folder":
        path.mkdir()
    elif kind == "endless link":
        path.symlink_to(path.name)
    elif kind == "link to a pipe":
        os.mkfifo(path.with_name("pipe behind"))
        path.symlink_to("pipe behind")
    else:
        path.write_bytes(POINTER)
    return path


WORDS = {
    "pipe": "is a pipe (FIFO)",
    "link to a pipe": "is a pipe (FIFO)",
    "device": "is a device",
    "socket": "is a socket",
    "folder": "is a folder",
    "endless link": "symbolic links",
    "pointer": "it is a Git LFS pointer; run `git lfs pull`",
}


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("suffix", [".glb", ".obj", ".ply"])
def test_scenes(place: Path, kind: str, suffix: str) -> None:
    path = odd_file(place / f"a{suffix}", kind)
    with pytest.raises(InputError) as caught:
        load_scene(path)
    assert WORDS[kind] in caught.value.message
    assert caught.value.file == str(path)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("what", ["buffer", "image"])
def test_files_of_scenes(place: Path, kind: str, what: str) -> None:
    odd_file(place / "odd", kind)
    if what == "image":
        builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
        builder.add("images", {"uri": "odd"})
        builder.add("textures", {"source": 0})
    else:
        builder = quad_builder()
        builder.json["buffers"] = [{"uri": "odd", "byteLength": len(builder.blob)}]
    with pytest.raises(InputError) as caught:
        load_scene(write(place / "a.gltf", builder), allow_outside=True)
    assert WORDS[kind] in caught.value.message
    assert "'odd'" in caught.value.message
    assert caught.value.object == ("images[0].uri" if what == "image" else "buffers[0].uri")


@pytest.mark.parametrize("kind", KINDS)
def test_material_libraries_and_their_images(place: Path, kind: str) -> None:
    odd_file(place / "odd", kind)
    face = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n"
    (place / "a.obj").write_text("mtllib odd\n" + face)
    found = load_scene(place / "a.obj", allow_outside=True)
    assert "missing-mtl" in {warning.code for warning in found.warnings}
    (place / "a.mtl").write_text("newmtl m\nmap_Kd odd\n")
    (place / "a.obj").write_text("mtllib a.mtl\n" + face)
    with pytest.raises(InputError) as caught:
        load_scene(place / "a.obj", allow_outside=True)
    assert WORDS[kind] in caught.value.message


@pytest.mark.parametrize("kind", KINDS)
def test_settings_jobs_and_manifests(place: Path, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
    odd_file(place / "odd", kind)
    write(place / "a.glb", quad_builder())
    assert run(["check", "a.glb", "--config", "odd"], out=io.StringIO()) == 2
    assert WORDS[kind] in capsys.readouterr().err
    assert run(["batch", "odd"], out=io.StringIO()) in (2, 3)
    assert WORDS[kind] in capsys.readouterr().err
    (place / "bake").mkdir()
    odd_file(place / "bake" / "bake.json", kind)
    with pytest.raises(InputError, match=r"no readable bake\.json"):
        read_manifest(place / "bake")
    assert run(["inspect", "odd"], out=io.StringIO()) == 3


def test_the_null_device_is_a_configuration_without_settings(place: Path) -> None:
    write(place / "a.glb", quad_builder())
    assert run(["inspect", "a.glb"], out=io.StringIO()) == 0
    assert run(["check", "a.glb", "--config", os.devnull], out=io.StringIO()) == 0


def test_a_file_is_measured_before_it_is_read(place: Path) -> None:
    with (place / "big").open("wb") as stream:
        stream.write(b"abcd" * 20)
        stream.truncate(1 << 40)
    with pytest.raises(OSError, match="at most"):
        read_regular(place / "big")
    assert read_regular(place / "big", first=6) == b"abcdab"
    # Only the first `byteLength` bytes of a buffer's file are read.
    builder = quad_builder()
    with (place / "odd").open("wb") as stream:
        stream.write(builder.blob)
        stream.truncate(1 << 40)
    builder.json["buffers"] = [{"uri": "odd", "byteLength": len(builder.blob)}]
    assert load_scene(write(place / "a.gltf", builder)).n_triangles == 2


def with_many(what: str) -> GltfBuilder:
    builder = quad_builder()
    nodes = builder.json["nodes"]
    if what == "rows without data":
        number = builder.add("accessors", {"componentType": 5126, "count": 1 << 26, "type": "VEC3"})
        builder.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = number
    elif what == "nodes":
        nodes += [{} for _ in range(10**5)]
    elif what == "levels":
        nodes += [{"children": [k + 2]} for k in range(10**4)] + [{"mesh": 0}]
    else:
        builder.json["materials"] = [{"name": f"m{k}"} for k in range(2 * 10**4)]
    return builder


@pytest.mark.parametrize("what", ["rows without data", "nodes", "levels", "materials"])
def test_a_small_file_takes_little_memory(place: Path, what: str) -> None:
    path = write(place / "a.glb", with_many(what))
    code = (
        "import re, resource, sys\n"
        "from baker.io.load import load_scene\n"
        "from baker.core.errors import InputError\n"
        "try:\n    load_scene(sys.argv[1])\n    told = ''\n"
        "except InputError as error:\n    told = str(error)\n"
        # `ru_maxrss` of a child counts the memory of the process that started it; `VmHWM` does not.
        "try:\n    peak = int(re.search(r'VmHWM:\\s*(\\d+)', open('/proc/self/status').read())[1])\n"
        "except OSError:\n    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "import json; print(json.dumps([peak, told]))\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, check=True)
    peak, told = json.loads(done.stdout)
    assert peak < 400_000  # peak memory, kilobytes
    assert ("67108864 rows but no data" in told) == (what == "rows without data")
