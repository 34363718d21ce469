"""The `bake.json` of hand-made bakes agrees with its JSON schema, with the bake and with docs/MANIFEST.md."""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import write
from io_scenes import make_atlas, quad_result, rich_builder, split_layout

from baker.core.lightmap import BakeResult
from baker.core.scene import PunctualLight, SceneWarning
from baker.core.settings import BakeSettings
from baker.io.bake.manifest import manifest_schema
from baker.io.bake.write_bake import write_bake
from baker.io.load import load_scene

VALIDATOR = jsonschema.Draft202012Validator(manifest_schema())


def bake(result: BakeResult, out: Path) -> dict:
    """Write a bake and return its bake.json.

    Asserts that bake.json is valid against the schema and equal to the manifest that `write_bake` returns.
    """
    returned = write_bake(result, out)
    manifest = json.loads((out / "bake.json").read_text("utf-8"), parse_constant=pytest.fail)
    assert [e.message for e in VALIDATOR.iter_errors(manifest)] == []
    assert manifest == returned
    return manifest


def test_every_promised_key_is_there(tmp_path: Path) -> None:
    jsonschema.Draft202012Validator.check_schema(manifest_schema())
    manifest = bake(quad_result(tmp_path / "in"), tmp_path / "out")
    assert list(manifest) == [
        "version", "settings", "versions", "input", "created", "channels", "pages", "instances", "objects",
        "lights", "timings", "rays", "solve", "statistics", "suggested_exposure", "warnings", "denoise",
        "files",
    ]  # fmt: skip
    assert {
        (p["channel"], p["page"], p["file"], p["width"], p["height"], p["unit"]) for p in manifest["pages"]
    } == {
        ("irradiance", 0, "irradiance_0.exr", 16, 16, "lx"),
        ("ao", 0, "ao_0.exr", 16, 16, "1"),
    }
    assert {name: (entry["components"], entry["unit"]) for name, entry in manifest["channels"].items()} == {
        "irradiance": (["R", "G", "B"], "lx"),
        "ao": (["Y"], "1"),
    }
    assert manifest["input"]["path"] == "../in/level.glb"
    assert {"baker", "python", "embree", "xatlas", "numba", "numpy", "openimagedenoise"} <= set(
        manifest["versions"]
    )
    assert manifest["versions"]["numpy"] == np.__version__
    assert manifest["timings"] == {"trace": 0.5, "write": 0.1}
    assert manifest["rays"] == {"gather": 1000}
    assert manifest["solve"]["energy"] == {
        "emitted": [1.0] * 3,
        "absorbed": [0.75] * 3,
        "escaped": [0.25] * 3,
    }


def test_settings_are_resolved_and_complete(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in", quality="high", ao_samples=7, ao_distance="50%", threads=2)
    settings = bake(result, tmp_path / "out")["settings"]
    assert set(BakeSettings.model_fields) - set(settings) == {"threads"}
    assert (settings["samples"], settings["light_samples"], settings["ao_samples"]) == (256, 256, 7)
    assert settings["ao_distance_metres"] == pytest.approx(np.sqrt(2) / 2), (
        "half the diagonal of a unit square"
    )
    unlimited = quad_result(tmp_path / "in", ao_distance="inf")
    assert bake(unlimited, tmp_path / "out2")["settings"]["ao_distance_metres"] is None


def test_instances_say_where_each_object_lies(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in")
    scene = load_scene(write(tmp_path / "rich.glb", rich_builder()))
    atlas = make_atlas(*(split_layout(scene, i, page=min(i, 1)) for i in range(3)))
    maps = {k: replace(m, value=np.repeat(m.value, 2, axis=0)) for k, m in result.lightmaps.items()}
    result = replace(
        result, scene=scene, atlas=atlas, lightmaps=maps, status=np.repeat(result.status, 2, axis=0),
        texel_count=np.array([11, 12, 13]),
    )  # fmt: skip
    manifest = bake(result, tmp_path / "out")
    glb = Glb(tmp_path / "out" / "scene.glb")
    assert [(i["node"], i["name"], i["page"], i["texels"]) for i in manifest["instances"]] == [
        (0, "first", 0, 11), (1, "second", 1, 12), (5, glb.json["nodes"][5].get("name", "plain"), 1, 13),
    ]  # fmt: skip
    for entry in manifest["instances"]:
        assert glb.json["nodes"][entry["node"]]["mesh"] == entry["mesh"]
        assert (entry["uv_scale"], entry["uv_offset"]) == ([1, 1], [0, 0])
    assert [p["file"] for p in manifest["pages"]] == [
        "irradiance_0.exr", "irradiance_1.exr", "ao_0.exr", "ao_1.exr",
    ]  # fmt: skip


def test_lights_of_all_kinds(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in", sky="1,2,3", sky_strength=2)
    lights = (
        PunctualLight("point", "bulb", 1, (5.0, 4.0, 3.0), (0.0, 1.0, 0.0)),
        PunctualLight("spot", "beam", 2, (1.0, 1.0, 1.0), inner_cone=0.1, outer_cone=0.2),
        PunctualLight("directional", "sun", 3, (9.0, 9.0, 9.0), direction=(0.0, -1.0, 0.0)),
    )
    emitting = replace(result.scene.materials[0], emission=(7.0, 0.0, 0.0))
    scene = replace(result.scene, lights=lights, materials=(emitting, *result.scene.materials[1:]))
    found = bake(replace(result, scene=scene), tmp_path / "out")["lights"]
    assert [(x["kind"], x["name"], x["unit"]) for x in found] == [
        ("point", "bulb", "cd"), ("spot", "beam", "cd"), ("directional", "sun", "lx"),
        ("emissive", "wall", "cd/m2"), ("sky", "sky", "cd/m2"),
    ]  # fmt: skip
    assert found[0]["intensity"] == [5.0, 4.0, 3.0]
    assert "direction" not in found[0]
    assert found[1]["outer_cone"] == 0.2
    assert "position" not in found[2]
    assert found[4]["radiance"] == [2.0, 4.0, 6.0]


def test_clipped_texels_are_counted_and_warned_of(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in")
    result.lightmaps["irradiance"].value[0, 2, 2:5] = 1e6
    warning = SceneWarning("bad", "something", "wall")
    result = replace(result, warnings=(warning, warning))
    manifest = bake(result, tmp_path / "out")
    assert manifest["statistics"]["irradiance"]["clipped"] == 3
    assert manifest["statistics"]["ao"]["clipped"] == 0
    assert [(w["code"], w["object"]) for w in manifest["warnings"]] == [
        ("bad", "wall"),
        ("clipped", "irradiance"),
    ]


def test_figures_of_covered_texels_stand_in_for_missing_ones(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in")
    figures = bake(result, tmp_path / "out")["statistics"]["ao"]
    covered = result.lightmaps["ao"].value[0][np.isin(result.status[0], [1, 3, 4])]
    assert figures["min"] == covered.min()
    assert figures["mean"] == pytest.approx(covered.mean(), rel=1e-6)
    assert figures["invalid"] == int((result.status == 3).sum())


def test_only_created_and_timings_differ_between_runs(tmp_path: Path) -> None:
    manifests = []
    for run, moment in enumerate(
        (datetime(2024, 1, 1, tzinfo=UTC), datetime(2025, 6, 7, 8, 9, 10, tzinfo=UTC))
    ):
        result = replace(quad_result(tmp_path / "in"), timings={"trace": float(run)})
        write_bake(result, tmp_path / str(run), created=moment)
        manifests.append((tmp_path / str(run) / "bake.json").read_text("utf-8").splitlines())
    different = [a.split(":")[0].strip() for a, b in zip(*manifests, strict=True) if a != b]
    assert different == ['"created"', '"trace"']


def test_a_number_that_json_cannot_say_becomes_null(tmp_path: Path) -> None:
    result = replace(quad_result(tmp_path / "in"), denoise={"scale": np.float32(np.inf), "runs": np.int64(3)})
    assert bake(result, tmp_path / "out")["denoise"] == {"scale": None, "runs": 3}


def test_the_docs_explain_every_key() -> None:
    text = (Path(__file__).parents[4] / "docs" / "MANIFEST.md").read_text("utf-8")
    schema = manifest_schema()
    keys = set(schema["properties"])
    for name in ("pages", "instances", "lights", "warnings", "files"):
        keys |= set(schema["properties"][name]["items"]["properties"])
    keys |= set(schema["properties"]["solve"]["properties"])
    keys |= set(schema["properties"]["channels"]["additionalProperties"]["properties"])
    keys |= set(schema["properties"]["statistics"]["additionalProperties"]["properties"])
    assert [key for key in sorted(keys) if f"`{key}`" not in text] == []
