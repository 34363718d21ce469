"""No output of any command replaces an input or a file of a bake.

The tests find all commands and options in the declarations of the command line. Each option that takes a path
is an output if `OUTPUTS` lists it, and otherwise an input.
"""

from __future__ import annotations

import io
import os
import shutil
from pathlib import Path

import pytest
from gltf_builder import quad_builder, write
from io_scenes import quad_result
from PIL import Image

from baker.cli.app import run
from baker.cli.commands import COMMANDS
from baker.cli.group import make_app
from baker.cli.outputs import OUTPUTS, output_names
from baker.io.bake.write_bake import write_bake

# The arguments of each command, without outputs.
WORDS = {
    "bake": ("level/a.gltf", "--config", "level/a.toml"),
    "ao": ("level/a.gltf", "--config", "level/a.toml"),
    "check": ("level", "--config", "level/a.toml"),
    "batch": ("level/jobs.toml",),
    "verify": ("baked", "--config", "level/a.toml"),
    "diff": ("baked", "baked", "--config", "level/a.toml"),
    "render": ("level/a.gltf", "--lightmap", "baked", "--config", "level/a.toml"),
    "view": ("baked", "--no-browser"),
    "inspect": ("level/a.gltf",),
}
# Settings that name a path to read.
READ = {"rates", "lightmap"}
SCENE = ("level/a.gltf", "level/a.bin", "level/tex/wood.png", "level/unused.bin")
BAKE = ("baked/bake.json", "baked/scene.glb", "baked/irradiance_0.exr", "baked/status_0.png")


def paths_of(command: str) -> list[tuple[str, str]]:
    """Return (name, longest flag) of the options of a command that take a path."""
    made = make_app().get_command(None, command)
    found = []
    for parameter in made.params:
        if "Path" in str(parameter.type_descriptor.annotation):
            flag = max(parameter.opts, key=len)
            found.append((parameter.name, flag if flag.startswith("-") else ""))
    return found


CASES = [
    (command, name, flag)
    for command in COMMANDS
    for name, flag in paths_of(command)
    if flag and name in output_names(command)
]


def test_every_path_of_every_command_is_known() -> None:
    """A new option that takes a path has to be listed here or in `OUTPUTS`."""
    assert set(WORDS) == set(COMMANDS)
    inputs = {
        name for command in COMMANDS for name, flag in paths_of(command) if name not in output_names(command)
    }
    assert inputs == {"config", "scene", "scenes", "a", "b", "jobs_file", "path", "out", "three"}
    assert {name for _, name, _ in CASES} == OUTPUTS
    assert {(command, name) for command, name, _ in CASES} >= {
        ("bake", "out"), ("ao", "out"), ("check", "out"), ("check", "sarif"), ("check", "junit"),
        ("verify", "report"), ("verify", "junit"), ("render", "out"), ("batch", "junit"),
    }  # fmt: skip
    for command in COMMANDS:
        for model in make_app().get_command(None, command).models:
            for name, field in model.model_fields.items():
                assert "Path" not in str(field.annotation) or name in READ, (command, name)


@pytest.fixture(scope="module")
def original(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("protected")
    level = folder / "level"
    (level / "tex").mkdir(parents=True)
    builder = quad_builder()
    builder.json["buffers"] = [
        {"uri": "a.bin", "byteLength": len(builder.blob)},
        {"uri": "unused.bin", "byteLength": 4},
    ]
    (level / "a.bin").write_bytes(builder.blob)
    (level / "unused.bin").write_bytes(b"abcd")
    Image.new("RGB", (1, 1)).save(level / "tex" / "wood.png")
    builder.json["images"] = [{"uri": "tex%2Fwood.png"}]
    write(level / "a.gltf", builder)
    (level / "a.toml").write_text("[bake]\nresolution = 16\n")
    (level / "jobs.toml").write_text('[[job]]\nscene = "a.gltf"\nout = "../baked"\n')
    write_bake(quad_result(folder / "in"), folder / "baked")
    return folder


@pytest.fixture
def place(original: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = shutil.copytree(original, tmp_path / "copy")
    monkeypatch.chdir(folder)
    (folder / "link").symlink_to("level/a.gltf")
    os.link(folder / "level" / "a.bin", folder / "hard")
    return folder


def protected(command: str) -> list[str]:
    """Return the files that a command reads, and the files of a bake."""
    words = WORDS[command]
    found = [word for word in words if Path(word).suffix == ".toml"]
    if words[0].startswith("level"):
        found += [*SCENE, "link", "hard"]
    return [*found, *BAKE]


def content(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


@pytest.mark.parametrize(("command", "name", "flag"), CASES)
def test_no_output_replaces_an_input(
    place: Path, command: str, name: str, flag: str, capsys: pytest.CaptureFixture[str]
) -> None:
    before = content(place)
    more = ["--fix", "--force"] if (command, name) == ("check", "out") else []
    if command in ("bake", "ao", "render") and name != "out":
        more = ["-o", "elsewhere.exr"]
    for file in protected(command):
        code = run([command, *WORDS[command], *more, flag, file], out=io.StringIO())
        told = capsys.readouterr().err
        assert code == 2, (file, told)
        assert content(place) == before, file
        assert told.count("\n") == 1
        assert file in told


def test_outputs_of_one_command_differ(place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = content(place)
    words = ["check", "level", "--sarif", "new.xml", "--junit", "level/../new.xml"]
    assert run(words, out=io.StringIO()) == 2
    assert "--sarif and --junit name the same file" in capsys.readouterr().err
    assert content(place) == before


def test_a_bake_into_the_folder_of_its_input_keeps_the_input(
    place: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = content(place)
    words = ["bake", "baked/scene.glb", "-o", "baked", "--force", "--resolution", "16"]
    assert run(words, out=io.StringIO()) == 2
    assert "replace its own input" in capsys.readouterr().err
    assert content(place) == before


def test_reports_may_be_replaced(place: Path) -> None:
    for _ in range(2):
        words = ["check", "level", "--sarif", "a.sarif", "--junit", "baked/a.xml"]
        assert run(words, out=io.StringIO()) == 0
    assert {"a.sarif", "baked/a.xml"} <= set(content(place))
