"""The command line: flags made from settings, configuration files, exit codes and JSON."""

from __future__ import annotations

import errno
import importlib
import io
import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from typing import get_args

import pytest

import baker
from baker.cli.app import run
from baker.cli.commands import COMMANDS
from baker.cli.fields import group_of
from baker.cli.flags import FlagStream, dashed
from baker.cli.report import write_summary
from baker.core.encoding import encoding_options
from baker.core.errors import Cancelled, InputError, SettingsError
from baker.core.settings import BakeSettings
from baker.io.bake.lock import OutputLock

MANIFEST = {
    "version": 1,
    "pages": [{"channel": "ao", "page": 0, "file": "ao_0.exr"}],
    "statistics": {"ao": {"min": 0.0, "max": 1.0, "mean": 0.5}},
    "timings": {"load": 0.25, "gather": 1.5},
    "rays": {"gather": 1000},
    "warnings": [{"code": "bad-triangles", "message": "2 triangles have no area", "object": "crate"}],
    "settings": {},
}


class FakePipeline:
    """Replaces `baker.pipeline.bake`: records its arguments, then returns a result or raises an error."""

    def __init__(self):
        self.calls = []
        self.error = None

    def bake(self, scene, *, out, settings, progress, force):
        self.calls.append(SimpleNamespace(scene=scene, out=out, settings=settings, force=force))
        progress("gather", 0.5, "23.1 Mrays/s")
        if self.error is not None:
            raise self.error
        out.mkdir(parents=True, exist_ok=True)
        (out / "ao_0.exr").write_bytes(b"x" * 2048)
        return SimpleNamespace(manifest=MANIFEST, out=out)


@pytest.fixture
def pipeline(monkeypatch):
    fake = FakePipeline()
    monkeypatch.setitem(sys.modules, "baker.pipeline.bake", fake)
    return fake


@pytest.fixture
def command(tmp_path):
    def call(*argv):
        out = io.StringIO()
        return run([str(word) for word in argv], out=out), out.getvalue()

    return call


def bake_words(tmp_path, *more):
    return ("bake", "scene.glb", "-o", tmp_path / "out", *more)


def other_option(model, name):
    """Return (argument of the flag, resulting value) for an option of an encoding.

    Several candidates are tried. The first that is accepted and differs from the default is returned. The
    argument is None for a bool.
    """
    field = model.model_fields[name]
    if field.annotation is bool:
        return None, not field.default
    for value in (*get_args(field.annotation), 8, 0.5, 1, "8"):
        try:
            made = getattr(model.make({name: value}), name)
        except SettingsError:
            continue
        if made != field.default:
            return str(value), made
    raise AssertionError(f"no known value is accepted by {name}")


# {setting: (argument of its flag, expected value)}, with a value other than the default for each setting. The
# argument is None if the flag takes none. A test below fails if a setting is missing. `other_option` adds the
# options of encodings, so a new encoding needs no line here.
OTHER = {
    "allow_outside": (None, True),
    "channels": ("ao", ("ao",)),
    "resolution": ("256", 256),
    "density": ("32.5", 32.5),
    "max_pages": ("3", 3),
    "budget": ("3x256", "3x256"),
    "padding": ("2", 2),
    "uv": ("keep", "keep"),
    "instances": ("unique", "unique"),
    "unwrapper": ("xatlas", "xatlas"),
    "quality": ("high", "high"),
    "samples": ("10", 10),
    "light_samples": ("11", 11),
    "ao_samples": ("12", 12),
    "ao_distance": ("0.5", "0.5"),
    "sky": ("1,2,3", "1,2,3"),
    "sky_strength": ("2", 2.0),
    "bounces": ("0", 0),
    "denoise": (None, False),
    "encode": ("hdr,png16", ("hdr", "png16")),
    "export": ("three,unity", ("three", "unity")),
    "include": ("Wall*,House/*", ("Wall*", "House/*")),
    "exclude": ("UCX_*", ("UCX_*",)),
    "object": ("UCX_* cast=false", ("UCX_* cast=false",)),
    "name_rules": (None, False),
    "up": ("z", "z"),
    "scale": ("0.01", 0.01),
    "scene_name": ("1", "1"),
    "variant": ("red", "red"),
    "animation": ("walk", "walk"),
    "time": ("1.5", 1.5),
    "missing_textures": ("grey", "grey"),
    "split": ("none", "none"),
    "unlit": ("lit", "lit"),
    "seed": ("7", 7),
    "threads": ("1", 1),
} | {name: other_option(model, name) for model in encoding_options().values() for name in model.model_fields}


def test_every_setting_has_a_flag_that_arrives(pipeline, command, tmp_path):
    assert set(OTHER) == set(BakeSettings.model_fields)
    words = []
    for name, (text, value) in OTHER.items():
        switch = f"--{dashed(name)}" if value else f"--no-{dashed(name)}"
        words += [switch] if text is None else [f"--{dashed(name)}", text]
    code, _ = command(*bake_words(tmp_path, *words, "-q"))
    assert code == 0
    settings = pipeline.calls[0].settings
    assert {name: getattr(settings, name) for name in OTHER} == {
        name: value for name, (_, value) in OTHER.items()
    }


def test_no_flags_means_the_defaults(pipeline, command, tmp_path):
    assert command(*bake_words(tmp_path))[0] == 0
    assert pipeline.calls[0].settings == BakeSettings()
    assert pipeline.calls[0].force is False


def test_ao_is_bake_with_one_channel(pipeline, command, tmp_path):
    assert command("ao", "s.obj", "-o", tmp_path / "out", "--ao-distance", "2", "--force")[0] == 0
    call = pipeline.calls[0]
    assert call.settings == BakeSettings(channels=("ao",), ao_distance="2")
    assert (call.force, str(call.scene)) == (True, "s.obj")


@pytest.mark.parametrize("head", ["", "[bake]\n"])
def test_command_line_wins_over_config(head, pipeline, command, tmp_path):
    config = tmp_path / "bake.toml"
    config.write_text(
        head
        + 'scene = "night"\nresolution = 128\nao-distance = 0.25\nchannels = ["ao"]\n'
        + "denoise = false\nsky = [1, 0.5, 0]\n"
    )
    code, _ = command(*bake_words(tmp_path, "--config", config, "--resolution", "64", "--denoise"))
    assert code == 0
    expected = BakeSettings(
        resolution=64, ao_distance="0.25", channels=("ao",), denoise=True, sky="1,0.5,0", scene_name="night"
    )
    assert pipeline.calls[0].settings == expected


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("resolutoin = 128", ["resolutoin", "did you mean 'resolution'"]),
        ("resolution = 128\nseed = = 2", ["not valid TOML", "line 2"]),
        ("resolution = ", ["not valid TOML"]),
        ("resolution = 3", ["resolution", "16"]),
        ("x = 1\n[bake]\nseed = 1", ["'x' stands outside [bake]"]),
        ("[bake]\nseed = 1\n[veryfy]\nx = 1", ["no table 'veryfy'; did you mean 'verify'"]),
        ("[other]\nx = 1", ["no table 'other'; known are bake, check"]),
        ("sky = {a = 1}", ["'sky' should be a valid string"]),
        ("bake = 3", ["table"]),
        ("ao-distance = 1\nao_distance = 2", ["twice"]),
    ],
)
def test_bad_config_is_one_sentence_naming_the_file(text, words, pipeline, command, tmp_path, capsys):
    config = tmp_path / "bake.toml"
    config.write_text(text)
    code, out = command(*bake_words(tmp_path, "--config", config, "--json"))
    assert code == 2
    assert pipeline.calls == []
    error = json.loads(out)["error"]
    assert error["file"] == str(config)
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert all(word in line for word in words), line


@pytest.mark.parametrize("name", ["verify", "diff", "render", "check"])
def test_a_misspelt_table_is_wrong_use_of_every_command(name, command, tmp_path, capsys):
    config = tmp_path / "bake.toml"
    config.write_text(f"[{name}s]\ntexels = 3")
    words = {"diff": ["a", "b"], "render": ["a.glb", "-o", "a.exr"]}.get(name, ["a"])
    assert command(name, *words, "--config", config)[0] == 2
    assert f"no table '{name}s'; did you mean '{name}'?" in capsys.readouterr().err


def test_missing_config_is_wrong_use(command, tmp_path, capsys):
    assert command(*bake_words(tmp_path, "--config", tmp_path / "none.toml"))[0] == 2
    assert "none.toml" in capsys.readouterr().err


WRONG = [
    ((), "Missing argument"),
    (("a.glb",), "Missing option"),
    (("a.glb", "-o", "x", "--resolutio", "3"), "--resolution"),
    (("a.glb", "-o", "x", "--resolution", "big"), "resolution"),
    (("a.glb", "-o", "x", "--resolution", "3"), "16"),
    (("a.glb", "-o", "x", "--sky", "1,2"), "sky"),
    (("a.glb", "-o", "x", "--ao-distance", "-1"), "--ao-distance"),
    (("a.glb", "-o", "x", "--channels", ","), "channels"),
    (("a.glb", "b.glb", "-o", "x"), "b.glb"),
    (("a.glb", "-o", ""), "-o is empty"),
    (("a.glb", "--out=", "-q"), "--out is empty"),
    (("", "-o", "x"), "an argument is empty"),
    (("a.glb", "-o", "x", "--config", ""), "--config is empty"),
]


@pytest.mark.parametrize(("words", "expected"), WRONG)
def test_wrong_use_is_exit_2_with_one_sentence(words, expected, pipeline, command, capsys):
    assert command("bake", *words) == (2, "")
    plain = capsys.readouterr().err
    assert plain.startswith("baker: ")
    assert plain.count("\n") == 1
    assert expected in plain
    code, out = command("bake", *words, "--json")
    assert code == 2
    assert set(json.loads(out)["error"]) == {"kind", "message", "file", "object"}
    assert json.loads(out)["error"]["kind"] == "settings"
    assert pipeline.calls == []


def test_unknown_command_names_the_nearest(command, capsys):
    assert command("bkae")[0] == 2
    assert "'bake'" in capsys.readouterr().err


FAILURES = [
    (InputError("the file ends early", file="a.glb", object="mesh 3"), 3, "input"),
    (MemoryError(), 4, "resource"),
    (OSError(errno.ENOSPC, "No space left on device", "out/x.exr"), 4, "resource"),
    (PermissionError(errno.EACCES, "Permission denied", "out"), 4, "resource"),
    (Cancelled("the work was cancelled"), 130, "cancelled"),
    (KeyboardInterrupt(), 130, "cancelled"),
    (ZeroDivisionError("float division\nby zero"), 4, "internal"),
]


@pytest.mark.parametrize(("error", "code", "kind"), FAILURES, ids=lambda v: type(v).__name__)
def test_failures_have_their_exit_code_and_no_traceback(
    error, code, kind, pipeline, command, tmp_path, capsys
):
    pipeline.error = error
    assert command(*bake_words(tmp_path)) == (code, "")
    err = capsys.readouterr().err
    assert err.startswith("baker: ")
    assert err.count("\n") == 1
    got, out = command(*bake_words(tmp_path, "--json", "-vv"))
    assert got == code
    body = json.loads(out)["error"]
    assert body["kind"] == kind
    assert body["file"] == getattr(error, "file", getattr(error, "filename", None))
    assert "Traceback" in capsys.readouterr().err


def test_json_is_one_object_with_the_promised_keys(pipeline, command, tmp_path, capsys):
    code, out = command(*bake_words(tmp_path, "--json"))
    assert code == 0
    value = json.loads(out)
    keys = ("pages", "statistics", "timings", "rays", "warnings")
    assert value == {"out": str(tmp_path / "out"), **{key: MANIFEST[key] for key in keys}}
    assert "ao_0.exr" in capsys.readouterr().err


def test_summary_tells_files_seconds_and_warnings(pipeline, command, tmp_path):
    _, out = command(*bake_words(tmp_path))
    for part in ("ao_0.exr", "2.0 kB", "1.75 s", "gather 1.50", "crate: 2 triangles have no area"):
        assert part in out


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_summary_names_exports_and_the_next_commands(pipeline, command, tmp_path, monkeypatch):
    monkeypatch.setitem(MANIFEST, "settings", {"export": ["three", "godot"]})
    out = tmp_path / "my out"
    code, text = command("bake", "scene.glb", "-o", out)
    assert code == 0
    assert re.search(r"^  three/ +files for three; see three/README.md$", text, re.MULTILINE)
    assert "  godot/" in text
    assert text.endswith(f"baker view '{out}'\nmeasure its error:  baker verify '{out}'\n")


def test_closing_lines_are_wrapped_between_words(monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    stages = [f"stage-{k} of the bake" for k in range(9)]
    message = "the standard error of many texels is high; raise `light_samples` or add `denoise=False`"
    manifest = {
        **MANIFEST,
        "timings": dict.fromkeys(stages, 1.5),
        "warnings": [{"code": "not-converged", "message": message}],
    }
    result = SimpleNamespace(manifest=manifest, out=None)
    terminal, file = Terminal(), io.StringIO()
    for stream in (terminal, file):
        write_summary(result, FlagStream(stream))
    assert max(map(len, terminal.getvalue().splitlines())) <= 60
    assert terminal.getvalue().split() == file.getvalue().split()
    assert "raise --light-samples or add --no-denoise [not-converged]\n" in file.getvalue()
    assert file.getvalue().count("\n") == 2


def test_quiet_says_nothing(pipeline, command, tmp_path, capsys):
    assert command(*bake_words(tmp_path, "-q")) == (0, "")
    assert capsys.readouterr().err == ""


def test_inspect_prints_text_and_json(monkeypatch, command):
    found = {
        "kind": "scene",
        "triangles": 32,
        "nodes": [{"name": f"n{k}", "mesh": k, "sha256": "0" * 64} for k in range(25)],
        "lights": [],
        "warnings": [{"code": "odd", "message": "a sentence that is longer than any hash in a table"}],
    }
    monkeypatch.setitem(sys.modules, "baker.io.inspect", SimpleNamespace(inspect_path=lambda path, _: found))
    code, out = command("inspect", "a.glb", "--threads", "1", "--seed", "2")
    assert code == 0
    assert "triangles: 32\n" in out
    assert "nodes (25):\n  name  mesh  sha256\n  n0       0  " + "0" * 21 + "...\n" in out
    assert "\n  n19     19  " in out
    assert "... and 5 more" in out
    assert "lights: none" in out
    assert "odd   a sentence that is longer than any hash in a table\n" in out
    assert "n24     24  " + "0" * 64 in command("inspect", "a.glb", "-v")[1]
    assert json.loads(command("inspect", "a.glb", "--json")[1]) == found
    assert command("inspect", "a.glb", "-q") == (0, "")


def test_version(command):
    assert command("--version")[1] == command("-V")[1] == f"baker {baker.__version__}\n"
    assert json.loads(command("--version", "--json")[1]) == {"version": baker.__version__}


def test_python_m_baker_is_the_command():
    done = subprocess.run([sys.executable, "-m", "baker", "-V"], capture_output=True, text=True, check=True)
    assert done.stdout == f"baker {baker.__version__}\n"


def test_the_project_has_a_name_of_its_own_and_one_command():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text("utf-8"))["project"]
    assert project["name"] == "baker-lightmaps"
    assert list(project["scripts"]) == ["baker"]


def test_help_of_a_command_has_two_spellings(command, capsys):
    for words in (("help", "verify"), ("verify", "--help")):
        assert command(*words)[0] == 0
        assert "Usage: baker verify" in capsys.readouterr().out
    assert command("help")[0] == 0
    assert "baker help COMMAND" in capsys.readouterr().out
    assert command("help", "verfy")[0] == 2
    assert "'verfy'" in capsys.readouterr().err


@pytest.mark.parametrize("name", COMMANDS)
def test_the_help_of_a_command_fits_80_columns_and_breaks_no_name(name, command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert command(name, "--help-all")[0] == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    # The help contains no type names such as <int>, no TEXT or X as the name of a value, and no braces.
    assert not re.search(r"<\w+>|\bTEXT\b|\bX\b|\{", text)
    made = getattr(importlib.import_module(f"baker.cli.{name}"), name)()
    words = set(re.split(r"[\s,()]+", text))
    for option in made.params:
        if option.param_type_name == "option":
            assert {*option.opts, *option.secondary_opts} <= words
            assert option.is_flag or option.count or f" {option.metavar}" in text, option.metavar
    # All descriptions of a group of options begin in the same column.
    for group in text.split("\n\n"):
        rows = [line for line in group.splitlines() if re.match(r"  -\S.* {2,}\S", line)]
        assert len({re.match(r"  \S+( \S+)* {2,}", row).end() for row in rows}) <= 1


def test_the_common_options_come_first_and_the_others_are_named(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    assert command("bake", "--help")[0] == 0
    short = capsys.readouterr().out
    assert command("bake", "--help-all")[0] == 0
    complete = capsys.readouterr().out
    common = short[short.index("Common options:") : short.index("More options")]
    described = re.findall(r"^  (?:-\w, )?(--[\w-]+)", common, re.MULTILINE)
    first = ["--out", "--resolution", "--density", "--quality", "--sky", "--export"]
    assert described == [*first, "--help-all", "--help"]
    assert common in complete
    assert short.count("\n") < 40
    for name in BakeSettings.model_fields:
        assert f"--{dashed(name)}" in short.split()
        assert group_of(BakeSettings.model_fields[name])


@pytest.mark.parametrize(
    ("words", "at", "offered"),
    [
        ("baker ve", 1, "verify"),
        ("baker bake --resol", 2, "--resolution"),
        ("baker bake --quality pr", 3, "preview"),
    ],
)
def test_a_shell_completes_commands_and_flags(words, at, offered):
    asked = {**os.environ, "_BAKER_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": str(at)}
    done = subprocess.run(
        [sys.executable, "-m", "baker"], capture_output=True, text=True, check=True, env=asked
    )
    assert done.stdout.split() == [offered]


def test_a_bake_into_a_folder_that_another_run_holds_is_refused(pipeline, command, tmp_path, capsys):
    lock = OutputLock(tmp_path / "out")
    assert lock.acquire()
    code, text = command("bake", tmp_path / "a.glb", "-o", tmp_path / "out", "--json", "-q")
    assert code == 4
    message = json.loads(text)["error"]["message"]
    assert "another run is baking into this folder; wait" in message
    assert not pipeline.calls
    lock.release()
    for name in ("bake", "ao"):
        assert command(name, tmp_path / "a.glb", "-o", tmp_path / "out", "-q", "--force")[0] == 0
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_a_bake_into_the_root_of_the_file_system_is_wrong_use(command, capsys):
    code, text = command(
        "bake", Path(__file__).parents[2] / "assets" / "cornell.glb", "-o", "/", "--force", "--json"
    )
    assert code == 2
    assert "root of the file system" in json.loads(text)["error"]["message"]


def test_a_bake_holds_its_folder_and_frees_it_whatever_happens(pipeline, command, tmp_path):
    held = []

    def bake(scene, *, out, **how):
        held.append(not OutputLock(out).acquire())
        raise InputError("broken", file="a.glb")

    pipeline.bake = bake
    assert command("bake", tmp_path / "a.glb", "-o", tmp_path / "out", "-q")[0] == 3
    assert held == [True]
    assert list(tmp_path.iterdir()) == []


def test_a_bake_goes_on_where_no_lock_can_be_made(pipeline, command, tmp_path, monkeypatch):
    def acquire(self):
        raise PermissionError(errno.EACCES, "no")

    monkeypatch.setattr(OutputLock, "acquire", acquire)
    assert command("bake", tmp_path / "a.glb", "-o", tmp_path / "out", "-q")[0] == 0
    assert len(pipeline.calls) == 1
