"""`read_bake` returns what `write_bake` wrote, and refuses damaged folders with the name of the file."""

from __future__ import annotations

import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from io_scenes import quad_result

from baker.core.encoding import ENCODINGS
from baker.core.errors import InputError
from baker.io.bake.read_bake import read_bake
from baker.io.bake.write_bake import write_bake
from baker.io.inspect import inspect_path


@pytest.fixture
def out(tmp_path: Path) -> Path:
    write_bake(quad_result(tmp_path / "in"), tmp_path / "out")
    return tmp_path / "out"


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in")
    manifest = write_bake(result, tmp_path / "out")
    bake = read_bake(tmp_path / "out")
    assert bake.manifest == json.loads(json.dumps(manifest))
    assert bake.warnings == ()
    assert set(bake.maps) == set(result.lightmaps)
    for name, lightmap in result.lightmaps.items():
        np.testing.assert_array_equal(bake.maps[name], lightmap.value.astype(np.float16))
    np.testing.assert_array_equal(bake.status, result.status)
    for stored, written in zip(bake.atlas.layouts, result.atlas.layouts, strict=True):
        assert stored.page == written.page
        np.testing.assert_array_equal(stored.uv[stored.triangle], written.uv[written.triangle])


def test_a_manifest_names_the_folder_too(out: Path) -> None:
    assert read_bake(out / "bake.json").folder == out


def test_a_changed_file_is_read_and_named(out: Path) -> None:
    manifest = json.loads((out / "bake.json").read_text())
    manifest["files"][0]["sha256"] = "0" * 64
    (out / "bake.json").write_text(json.dumps(manifest))
    warnings = read_bake(out).warnings
    assert [(w.code, w.object) for w in warnings] == [("changed-file", manifest["files"][0]["file"])]


def test_a_name_that_no_file_can_have_is_a_missing_file(out: Path) -> None:
    manifest = json.loads((out / "bake.json").read_text())
    name = "x" * 3000
    manifest["files"].append({"file": name, "sha256": "0" * 64})
    (out / "bake.json").write_text(json.dumps(manifest))
    assert [(w.code, w.object) for w in read_bake(out).warnings] == [("missing-file", name)]
    assert {entry["state"] for entry in inspect_path(out)["files"]} == {"as baked", "missing"}
    manifest["pages"][0]["file"] = f"{name}.exr"
    (out / "bake.json").write_text(json.dumps(manifest))
    with pytest.raises(InputError, match="this file of the bake is missing"):
        read_bake(out)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("irradiance_0.exr", None, "missing"),
        ("scene.glb", None, "missing"),
        ("status_0.png", b"no picture", "not a readable PNG"),
        ("bake.json", b"{", "holds no bake"),
    ],
)
def test_a_broken_folder_is_refused_by_file(out: Path, name: str, content: bytes | None, said: str) -> None:
    if content is None:
        (out / name).unlink()
    else:
        (out / name).write_bytes(content)
    with pytest.raises(InputError, match=said):
        read_bake(out)


def test_a_folder_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        read_bake(tmp_path / "nothing")


def png_header(width: int, height: int) -> bytes:
    """Return the first chunk of a PNG with a palette, without its pixels."""
    chunk = b"IHDR" + struct.pack(">IIBBBBB", width, height, 8, 3, 0, 0, 0)
    end = struct.pack(">II", zlib.crc32(chunk), 0) + b"IDAT" + struct.pack(">I", zlib.crc32(b"IDAT"))
    return b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + chunk + end


@pytest.mark.parametrize(
    ("width", "said"),
    [(64, "no palette numbers of 16 x 16"), (30_000, "30000 x 30000 pixels; at most 16384")],
)
def test_the_size_of_status_pages_is_checked_before_they_are_decoded(
    out: Path, monkeypatch: pytest.MonkeyPatch, width: int, said: str
) -> None:
    (out / "status_0.png").write_bytes(png_header(width, width))
    monkeypatch.setattr("PIL.PngImagePlugin.PngImageFile.load", None)
    with pytest.raises(InputError, match=said):
        read_bake(out)


def test_the_size_of_maps_is_checked_before_they_are_decoded(
    out: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    exr = ENCODINGS.require("exr", "encoding")
    pixels = np.zeros((16, 32, 3), np.float32)
    exr.encode(out / "irradiance_0.exr", pixels, options=exr.options_type(), header={})
    monkeypatch.setattr(type(exr), "decode", lambda *_: pytest.fail("decoded"))
    with pytest.raises(InputError, match="the map is 32 x 16, the manifest says 16 x 16"):
        read_bake(out)
