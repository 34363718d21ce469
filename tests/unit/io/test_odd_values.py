"""Unusual values in valid JSON or TOML are accepted, or refused with one sentence."""

from __future__ import annotations

import io
from pathlib import Path

import pytest
from gltf_builder import quad_builder, write

from baker.cli.app import run
from baker.core.errors import InputError
from baker.core.settings import BakeSettings
from baker.io.load import load_scene
from baker.repairs.fix_file import fix_file


@pytest.mark.parametrize("depth", [101, 500, 900, 5000, 100_000])
def test_deeply_nested_json_is_refused(tmp_path: Path, depth: int) -> None:
    builder = quad_builder()
    builder.json["nodes"][0]["name"] = "here"
    text = builder.gltf().decode()
    nested = f'"name": "here", "extras": {"[" * depth}{"]" * depth}'
    path = write(tmp_path / "a.gltf", text.replace('"name": "here"', nested).encode())
    with pytest.raises(InputError, match="nested too deeply") as caught:
        load_scene(path)
    assert caught.value.file == str(path)


def test_moderately_nested_json_can_be_fixed(tmp_path: Path) -> None:
    builder = quad_builder()
    nested: list = []
    for _ in range(90):
        nested = [nested]
    builder.json["nodes"][0]["extras"] = nested
    assert fix_file(write(tmp_path / "a.gltf", builder)).data[:4] == b"glTF"


@pytest.mark.parametrize("key", ["scene", "glob", "out"])
def test_a_path_of_a_job_with_nul_is_refused(
    tmp_path: Path, key: str, capsys: pytest.CaptureFixture[str]
) -> None:
    values = {"out": "baked"} | ({"scene": "a.glb"} if key != "glob" else {}) | {key: r"a\u0000b"}
    jobs = tmp_path / "jobs.toml"
    jobs.write_text("[[job]]\n" + "".join(f'{name} = "{value}"\n' for name, value in values.items()))
    assert run(["batch", str(jobs)], out=io.StringIO()) == 2
    assert f"job 1: {key} contains a NUL character" in capsys.readouterr().err


def test_a_name_that_is_given_twice_counts_once() -> None:
    settings = BakeSettings(export="three,three", encode=["hdr", "hdr"], channels="ao, ao")
    assert (settings.export, settings.encode, settings.channels) == (("three",), ("hdr",), ("ao",))


def test_a_scene_without_extent_is_bad_input_and_no_wrong_setting() -> None:
    with pytest.raises(InputError, match="all surfaces lie in one point"):
        BakeSettings().ao_reach(0.0)
    assert BakeSettings(ao_distance="0.5").ao_reach(0.0) == 0.5
