"""Names with control characters: files keep them, and every command prints them escaped, in one line."""

from __future__ import annotations

import io
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_TRIANGLE, GltfBuilder, write

import baker
from baker.cli.app import run
from baker.core.printable import json_text, printable, printable_lines
from baker.exporters.common import named_scene
from baker.io.bake.read_bake import read_bake
from baker.viewer.scene_data import scene_data

# Line breaks, escape sequences (two ways to begin one), a reversal of the text's direction, and DEL.
ODD = "tab\tnew\nline\x1b[31m\x9b\u202e\u2028\x7f\r\n"
NAMES = [f"{kind} {ODD}стена" for kind in ("floor", "bulb", "copy")]
QUICK = ["--resolution", "64", "--samples", "1", "--bounces", "1", "--no-denoise", "--threads", "1"]


def odd_scene(path: Path, *, candela: float = 10.0) -> Path:
    """Write a floor, a light, and a copy of the floor that is scaled to a line; their names are odd."""
    b = GltfBuilder()
    paint = b.add("materials", {"name": f"paint {ODD}"})
    mesh = b.mesh(b.primitive(QUAD, QUAD_TRIANGLE, material=paint), name=f"mesh {ODD}")
    b.node(mesh=mesh, name=NAMES[0])
    light = {"type": "point", "name": NAMES[1], "intensity": candela}
    b.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    b.node(name=NAMES[1], translation=[0.3, 0.3, 1], extensions={"KHR_lights_punctual": {"light": 0}})
    b.node(mesh=mesh, name=NAMES[2], scale=[0, 1, 1])
    return write(path, b)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return odd_scene(tmp_path_factory.mktemp("odd") / "odd.glb")


@pytest.fixture(scope="module")
def out(scene: Path) -> Path:
    folder = scene.parent / "out"
    assert run(["bake", str(scene), "-o", str(folder), *QUICK], out=io.StringIO()) == 0
    return folder


@pytest.fixture
def told(capsys: pytest.CaptureFixture[str]):
    """Return a function that runs a command, checks its text, and returns exit code and text or JSON."""

    def call(*words: object) -> tuple[int, str]:
        stream = io.StringIO()
        code = run([str(word) for word in words], out=stream)
        out, err = stream.getvalue(), capsys.readouterr().err
        for text in (out, err):
            assert printable_lines(text) == text
            # A line break inside a name would begin a line with the rest of the name.
            assert not re.search(r"^\s*(new|line)\b", text, re.MULTILINE)
        return code, out if "--json" in words else out + err

    return call


def test_the_manifest_keeps_names_and_has_no_control_characters(out: Path) -> None:
    text = (out / "bake.json").read_text("utf-8")
    assert printable_lines(text) == text
    assert "стена" in text
    manifest = json.loads(text)
    assert [row["name"] for row in manifest["instances"]] == [NAMES[0]]
    assert NAMES[1] in [light["name"] for light in manifest["lights"]]
    flat = [w for w in manifest["warnings"] if w["code"] == "flat-instance"]
    assert [w["object"] for w in flat] == [NAMES[2]]


def test_scene_glb_keeps_names(out: Path) -> None:
    data = (out / "scene.glb").read_bytes()
    document = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    assert [node["name"] for node in document["nodes"]] == NAMES
    loaded = baker.load(out / "scene.glb")
    assert loaded.instances[0].name == NAMES[0]
    assert loaded.materials[0].name == f"paint {ODD}"
    assert loaded.lights[0].name == NAMES[1]
    assert repr(loaded).isprintable()


@pytest.mark.parametrize("words", [(), ("-v",), ("--json",)])
def test_commands_about_scenes(told, scene: Path, tmp_path: Path, words: tuple[str, ...]) -> None:
    assert told("bake", scene, "-o", tmp_path / "out", *QUICK, *words)[0] == 0
    assert told("inspect", scene, *words)[0] == 0
    reports = ("--sarif", tmp_path / "s", "--junit", tmp_path / "j")
    code, text = told("check", scene, "--cost", "--fail-on", "warning", *reports, *words)
    assert code == 1
    if words == ("--json",):
        found = {f["object"] for f in json.loads(text)["findings"]}
        assert NAMES[2] in found
    for name in ("s", "j"):
        report = (tmp_path / name).read_text("utf-8")
        assert printable_lines(report) == report
    results = json.loads((tmp_path / "s").read_text("utf-8"))["runs"][0]["results"]
    assert all(result["message"]["text"].isprintable() for result in results)
    assert told("check", scene, "--fix", "-o", tmp_path / "fixed.glb", *words)[0] == 0
    assert told("render", scene, "-o", tmp_path / "p.png", "--camera", "0,0,3,0,0,0,60", "--width", 8,
                "--height", 8, "--spp", 1, *words)[0] == 0  # fmt: skip


@pytest.mark.parametrize("words", [(), ("-v",), ("--json",)])
def test_commands_about_bakes(told, out: Path, tmp_path: Path, words: tuple[str, ...]) -> None:
    assert told("inspect", out, *words)[0] == 0
    reports = ("--report", tmp_path / "r.html", "--junit", tmp_path / "j.xml")
    limit = "irradiance.max >= 0"
    code, text = told("verify", out, "--spp", 1, "--texels", 16, "--fail-if", limit, *reports, *words)
    assert code == 1
    if words == ("--json",):
        assert [row["object"] for row in json.loads(text)["objects"]] == [NAMES[0]]
    for name in ("r.html", "j.xml"):
        report = (tmp_path / name).read_text("utf-8")
        assert printable_lines(report) == report
    assert f"{printable(NAMES[0])}" in (tmp_path / "r.html").read_text("utf-8")
    brighter = odd_scene(tmp_path / "brighter.glb", candela=20.0)
    assert told("bake", brighter, "-o", tmp_path / "b", *QUICK, "-q")[0] == 0
    code, text = told("diff", out, tmp_path / "b", *words)
    assert code == 0
    assert words == ("--json",) or f"lights.point '{printable(NAMES[1])}'" in text


def test_batch(told, scene: Path, tmp_path: Path) -> None:
    shutil.copy(scene, tmp_path / "good.glb")
    document = GltfBuilder()
    document.node(name=ODD, mesh=3)
    write(tmp_path / "bad.gltf", document)
    jobs = tmp_path / "jobs.toml"
    jobs.write_text(
        '[defaults]\nout = "o/{stem}"\nresolution = 64\nsamples = 1\nchannels = ["ao"]\n'
        '[[job]]\nglob = "*.gl*"\n'
    )
    code, _ = told("batch", jobs, "--threads", 1, "--jobs", 1, "--junit", tmp_path / "j")
    assert code == 3
    report = (tmp_path / "j").read_text("utf-8")
    assert printable_lines(report) == report


def test_the_viewer_and_exports(out: Path, tmp_path: Path) -> None:
    header = scene_data(read_bake(out)).header
    assert [row["name"] for row in header["instances"]] == [printable(NAMES[0])]
    assert all(row["name"].isprintable() for row in header["materials"])
    for engine in ("three", "godot", "unity", "unreal", "bevy", "blender"):
        folder = tmp_path / engine
        baker.export(out, engine, folder)
        for path in folder.rglob("*.*"):
            if path.suffix in (".json", ".py", ".rs", ".gd", ".cs", ".js", ".md", ".tres"):
                text = path.read_text("utf-8")
                assert printable_lines(text) == text.replace("\t", " "), path
    assert named_scene(out)[1]["objects"][0]["name"].isprintable()


@pytest.mark.parametrize("command", ["check", "inspect", "bake", "render"])
def test_errors_that_name_an_object(told, tmp_path: Path, command: str) -> None:
    b = GltfBuilder()
    b.node(mesh=b.mesh(b.primitive(QUAD, QUAD_TRIANGLE), name=ODD), name=ODD, scale=[1e30, 1e30, 1e30])
    b.node(name=ODD, camera=7)
    path = write(tmp_path / "a.gltf", b)
    more = {"bake": ("-o", tmp_path / "out"), "render": ("-o", tmp_path / "p.png")}.get(command, ())
    for words in ((), ("--json",)):
        code, text = told(command, path, *more, *words)
        assert code == 3
        assert words or text.count("\n") == 1


def test_names_as_printed_and_as_in_the_file_choose_objects(told, scene: Path, tmp_path: Path) -> None:
    """Objects can be chosen, and findings ignored, by the printed name and by the name in the file."""
    for name in (NAMES[2], printable(NAMES[2])):
        _, text = told("check", scene, "--ignore", f"*@{name}", "--json")
        assert NAMES[2] not in {f["object"] for f in json.loads(text)["findings"]}
        told("bake", scene, "-o", tmp_path / "o", *QUICK, "--exclude", printable(NAMES[1]), "-q")
        assert not [
            row for row in json.loads((tmp_path / "o" / "bake.json").read_text("utf-8"))["lights"]
            if row["kind"] == "point"
        ]  # fmt: skip


def test_objects_and_materials_of_obj(told, tmp_path: Path) -> None:
    odd = "a\x1b[31m\x9b\u202e\x7f"
    (tmp_path / "a.mtl").write_text(f"newmtl {odd}\nKd 0.5 0.5 0.5\n", "utf-8")
    square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
    text = f"mtllib a.mtl\no {odd}\n{square}usemtl {odd}\nf 1 2 3 4\no {odd}2\nf 1 1 1\n"
    (tmp_path / "a.obj").write_text(text, "utf-8")
    loaded = baker.load(tmp_path / "a.obj")
    assert loaded.instances[0].name == odd
    assert odd in [material.name for material in loaded.materials]
    for words in ((), ("-v",), ("--json",)):
        told("check", tmp_path / "a.obj", *words)
        assert told("inspect", tmp_path / "a.obj", *words)[0] == 0
        assert told("bake", tmp_path / "a.obj", "-o", tmp_path / "out", *QUICK, *words)[0] == 0
    rows = json.loads((tmp_path / "out" / "bake.json").read_text("utf-8"))["instances"]
    assert [row["name"] for row in rows] == [odd]


def test_json_text() -> None:
    odd = f"{ODD}\ud800\x00\ufffe\U0001fffe\u200cй"
    for only_ascii in (False, True):
        text = json_text({odd: [odd, 1.5, None]}, indent=2, only_ascii=only_ascii)
        assert printable_lines(text) == text
        assert json.loads(text.encode("utf-8")) == {odd: [odd, 1.5, None]}
        assert text.isascii() == only_ascii
    with pytest.raises(ValueError, match="JSON"):
        json_text(np.inf)
