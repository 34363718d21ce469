"""No fixed scene is written that a bake cannot read."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
from gltf_builder import GltfBuilder, pack_glb, quad_builder, write
from repair_scenes import box

import baker
from baker.core.errors import InputError, ResourceError
from baker.repairs.write import write_fixed


def fix(scene, out):
    return baker.repair(scene, out, force=True, resolution=32, threads=1)


def wild_builder() -> GltfBuilder:
    """Return a sound object with duplicate faces, and an object with an index out of range."""
    position, triangle = box()
    b = GltfBuilder()
    b.node(mesh=b.mesh(b.primitive(position, np.tile(triangle, (2, 1)).astype(np.uint32))), name="sound")
    wild = np.concatenate([triangle, [[0, 1, 8]]]).astype(np.uint32)
    b.node(mesh=b.mesh(b.primitive(position, wild)), name="wild")
    return b


def negative_light(b: GltfBuilder) -> GltfBuilder:
    light = {"type": "point", "intensity": -1.0}
    b.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    b.node(extensions={"KHR_lights_punctual": {"light": 0}}, name="lamp")
    return b


@pytest.mark.parametrize(
    ("builder", "words"),
    [(wild_builder(), "index 8"), (negative_light(quad_builder()), "intensity"), (GltfBuilder(), "")],
)
def test_a_defect_that_is_not_fixed_is_named_and_nothing_is_written(builder, words, tmp_path):
    scene, out = write(tmp_path / "scene.glb", builder), tmp_path / "out" / "fixed.glb"
    with pytest.raises(InputError, match="this is not fixed automatically, so nothing was written") as caught:
        fix(scene, out)
    assert words in str(caught.value)
    assert caught.value.file == str(scene)
    assert not out.exists()
    write(tmp_path / "old.glb", b"old")
    with pytest.raises(InputError):
        fix(scene, tmp_path / "old.glb")
    assert (tmp_path / "old.glb").read_bytes() == b"old"
    assert sorted(p.name for p in tmp_path.iterdir() if p.is_file()) == ["old.glb", "scene.glb"]


@pytest.mark.parametrize("images", [[1e20], [{"uri": 5}], [{"uri": []}, None]])
def test_unused_images_of_any_type_do_not_stop_a_fix(images, tmp_path):
    builder = quad_builder()
    builder.json["images"] = images
    fix(write(tmp_path / "scene.glb", builder), tmp_path / "fixed.glb")
    assert (tmp_path / "fixed.glb").exists()


def broken(data: bytes, change) -> bytes:
    size = struct.unpack_from("<I", data, 12)[0]
    document = json.loads(data[20 : 20 + size])
    change(document)
    return pack_glb(document, data[28 + size :])


@pytest.mark.parametrize(
    "change",
    [
        lambda json: json["accessors"][0].update(count=1000),
        lambda json: json["bufferViews"][0].update(byteLength=1 << 20),
        lambda json: json["accessors"].append({"componentType": 5126, "type": "VEC3", "bufferView": 99}),
        lambda json: json["accessors"].append({"componentType": 5126, "type": "VEC3", "count": 1 << 40}),
        lambda json: json["bufferViews"].append({"buffer": 0, "byteOffset": 1 << 20, "byteLength": 4}),
        lambda json: json.pop("nodes"),
        lambda json: json.pop("asset"),
    ],
)
def test_what_a_fix_breaks_is_not_written(change, tmp_path):
    builder = quad_builder()
    scene, out = write(tmp_path / "scene.glb", builder), tmp_path / "fixed.glb"
    data = broken(builder.glb(), change)
    with pytest.raises(ResourceError, match=r"cannot be read back .* nothing was written") as caught:
        write_fixed(out, data, scene)
    assert caught.value.exit_code == 4
    assert caught.value.file == str(out)
    assert [p.name for p in tmp_path.iterdir()] == ["scene.glb"]


def test_broken_data_that_a_bake_does_not_read_is_kept(tmp_path):
    position, triangle = box()
    b = GltfBuilder()
    b.node(mesh=b.mesh(b.primitive(position, np.tile(triangle, (2, 1)).astype(np.uint32))))
    b.json["accessors"].append({"componentType": 5126, "type": "VEC3", "count": 9, "bufferView": 99})
    b.json["bufferViews"].append({"buffer": 0, "byteOffset": 1 << 20, "byteLength": 4})
    scene = write(tmp_path / "scene.glb", b)
    assert fix(scene, tmp_path / "fixed.glb").fixed
    assert baker.load(tmp_path / "fixed.glb").n_triangles == len(triangle)
