"""Functions that read a manifest refuse a damaged or hostile one with a one-sentence error."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from io_scenes import quad_result

from baker.core.errors import InputError, SettingsError
from baker.core.settings import make_settings
from baker.io.bake.output_folder import OutputFolder, check_out, own_files
from baker.io.bake.read_bake import read_bake
from baker.io.bake.read_manifest import read_manifest
from baker.io.bake.write_bake import write_bake
from baker.io.inspect import inspect_path


@pytest.fixture
def out(tmp_path: Path) -> Path:
    write_bake(quad_result(tmp_path / "in"), tmp_path / "out")
    return tmp_path / "out"


def set_at(manifest: Any, path: tuple[str | int, ...], value: Any) -> None:
    for part in path[:-1]:
        manifest = manifest[part]
    manifest[path[-1]] = value


def damage(out: Path, path: tuple[str | int, ...], value: Any) -> None:
    manifest = json.loads((out / "bake.json").read_text())
    set_at(manifest, path, value)
    (out / "bake.json").write_text(json.dumps(manifest))


def refusal(function: Callable[[Path], object], out: Path) -> str | None:
    """Return the message of the InputError that `function(out)` raises, or None if it raises no error."""
    try:
        function(out)
    except InputError as error:
        return error.message
    return None


def paths_in(value: Any, path: tuple[str | int, ...] = ()) -> list[tuple[str | int, ...]]:
    """Return the path, a tuple of keys and indices, of every value in a manifest."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    return [
        *([path] if path else []),
        *(found for key, part in items for found in paths_in(part, (*path, key))),
    ]


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("instances", 0, "page"), 1),
        (("instances", 0, "page"), -1),
        (("instances", 0, "page"), 1e300),
        (("instances", 0, "page"), "0"),
        (("instances", 0, "page"), 10**40),
        (("instances", 0, "uv_scale"), [1e300, 1.0]),
        (("instances", 0, "uv_offset"), [0.0]),
        (("instances", 0, "density"), "many"),
        (("pages", 0), 1e300),
        (("pages", 0, "page"), 7),
        (("pages", 0, "width"), 8),
        (("pages", 0, "channel"), "../../../etc/passwd"),
        (("pages",), []),
        (("files", 0, "file"), 5),
        (("settings", "include"), 5),
        (("settings", "padding"), None),
        (("versions",), []),
    ],
)
def test_impossible_values_are_refused(out: Path, path: tuple[str | int, ...], value: Any) -> None:
    damage(out, path, value)
    for read in (read_bake, inspect_path):
        with pytest.raises(InputError) as error:
            read(out)
        assert "bake the scene again" in error.value.message or "holds no bake" in error.value.message
        assert len(error.value.message) < 300
        assert "\n" not in error.value.message


def test_any_value_of_any_other_type_is_refused_or_read(out: Path) -> None:
    """With one value of the manifest replaced, readers either succeed or raise an InputError."""
    text = (out / "bake.json").read_text()
    values = [None, -1, 2**70, 1e300, "\x1b[31m", [], {}, [[]], True]
    refused = read = 0
    for number, path in enumerate(paths_in(json.loads(text))):
        for value in (values[number % len(values)], values[(number + 4) % len(values)]):
            manifest = json.loads(text)
            set_at(manifest, path, value)
            (out / "bake.json").write_text(json.dumps(manifest))
            for function in (read_bake, inspect_path):
                message = refusal(function, out)
                assert message is None or message.isprintable()
                refused += message is not None
                read += message is None
    assert min(refused, read) > 50


def test_the_ranges_of_encodings_are_read_back(tmp_path: Path) -> None:
    """The largest value of an encoding, `max` in the manifest, may be as large as the largest float32."""
    result = quad_result(tmp_path / "in")
    settings = make_settings({"encode": ["hdr", "rgbm"]})
    manifest = write_bake(replace(result, settings=settings), tmp_path / "out")
    assert max(e["max"] for page in manifest["pages"] for e in page["encodings"]) > 1e38
    assert read_manifest(tmp_path / "out")["pages"] == manifest["pages"]


def test_a_file_in_place_of_the_folder_is_refused(out: Path) -> None:
    with pytest.raises(InputError, match="this is a file; name the output folder of a bake"):
        read_manifest(out / "scene.glb")


@pytest.mark.parametrize(
    "text", ["[" * 100_000, '{"a":' * 900 + "1" + "}" * 900, "NaN", "[1]", '"bake"', "\x00"]
)
def test_a_text_that_is_no_manifest_is_refused(out: Path, text: str) -> None:
    (out / "bake.json").write_text(text)
    with pytest.raises(InputError, match="holds no bake"):
        read_manifest(out)


@pytest.mark.parametrize(
    "name", ["../victim.txt", "/etc/passwd", "a/../../victim.txt", "C:victim", "link/victim.txt", ""]
)
def test_a_manifest_that_names_a_file_outside_is_not_bakers(out: Path, tmp_path: Path, name: str) -> None:
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    for victim in (tmp_path / "victim.txt", elsewhere / "victim.txt"):
        victim.write_text("mine")
    (out / "link").symlink_to(elsewhere)
    manifest = json.loads((out / "bake.json").read_text())
    manifest["files"].append({"file": name, "sha256": "0" * 64})
    (out / "bake.json").write_text(json.dumps(manifest))
    assert own_files(out) is None
    with pytest.raises(SettingsError, match="did not write"):
        check_out(out)
    # Write with `force`. The working directory is not renamed, so its files are replaced one by one.
    here = Path.cwd()
    os.chdir(out)
    try:
        write_bake(quad_result(tmp_path / "in2"), out, force=True)
    finally:
        os.chdir(here)
    assert (tmp_path / "victim.txt").read_text() == "mine"
    assert (elsewhere / "victim.txt").read_text() == "mine"
    assert own_files(out) is not None


def test_an_output_folder_in_place_keeps_what_it_does_not_know(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "out") as folder:
        (folder.path / "bake.json").write_text("{}")
        folder.commit()
    assert (tmp_path / "out" / "bake.json").read_text() == "{}"
