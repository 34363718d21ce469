"""The scripts for Unity are compiled and run against a stand-in for Unity's classes (`unity/Unity.cs`)."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from browser import need_program
from engine_scenes import MIDDLE, QUADRANT, SIZE

from baker.encodings.exr import decode_exr
from baker.exporters.unity import PACKAGE

pytestmark = pytest.mark.engines

HERE = Path(__file__).parent / "unity"


def compile_(target, *sources, references=()):
    """Compile C# and return the compiler's errors, or None if there are none. Warnings count as errors."""
    kind = "exe" if target.suffix == ".exe" else "library"
    command = [need_program("mcs", "mono-mcs"), "-warnaserror", f"-target:{kind}", f"-out:{target}"]
    command += [f"-r:{name}" for name in references] + list(map(str, sources))
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=target.parent)
    return done.stdout + done.stderr if done.returncode else None


@pytest.fixture(scope="module")
def package(probe):
    return probe / "unity" / PACKAGE


@pytest.fixture(scope="module")
def built(package, tmp_path_factory):
    """Return a folder with the assemblies that the two assembly definitions describe, and Use.exe."""
    folder = tmp_path_factory.mktemp("built")
    assert compile_(folder / "Unity.dll", HERE / "Unity.cs") is None
    made = ["Unity.dll"]
    for part in ("Runtime", "Editor"):
        (path,) = (package / part).glob("*.asmdef")
        definition = json.loads(path.read_text("utf-8"))
        assert path.name == definition["name"] + ".asmdef"
        assert definition.get("includePlatforms", []) == (["Editor"] if part == "Editor" else [])
        references = ["Unity.dll", *(f"{name}.dll" for name in definition.get("references", []))]
        made.append(definition["name"] + ".dll")
        assert compile_(folder / made[-1], *(package / part).glob("*.cs"), references=references) is None
    assert compile_(folder / "Use.exe", HERE / "Use.cs", references=made) is None
    return folder


def test_scripts_do_not_use_unitys_editor_at_run_time(built, package):
    """Without `includePlatforms`, games would contain the menu, and their build would fail."""
    for script in (package / "Runtime").glob("*.cs"):
        assert "UnityEditor" not in script.read_text("utf-8")


def test_a_second_level_compiles(probe, package, built, tmp_path):
    """Unity ignores folders whose names end with ~. In other folders, the scripts of two levels clash."""
    scripts = [p for p in (probe / "unity").rglob("*") if p.suffix in (".cs", ".asmdef")]
    assert scripts
    assert {p.relative_to(probe / "unity").parts[0][-1] for p in scripts} == {"~"}
    script = package / "Runtime" / "BakerLightmaps.cs"
    twice = [shutil.copy(script, tmp_path / f"{level}.cs") for level in "ab"]
    errors = compile_(built / "twice.dll", *twice, references=["Unity.dll"])
    assert "already contains a definition" in errors


def use(built, probe, tmp_path, change=lambda description: None):
    """Return what `Use.cs` prints for two levels: {title: the blocks with this title, as lists of lines}."""
    levels = [tmp_path / "first", tmp_path / "second"]
    for number, level in enumerate(levels):
        level.mkdir()
        description = json.loads((probe / "unity" / "lightmap.json").read_text("utf-8"))
        # The first object of the second level has the right lower quarter of its page, v upwards.
        if number == 1:
            description["objects"][0]["scaleOffset"] = [0.5, 0.5, 0.5, 0.0]
        change(description)
        (level / "lightmap.json").write_text(json.dumps(description), "utf-8")
    command = [need_program("mono", "mono-runtime"), "--debug", built / "Use.exe", *levels]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    found = {}
    for block in done.stdout.split("# ")[1:]:
        title, *lines = block.splitlines()
        found.setdefault(title, []).append(lines)
    return found


WHOLE = "1 1 0 0"


def test_the_menu_assigns_pages(built, probe, tmp_path):
    found = use(built, probe, tmp_path)
    assert found["nothing from a bake"][0][0].startswith("dialog: Select the imported scene.glb")
    first, again = found["first level"]
    # Number 0 is a lightmap that Unity baked. It stays.
    assigned = [
        "lightmaps 3",
        "empty_n0 0 0 0 0 0",
        f"wall_north_side_n1 1 {WHOLE}",
        f"first 2 {WHOLE}",
        f"second 2 {WHOLE}",
    ]
    assert first[0] == "log: Baker: 2 of 2 objects have their lightmap. Lights disabled: 1."
    assert first[1].startswith("warning: Baker: Unity may remove the shaders")
    assert first[2:] == assigned
    # The second time nothing changes. Only the user's choice changes the setting of the project.
    assert again[0] == "log: Baker: 2 of 2 objects have their lightmap. Lights disabled: 0."
    assert again[2:7] == assigned
    assert again[7] == "keep 0"
    assert again[9] == "keep 1"
    assert found["first level again"] == [[again[0], *assigned]]


def test_a_second_level_keeps_the_first(built, probe, tmp_path):
    (lines,) = use(built, probe, tmp_path)["second level with a lost page"]
    assert lines[0].startswith("error: Baker: there is no page ")
    assert lines[2:] == [
        "lightmaps 4",
        "empty_n0 0 0 0 0 0",
        "wall_north_side_n1 3 0.5 0.5 0.5 0",
        f"first -1 {WHOLE}",
        f"second -1 {WHOLE}",
    ]


def test_objects_that_are_not_found_are_named(built, probe, tmp_path):
    def rename(description):
        description["objects"][0]["name"] = "gone_n1"

    lines = use(built, probe, tmp_path, rename)["first level"][0]
    assert lines[0].startswith("log: Baker: 1 of 2 objects")
    assert lines[1] == "warning: Baker: no renderer is named gone_n1."


def test_import_settings(built, probe, tmp_path):
    """The first import sets the format BC6H. Later, it keeps the user's settings, except a size too small."""
    *settings, direction = use(built, probe, tmp_path)["settings"][0]
    assert settings == [
        f"Lightmap Uncompressed False Clamp None {SIZE} 2",
        f"Lightmap CompressedHQ False Clamp None {SIZE} 1",
        f"Lightmap CompressedHQ False Clamp None {SIZE} 1",
    ]
    d = np.array(direction.split()[1:], float)
    # Unity multiplies directional lightmaps by this factor, for every normal.
    for normal in np.eye(3):
        assert (normal @ (d[:3] - 0.5) + 0.5) / d[3] == 1.0


def test_builds_without_lightmap_shaders_are_reported(built, probe, tmp_path):
    (lines,) = use(built, probe, tmp_path)["build"]
    assert lines[0] == "then"
    assert lines[1].startswith("warning: Baker: Unity may remove the shaders")
    assert len(lines) == 2


def looked_up(probe, objects, uv):
    """Return what Unity reads from the probe's first page, stored bottom-up, at `uv2` = (u, 1 - v)."""
    image = decode_exr(probe / "unity" / "irradiance_0.exr").pixels[::-1]
    su, sv, ou, ov = objects[0]["scaleOffset"]
    u, v = uv[:, 1] * su + ou, (1.0 - uv[:, 0]) * sv + ov
    return image[(v * SIZE).astype(int), (u * SIZE).astype(int), 0]


def test_probe_is_right_and_wrong_exports_are_seen(probe):
    """White surfaces have the radiance E / pi in the correct quadrants; v downwards gives other values."""
    objects = json.loads((probe / "unity" / "lightmap.json").read_text("utf-8"))["objects"]
    uv, expected = np.array(MIDDLE), QUADRANT.ravel()
    assert looked_up(probe, objects, uv) == pytest.approx(expected, rel=1e-3)
    light = decode_exr(probe / "irradiance_0.exr").pixels
    assert light.max() == pytest.approx(math.pi * expected.max(), rel=1e-3)
    wrong = [{**objects[0], "scaleOffset": [1.0, -1.0, 0.0, 1.0]}]
    assert looked_up(probe, wrong, uv) != pytest.approx(expected, rel=0.01)
