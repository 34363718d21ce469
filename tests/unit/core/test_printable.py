"""Control characters in texts of files are escaped in terminal output and in reports."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
from gltf_builder import quad_builder, write

from baker.cli.app import run
from baker.core.errors import InputError
from baker.core.printable import LONGEST_VALUE, message_line, printable, printable_lines, shortened
from baker.core.scene import SceneWarning
from baker.io.junit import Case, junit_text

ODD = "\x1b[31mred\x07\x9b\u202e\u2028\ud800\x00\x7f\ufffe"


def is_clean(text: str) -> bool:
    """Return whether a text has no control characters except line feeds."""
    return printable_lines(text) == text


def test_printable() -> None:
    assert printable("plain") == "plain"
    assert printable("a\nb\r\nc\td") == "a b c d"
    assert printable("\x1b[31m") == "\\x1b[31m"
    assert printable(ODD).isprintable()
    printable(ODD).encode("utf-8")
    for name in ("стена", "壁", "mur à gauche\u00a0!", "می\u200cخواهم", "👩\u200d🔧"):
        assert printable(name) == name
    assert printable_lines("a\x1b\nb\r") == "a\\x1b\nb "


def test_long_values_are_cut() -> None:
    assert shortened("a" * 80) == "a" * 80
    assert shortened("a" * 10**6) == "a" * 77 + "..."
    long = message_line(f"the scene's object '{'x' * 500}' isn't there, and neither is '{'y' * 80}'")
    assert long == f"the scene's object '{'x' * 77}...' isn't there, and neither is '{'y' * 80}'"
    path = f"'/a/{'b' * 200}' is a file"
    assert message_line(path) == path
    assert LONGEST_VALUE == 80


def test_errors_and_warnings_are_one_clean_line() -> None:
    error = InputError(f"no\n'{ODD}'", file=ODD, object=ODD)
    assert str(error).isprintable()
    assert SceneWarning("code", f"a\n{ODD}").message.isprintable()


def test_junit_is_xml_whatever_the_names(tmp_path: Path) -> None:
    text = junit_text("suite", [Case(ODD, ODD, problem=f"{ODD}\nsecond line", seconds=0.0)])
    found = ElementTree.fromstring(text)
    assert is_clean(text)
    assert found.find(".//failure").text.endswith("second line")  # type: ignore[union-attr]


def odd_scene(folder: Path) -> Path:
    builder = quad_builder(name=f"material {ODD}")
    builder.json["meshes"][0]["name"] = f"mesh {ODD}"
    empty = builder.json["meshes"][0]["primitives"][0]
    builder.json["meshes"].append({"name": f"flat {ODD}", "primitives": [empty]})
    builder.json["nodes"][0]["name"] = f"node\n{ODD}"
    builder.node(mesh=1, name=f"flat\n{ODD}", scale=[0, 1, 1])
    builder.json["images"] = [{"uri": f"{ODD}.png"}]
    builder.json["extensionsUsed"] = [f"EXT_{ODD}"]
    return write(folder / "odd.gltf", builder)


@pytest.mark.parametrize("words", [(), ("-v",), ("--json",)])
def test_commands_print_no_control_characters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: tuple[str, ...]
) -> None:
    path = odd_scene(tmp_path)
    for command in (("inspect", path), ("check", path, "--sarif", tmp_path / "s", "--junit", tmp_path / "j")):
        out = io.StringIO()
        assert run([*map(str, command), *words], out=out) in (0, 1)
        for text in (out.getvalue(), capsys.readouterr().err):
            assert is_clean(text)
            assert "\nnode" not in text
    assert is_clean((tmp_path / "j").read_text("utf-8"))
    ElementTree.parse(tmp_path / "j")
    log = json.loads((tmp_path / "s").read_text("utf-8"))
    assert is_clean("".join(entry["message"]["text"] for entry in log["runs"][0]["results"]))


@pytest.mark.parametrize("member", ["uri", "alphaMode", "type", "extension"])
def test_refusals_print_no_control_characters(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], member: str
) -> None:
    builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    builder.json |= {"images": [{"uri": f"\n{ODD}{'x' * 500}"}], "textures": [{"source": 0}]}
    if member == "alphaMode":
        builder.json["materials"][0]["alphaMode"] = f"\n{ODD}"
    elif member == "type":
        builder.json["accessors"][0]["type"] = f"\n{ODD}"
    elif member == "extension":
        builder.json["extensionsRequired"] = [f"\n{ODD}"]
    path = write(tmp_path / "a.gltf", builder)
    assert run(["check", str(path)], out=io.StringIO()) == 3
    told = capsys.readouterr().err
    assert is_clean(told)
    assert told.count("\n") == 1
    assert len(told) < 400 + len(str(path))


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-8"])
def test_any_encoding_of_the_terminal(tmp_path: Path, encoding: str) -> None:
    builder = quad_builder(name="壁")
    builder.json["nodes"][0]["name"] = "стена"
    path = write(tmp_path / "a.gltf", builder)
    for command in ("inspect", "check"):
        done = subprocess.run(
            [sys.executable, "-m", "baker.cli", command, str(path), "-v"],
            capture_output=True, env={**os.environ, "PYTHONIOENCODING": encoding}, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        shown = "стена" if encoding == "utf-8" else "\\u0441\\u0442\\u0435\\u043d\\u0430"
        assert shown in done.stdout.decode(encoding)
