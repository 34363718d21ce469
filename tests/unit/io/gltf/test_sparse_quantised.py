"""Sparse and quantised vertex data of whole meshes: loaded with the right values, and kept in scene.glb."""

from __future__ import annotations

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder
from io_scenes import make_atlas, split_layout, write

from baker.io.gltf.write_baked import make_glb
from baker.io.load import load_scene

UV = np.ascontiguousarray(QUAD[:, :2])
JOINTS = np.zeros((4, 4), np.uint8)
WEIGHTS = np.array([[1, 0, 0, 0]] * 4, np.float32)


def make_sparse(builder, index):
    """Replace the last two rows of an accessor by sparse ones, and the rows of its base by wrong values."""
    accessor = builder.json["accessors"][index]
    view = builder.json["bufferViews"][accessor["bufferView"]]
    start, size = view["byteOffset"], view["byteLength"] // accessor["count"]
    rows = bytearray(builder.blob[start : start + view["byteLength"]])
    last = accessor["count"] - 2
    accessor["sparse"] = {
        "count": 2,
        "indices": {"bufferView": builder.view(bytes([last, last + 1])), "componentType": 5121},
        "values": {"bufferView": builder.view(bytes(rows[last * size :]))},
    }
    builder.blob = builder.blob[: start + last * size] + bytes(2 * size) + builder.blob[start + len(rows) :]


def mesh(*, sparse, skinned=False):
    builder = GltfBuilder()
    attributes = {"NORMAL": QUAD_NORMAL, "TEXCOORD_0": UV}
    if skinned:
        attributes |= {"JOINTS_0": JOINTS, "WEIGHTS_0": WEIGHTS}
    primitive = builder.primitive(QUAD, QUAD_TRIANGLE, **attributes)
    builder.node(mesh=builder.mesh(primitive), **({"skin": 0} if skinned else {}))
    if skinned:
        builder.add("skins", {"joints": [builder.node(translation=[0, 3, 0])]})
    if sparse:
        for index in range(len(builder.json["accessors"])):
            make_sparse(builder, index)
    return builder


@pytest.mark.parametrize("skinned", [False, True])
def test_sparse_data_of_all_kinds_is_read_and_written(tmp_path, skinned):
    scenes, files = [], []
    for sparse in (False, True):
        scene = load_scene(write(tmp_path / "a.glb", mesh(sparse=sparse, skinned=skinned)))
        scenes.append(scene)
        files.append(Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data))
    a, b = (scene.meshes[0] for scene in scenes)
    for name in ("position", "normal", "triangle"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert np.array_equal(a.texcoord[0], b.texcoord[0])
    (first,), (second,) = (file.json["meshes"][0]["primitives"] for file in files)
    assert first["attributes"].keys() == second["attributes"].keys()
    for name in first["attributes"]:
        assert np.array_equal(files[0].corners(first, name), files[1].corners(second, name)), name


@pytest.mark.parametrize("normalized", [False, True])
@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int16, np.uint16])
def test_quantised_vertices_are_scaled_by_their_node_and_keep_their_type(tmp_path, dtype, normalized):
    most = np.iinfo(dtype).max
    unit = 1.0 if normalized else float(most)
    builder = GltfBuilder()
    attributes = {}
    small = np.int8 if dtype in (np.int8, np.uint8) else np.int16
    kinds = (("POSITION", QUAD * most, dtype), ("NORMAL", QUAD_NORMAL * np.iinfo(small).max, small))
    for name, value, kind in (*kinds, ("TEXCOORD_0", UV * most, dtype)):
        size = np.dtype(kind).itemsize * value.shape[1]
        rows = np.zeros((4, size + -size % 4), np.uint8)
        rows[:, :size] = value.astype(kind).view(np.uint8).reshape(4, -1)
        code = {"int8": 5120, "uint8": 5121, "int16": 5122, "uint16": 5123}[np.dtype(kind).name]
        accessor = {
            "bufferView": builder.view(rows.tobytes(), byteStride=rows.shape[1]),
            "componentType": code, "count": 4, "type": f"VEC{value.shape[1]}",
            "normalized": name == "NORMAL" or normalized,
        }  # fmt: skip
        attributes[name] = builder.add("accessors", accessor)
    indices = builder.accessor(QUAD_TRIANGLE.reshape(-1))
    number = builder.mesh({"attributes": attributes, "indices": indices})
    builder.node(mesh=number, scale=[2 / unit] * 3, translation=[1, 0, 0])
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    scene = load_scene(write(tmp_path / "a.glb", builder))
    matrix = scene.instances[0].world_from_object
    world = scene.meshes[0].position @ matrix[:3, :3].T + matrix[:3, 3]
    # Two roundings to float32 of numbers up to 3.
    np.testing.assert_allclose(np.sort(world, axis=0), np.sort(2 * QUAD + [1, 0, 0], axis=0), atol=1e-6)
    np.testing.assert_allclose(scene.meshes[0].normal, QUAD_NORMAL, atol=1e-6)
    assert scene.meshes[0].texcoord[0].max() == pytest.approx(1.0 if normalized else most)
    after = Glb(make_glb(scene, make_atlas(split_layout(scene, 0))).data)
    assert after.json["extensionsRequired"] == ["KHR_mesh_quantization"]
    written = after.json["meshes"][0]["primitives"][0]["attributes"]
    for name, index in attributes.items():
        old, new = builder.json["accessors"][index], after.json["accessors"][written[name]]
        assert (new["componentType"], new["normalized"]) == (old["componentType"], old["normalized"])
