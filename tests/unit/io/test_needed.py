"""glTF files with one broken member: an error if the bake needs the member, otherwise at most a warning."""

from __future__ import annotations

import base64
import copy
import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import pack_glb, write
from io_scenes import PICTURE, make_atlas, split_layout
from needed_cases import BLOB, DOCUMENT, GONE, REFUSED, SILENT, SPARE_VIEW, WARNED, WHOLE, Document, at

from baker.core.errors import InputError
from baker.io.gltf.dangling import NOWHERE
from baker.io.gltf.write_baked import make_glb
from baker.io.load import load_scene


def changed(tmp_path: Path, change: Callable[[Document], Any]) -> Path:
    """Write the test file after `change`, which edits the document or returns new bytes of the buffer."""
    document = copy.deepcopy(DOCUMENT)
    data = change(document)
    return write(tmp_path / "a.glb", pack_glb(document, data if isinstance(data, bytes) else BLOB))


def written(path: Path) -> Glb:
    """Load a file, write the `scene.glb` of a bake without tracing, and return it.

    Asserts that the data which a bake needs equal those of the unchanged test file.
    """
    scene, whole = load_scene(path), load_scene(write(path.parent / "whole.glb", WHOLE))
    assert np.array_equal(scene.meshes[0].position, whole.meshes[0].position)
    assert np.array_equal(scene.meshes[0].normal, whole.meshes[0].normal)
    assert scene.lights == whole.lights
    a, b = scene.materials[0], whole.materials[0]
    assert (a.base_colour, a.emission, a.alpha_mode) == (b.base_colour, b.emission, b.alpha_mode)
    assert np.array_equal(a.base_colour_texture.image, b.base_colour_texture.image)
    assert np.array_equal(a.emission_texture.transform, b.emission_texture.transform)
    data = make_glb(scene, make_atlas(split_layout(scene, 0)), {0: PICTURE}).data
    again = load_scene(write(path.parent / "out.glb", data))
    assert again.n_triangles == 2
    assert again.meshes[0].texcoord[1] is not None
    return Glb(data)


def kept(before: Any, after: Any) -> None:
    """Assert that the lists of the document `after` keep the elements of `before` at the same indices.

    Only the index 999, which no list has, becomes `NOWHERE`.
    """
    before = json.loads(json.dumps(before).replace(": 999", f": {NOWHERE}"))
    for key in ("skins", "animations", "cameras", "samplers", "textures"):
        assert after.get(key, [])[: len(before.get(key, []))] == before.get(key, [])
    for key in ("nodes", "meshes", "materials", "images"):
        assert len(after.get(key, [])) >= len(before.get(key, []))
    assert after["nodes"] == before["nodes"]
    assert after["meshes"][1] == before["meshes"][1]


@pytest.mark.parametrize("name", sorted(SILENT))
def test_what_no_bake_needs_may_be_broken(tmp_path: Path, name: str) -> None:
    document = copy.deepcopy(DOCUMENT)
    SILENT[name](document)
    path = tmp_path / "a.glb"
    text = json.dumps(document).replace("Infinity", "1e999").encode()
    path.write_bytes(pack_glb(json.loads(text), BLOB) if "1e999" not in text.decode() else _raw(text))
    assert [w for w in load_scene(path).warnings if w.code != "morphed"] == []
    if name != "number beyond doubles in extras":
        kept(document, written(path).json)


def _raw(text: bytes) -> bytes:
    text += b" " * (-len(text) % 4)
    blob = BLOB + b"\0" * (-len(BLOB) % 4)
    size = 12 + 8 + len(text) + 8 + len(blob)
    return (
        struct.pack("<4sII", b"glTF", 2, size)
        + struct.pack("<II", len(text), 0x4E4F534A) + text
        + struct.pack("<II", len(blob), 0x004E4942) + blob
    )  # fmt: skip


@pytest.mark.parametrize("name", sorted(WARNED))
def test_what_is_missing_is_named_and_the_file_bakes(tmp_path: Path, name: str) -> None:
    change, code, words = WARNED[name]
    path = changed(tmp_path, change)
    found = [w for w in load_scene(path).warnings if w.code == code]
    assert any(words in w.message for w in found), found
    assert len({w.code for w in load_scene(path).warnings} - {"morphed"}) == 1
    document = copy.deepcopy(DOCUMENT)
    change(document)
    kept(document, written(path).json)


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_what_a_bake_needs_is_refused_in_one_sentence(tmp_path: Path, name: str) -> None:
    change, words = REFUSED[name]
    with pytest.raises(InputError) as caught:
        load_scene(changed(tmp_path, change))
    text = str(caught.value)
    assert text.startswith(str(tmp_path / "a.glb"))
    assert "\n" not in text
    for word in words:
        assert word in text


def test_missing_files_stay_named_in_the_scene(tmp_path: Path) -> None:
    def change(document: Document) -> None:
        document["images"][1] = {"uri": "maps/gone.png", "name": "bumps"}
        document["buffers"][1] = {"uri": "gone.bin", "byteLength": 4, "name": "far"}

    after = written(changed(tmp_path, change)).json
    assert after["images"][1] == {"uri": "maps/gone.png", "name": "bumps"}
    assert after["buffers"][1:] == [{"uri": "gone.bin", "byteLength": 4, "name": "far"}]
    assert after["bufferViews"][SPARE_VIEW]["buffer"] == 1
    assert after["materials"][0]["normalTexture"] == {"index": 1}


def test_a_missing_file_that_comes_back_changes_the_hash(tmp_path: Path) -> None:
    path = changed(tmp_path, at("images.1", GONE))
    before = load_scene(path).sha256
    (tmp_path / "gone.png").write_bytes(PICTURE)
    assert load_scene(path).sha256 != before


CHUNK = struct.pack("<II", 8, 0x454D4341) + b"whatever"


def container(change: str) -> bytes:
    """Return the unchanged test file as a GLB with a modified header or modified chunks."""
    data = WHOLE.glb()
    size = struct.unpack_from("<I", data, 12)[0]
    text, binary = data[12 : 20 + size], data[20 + size :]
    bodies = {
        "order": binary + text,
        "no binary": text,
        "no json": b"",
        "unknown behind": text + binary + CHUNK,
        "unknown between": text + CHUNK + binary,
        "second binary": text + binary + binary,
        "half a chunk": text + binary[:-8],
        "mark": struct.pack("<II", size + 4, 0x4E4F534A) + b"\xef\xbb\xbf" + text[8:] + b" " + binary,
    }
    body = bodies.get(change, text + binary)
    length = 12 + len(body) + {"too long": 100, "too short": -40}.get(change, 0)
    tail = b"tail" if change == "trailing" else b""
    magic = b"gltf" if change == "magic" else b"glTF"
    return struct.pack("<4sII", magic, 2, length) + body + tail


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("magic", "JSON is broken"),
        ("order", "first chunk of the GLB is not JSON"),
        ("no binary", "neither a uri nor a BIN chunk"),
        ("no json", "cut off"),
        ("half a chunk", "runs past the end"),
        ("too long", "cut off"),
        ("too short", "runs past the end"),
    ],
)
def test_broken_containers(tmp_path: Path, change: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load_scene(write(tmp_path / "a.glb", container(change)))


@pytest.mark.parametrize(
    "change", ["none", "trailing", "mark", "unknown behind", "unknown between", "second binary"]
)
def test_odd_containers_bake(tmp_path: Path, change: str) -> None:
    path = write(tmp_path / "a.glb", container(change))
    written(path)
    out = (tmp_path / "out.glb").read_bytes()
    assert (CHUNK in out) == change.startswith("unknown")
    assert struct.unpack_from("<I", out, 8)[0] == len(out)


@pytest.mark.parametrize(
    ("uri", "file"),
    [
        ("a%20b/c%23.png", "a b/c#.png"),
        ("a b.png", "a b.png"),
        ("50%.png", "50%.png"),
        ("maps\\wood.png", "maps/wood.png"),
        ("maps\\..\\shared\\my%20wood.png", "shared/my wood.png"),
        ("maps/../shared/wood.png", "shared/wood.png"),
        ("./maps/../wood.png", "wood.png"),
        ("%D1%81%D1%82%D0%B5%D0%BD%D0%B0.png", "стена.png"),
        ("стена.png", "стена.png"),
    ],
)
def test_names_of_files(tmp_path: Path, uri: str, file: str) -> None:
    folder = tmp_path / "level"
    (folder / "maps").mkdir(parents=True)
    (folder / file).parent.mkdir(parents=True, exist_ok=True)
    (folder / file).write_bytes(PICTURE)
    path = changed(folder, at("images.0", {"uri": uri}))
    assert "uri" not in written(path).json["images"][0]


@pytest.mark.parametrize(
    "head",
    [
        "data:image/png;base64",
        "data:;base64",
        "DATA:image/png;BASE64",
        "data:application/octet-stream;charset=utf-8;base64",
        "data:application/gltf-buffer;base64",
        "data:what/ever;name=a.png;base64",
    ],
)
@pytest.mark.parametrize("body", ["plain", "no padding", "lines", "url-safe", "percent"])
def test_data_uris(tmp_path: Path, head: str, body: str) -> None:
    text = base64.b64encode(PICTURE).decode()
    text = {
        "plain": text,
        "no padding": text.rstrip("="),
        "lines": "\r\n".join(text[i : i + 60] for i in range(0, len(text), 60)),
        "url-safe": text.replace("+", "-").replace("/", "_"),
        "percent": text.replace("+", "%2B").replace("=", "%3D"),
    }[body]
    after = written(changed(tmp_path, at("images.0", {"uri": f"{head},{text}"})))
    assert after.view(after.json["images"][0]["bufferView"]) == PICTURE
