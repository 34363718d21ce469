"""Unusual values in valid JSON or TOML are accepted, or refused with one sentence."""

from __future__ import annotations

import io
import json
import math
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gltf_builder import quad_builder, write
from numpy.typing import NDArray

import baker
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


@pytest.mark.parametrize(
    ("scale", "offset", "words"),
    [
        (1e-30, 0.0, "all surfaces lie in one point"),
        (1e-40, 0.0, "all surfaces lie in one point"),
        (1e20, 0.0, r"further than 1e\+18 m away"),
        (1.0, 1e30, r"further than 1e\+18 m away"),
    ],
)
def test_a_scene_without_extent_or_too_far_away_is_bad_input(
    tmp_path: Path, scale: float, offset: float, words: str
) -> None:
    with pytest.raises(InputError, match=words) as caught:
        bake_quad(tmp_path, lambda document: place(document, scale, offset))
    assert caught.value.file == str(tmp_path / "a.glb")


def place(document: dict[str, Any], scale: float, offset: float) -> None:
    """Set the matrix of node 0 to a uniform scale and an offset along x, metres."""
    document["nodes"][0]["matrix"] = [scale, 0, 0, 0, 0, scale, 0, 0, 0, 0, scale, 0, offset, 0, 0, 1]


def bake_quad(folder: Path, change: Callable[[dict[str, Any]], None]) -> NDArray[np.float32]:
    """Bake a unit square under a sky of 1 cd/m2 after a change of its glTF, and return its values in lx."""
    builder = quad_builder()
    change(builder.json)
    path = write(folder / "a.glb", builder)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        result = baker.bake(path, resolution=32, samples=4, sky="1,1,1", denoise=False, channels="irradiance")
    value = result.lightmaps["irradiance"].value
    assert np.isfinite(value).all()
    return value


# Changes of a square's glTF that have no effect on its light. The open square receives pi lx under a sky of 1
# cd/m2.
HARMLESS: dict[str, Callable[[dict[str, Any]], None]] = {
    "half of a surrogate pair in a name": lambda document: document["nodes"][0].update(name="a\ud800b"),
    "a base colour of 1e30": lambda document: document.setdefault("materials", [{}])[0].update(
        pbrMetallicRoughness={"baseColorFactor": [1e30, 1e30, 1e30, 1]}
    ),
    "base colours of 1e8 to 1e300": lambda document: document.setdefault("materials", [{}])[0].update(
        pbrMetallicRoughness={"baseColorFactor": [1e8, 1e20, 1e300, 1]}
    ),
    "an alpha cutoff of 1e30 without MASK": lambda document: document.setdefault("materials", [{}])[0].update(
        alphaCutoff=1e30
    ),
    "a place 1e8 m away": lambda document: place(document, 1.0, 1e8),
    "a place 1e12 m away": lambda document: place(document, 1.0, 1e12),
    "a scale of 1e-12": lambda document: place(document, 1e-12, 0.0),
    "a scale of 1e-20": lambda document: place(document, 1e-20, 0.0),
    "a scale of 1e8": lambda document: place(document, 1e8, 0.0),
    "a scale of 1e12": lambda document: place(document, 1e12, 0.0),
}


@pytest.mark.parametrize("case", HARMLESS)
def test_unusual_numbers_give_the_light_of_an_open_square(tmp_path: Path, case: str) -> None:
    assert bake_quad(tmp_path, HARMLESS[case]).max() == pytest.approx(math.pi, rel=1e-5)


@pytest.mark.parametrize("number", ["Infinity", "NaN"])
def test_numbers_that_are_not_json_are_refused(tmp_path: Path, number: str) -> None:
    with pytest.raises(InputError, match="not a JSON number"):
        load_scene(with_extra(tmp_path, number))


@pytest.mark.parametrize("number", ["1e400", "-1e400"])
def test_numbers_beyond_float64_are_written_as_finite_numbers(tmp_path: Path, number: str) -> None:
    data = fix_file(with_extra(tmp_path, number)).data
    length = int.from_bytes(data[12:16], "little")
    document = json.loads(data[20 : 20 + length], parse_constant=pytest.fail)
    assert abs(document["nodes"][0]["extras"]["a"]) == sys.float_info.max


def with_extra(folder: Path, number: str) -> Path:
    """Write a glTF file whose node has `extras` with a number, given as text."""
    builder = quad_builder()
    builder.json["nodes"][0]["extras"] = {"a": 12345}
    return write(folder / "a.gltf", builder.gltf().decode().replace("12345", number).encode())


def test_signalling_nans_of_a_file_raise_no_warnings(tmp_path: Path) -> None:
    builder = quad_builder()
    normal = np.full((4, 3), 0x7FA00000, np.uint32).view(np.float32)
    builder.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] = builder.accessor(normal)
    path = write(tmp_path / "a.glb", builder)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        baker.check(path)
        fix_file(path)
