"""`inspect_path`: the counts and sizes that it reports are compared with those of hand-made files."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import write
from io_scenes import quad_result, rich_builder

from baker.core.errors import InputError
from baker.io.bake.write_bake import write_bake
from baker.io.inspect import inspect_path
from baker.io.png import encode_palette_png, encode_png


def test_a_scene_is_counted(tmp_path: Path) -> None:
    found = inspect_path(write(tmp_path / "rich.glb", rich_builder()))
    json.dumps(found, allow_nan=False)
    assert found["kind"] == "scene"
    assert found["triangles"] == 4 + 4 + 2
    # Nodes 0 and 1 have the same mesh in the file. Node 0 is skinned, so its posed mesh is a separate one.
    assert [m["instances"] for m in found["meshes"]] == [1, 1, 1]
    assert [i["node"] for i in found["instances"]] == [0, 1, 5]
    # The squares lie at x = 0 to 1 or 3 to 4, and at z = 0 or 1. One square lies at y = 3 to 4.
    assert (found["box"]["min"], found["box"]["max"]) == ([0, 0, 0], [4, 4, 1])
    assert found["box"]["diagonal"] == pytest.approx(np.sqrt(33))
    assert [(c["node"], c["name"], c["position"]) for c in found["cameras"]] == [(3, "eye", [0, 0, 5])]
    assert found["cameras"][0]["fov"] == pytest.approx(np.degrees(0.7))


def test_a_bake_is_summed_up_and_its_files_compared(tmp_path: Path) -> None:
    out = tmp_path / "out"
    write_bake(quad_result(tmp_path / "in"), out)
    for path in (out, out / "bake.json"):
        found = inspect_path(path)
        json.dumps(found, allow_nan=False)
        assert found["kind"] == "bake"
        assert found["whole"]
        assert found["texels"] == 123
        assert found["seconds"] == pytest.approx(0.6)
        assert {entry["state"] for entry in found["files"]} == {"as baked"}
    (out / "ao_0.exr").unlink()
    (out / "scene.glb").write_bytes(b"other")
    found = inspect_path(out)
    assert not found["whole"]
    states = {entry["file"]: entry["state"] for entry in found["files"]}
    assert states["ao_0.exr"] == "missing"
    assert states["scene.glb"] == "changed"
    assert states["irradiance_0.exr"] == "as baked"


def test_an_image_is_measured(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in")
    write_bake(result, tmp_path / "out")
    found = inspect_path(tmp_path / "out" / "irradiance_0.exr")
    json.dumps(found, allow_nan=False)
    assert (found["kind"], found["width"], found["height"], found["type"]) == ("image", 16, 16, "half")
    assert [c["channel"] for c in found["channels"]] == ["R", "G", "B"]
    stored = result.lightmaps["irradiance"].value[0].astype(np.float16).astype(np.float64)
    for index, channel in enumerate(found["channels"]):
        assert channel["min"] == stored[:, :, index].min()
        assert channel["max"] == stored[:, :, index].max()
        assert channel["mean"] == pytest.approx(stored[:, :, index].mean(), rel=1e-12)
        assert channel["not_finite"] == 0
    assert found["header"]["unit"] == "lx"


def test_missing_files_and_folders_without_a_bake_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        inspect_path(tmp_path / "absent")
    with pytest.raises(InputError, match="holds no bake"):
        inspect_path(tmp_path)


def test_a_status_picture_is_counted(tmp_path: Path) -> None:
    result = quad_result(tmp_path / "in")
    write_bake(result, tmp_path / "out")
    found = inspect_path(tmp_path / "out" / "status_0.png")
    json.dumps(found, allow_nan=False)
    assert (found["kind"], found["width"], found["height"]) == ("status", 16, 16)
    count = np.bincount(result.status[0].ravel(), minlength=5)
    assert count[1] > 0
    assert list(found["texels"]) == ["empty", "covered", "dilated", "invalid", "unconverged"]
    assert list(found["texels"].values()) == count.tolist()


def test_other_pictures_are_no_status(tmp_path: Path) -> None:
    path = tmp_path / "status_0.png"
    for data in (
        encode_png(np.zeros((2, 2), np.uint8)),
        encode_palette_png(np.zeros((2, 2), np.uint8), {0: (1, 2, 3)}, {}),
        encode_palette_png(np.full((2, 2), 9, np.uint8), {}, {"Legend": "9 lives"}),
        b"",
    ):
        path.write_bytes(data)
        with pytest.raises(InputError, match="png"):
            inspect_path(path)
