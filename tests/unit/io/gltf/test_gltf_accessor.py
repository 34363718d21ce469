"""Reading glTF accessors: strides, offsets, normalised integers, sparse rows and quantised positions."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from gltf_builder import GltfBuilder, mesh_glb, quad_builder, write

from baker.core.errors import InputError
from baker.io.gltf.accessor import read_accessor, read_indices
from baker.io.gltf.document import open_document
from baker.io.load import load_scene


def read(builder, tmp_path, index, types):
    path = write(tmp_path / "a.glb", builder)
    return read_accessor(open_document(path, path.read_bytes()), index, types=types)


def test_interleaved_rows_are_found_by_stride_and_offset(tmp_path):
    builder = GltfBuilder()
    rng = np.random.default_rng(1)
    rows = rng.random((5, 8), np.float32)  # columns: position 3, normal 3, uv 2
    view = builder.view(rows.tobytes(), byteStride=32)
    for offset, width in ((0, "VEC3"), (12, "VEC3"), (24, "VEC2")):
        builder.add(
            "accessors",
            {"bufferView": view, "byteOffset": offset, "componentType": 5126, "count": 5, "type": width},
        )
    np.testing.assert_array_equal(read(builder, tmp_path, 0, ("VEC3",)), rows[:, :3])
    np.testing.assert_array_equal(read(builder, tmp_path, 1, ("VEC3",)), rows[:, 3:6])
    np.testing.assert_array_equal(read(builder, tmp_path, 2, ("VEC2",)), rows[:, 6:])


@pytest.mark.parametrize("dtype", [np.int8, np.uint8, np.int16, np.uint16])
def test_normalised_integers_follow_the_specification(tmp_path, dtype):
    info = np.iinfo(dtype)
    value = np.array([info.min, info.min + 1, -1 if info.min else 1, 0, info.max], dtype)
    builder = GltfBuilder()
    at = builder.accessor(np.stack([value, value], axis=1), normalized=True)
    got = read(builder, tmp_path, at, ("VEC2",))
    expected = [max(float(v) / info.max, -1.0) for v in value.tolist()]
    # The reader divides once in single precision, so the relative error is at most half a float32 step.
    np.testing.assert_allclose(got[:, 0], expected, rtol=1e-7, atol=0)
    assert got[-1, 0] == 1.0


def test_integers_that_are_not_normalised_keep_their_value(tmp_path):
    builder = GltfBuilder()
    at = builder.accessor(np.array([[0, 7], [255, 1]], np.uint8))
    np.testing.assert_array_equal(read(builder, tmp_path, at, ("VEC2",)), [[0, 7], [255, 1]])


@pytest.mark.parametrize("base", [True, False])
def test_sparse_rows_replace_those_of_the_base_or_of_zeros(tmp_path, base):
    builder = GltfBuilder()
    rows = np.arange(12, dtype=np.float32).reshape(4, 3)
    sparse = {
        "count": 2,
        "indices": {"bufferView": builder.view(struct.pack("<2H", 1, 3)), "componentType": 5123},
        "values": {"bufferView": builder.view(np.array([[9, 8, 7], [6, 5, 4]], "<f4").tobytes())},
    }
    accessor = {"componentType": 5126, "count": 4, "type": "VEC3", "sparse": sparse}
    if base:
        accessor["bufferView"] = builder.view(rows.tobytes())
    at = builder.add("accessors", accessor)
    expected = rows.copy() if base else np.zeros_like(rows)
    expected[1], expected[3] = (9, 8, 7), (6, 5, 4)
    np.testing.assert_array_equal(read(builder, tmp_path, at, ("VEC3",)), expected)


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.uint32])
def test_indices_of_every_width(tmp_path, dtype):
    builder = GltfBuilder()
    value = np.array([0, 200, 3, np.iinfo(dtype).max], dtype)
    at = builder.accessor(value)
    path = write(tmp_path / "a.glb", builder)
    got = read_indices(open_document(path, path.read_bytes()), at)
    assert got.dtype == np.int64
    assert got.tolist() == value.tolist()


def test_quantised_positions_are_read_when_the_extension_is_named(tmp_path):
    position = np.array([[0, 0, 0, 0], [1000, 0, 0, 0], [0, -1000, 0, 0]], np.int16)
    builder = GltfBuilder()
    at = builder.add(
        "accessors",
        {
            "bufferView": builder.view(position.tobytes(), byteStride=8),
            "componentType": 5122, "count": 3, "type": "VEC3", "normalized": True,
        },
    )  # fmt: skip
    builder.node(mesh=builder.mesh({"attributes": {"POSITION": at}}), scale=[32.767] * 3)
    with pytest.raises(InputError, match="componentType 5126"):
        load_scene(write(tmp_path / "plain.glb", builder))
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = ["KHR_mesh_quantization"]
    scene = load_scene(write(tmp_path / "quantised.glb", builder))
    world = scene.meshes[0].position * scene.instances[0].world_from_object[0, 0]
    np.testing.assert_allclose(world, [[0, 0, 0], [1, 0, 0], [0, -1, 0]], atol=1e-6)


def test_data_uri_and_outside_buffer_give_the_same_scene(tmp_path):
    builder = quad_builder()
    inside = load_scene(write(tmp_path / "a.gltf", builder))
    (tmp_path / "data file.bin").write_bytes(builder.blob)
    builder.json["buffers"] = [{"byteLength": len(builder.blob), "uri": "data%20file.bin"}]
    outside = load_scene(write(tmp_path / "b.gltf", builder.gltf()))
    binary = load_scene(write(tmp_path / "c.glb", quad_builder()))
    for other in (outside, binary):
        np.testing.assert_array_equal(inside.meshes[0].position, other.meshes[0].position)
        np.testing.assert_array_equal(inside.meshes[0].triangle, other.meshes[0].triangle)
    assert outside.source.buffers == binary.source.buffers


def test_a_large_mesh_keeps_every_number(tmp_path):
    rng = np.random.default_rng(2)
    position = rng.random((3000, 3), np.float32)
    triangle = np.arange(3000).reshape(-1, 3)
    scene = load_scene(write(tmp_path / "a.glb", mesh_glb(position, triangle, NORMAL=position)))
    np.testing.assert_array_equal(scene.meshes[0].position, position)
    np.testing.assert_array_equal(scene.meshes[0].triangle, triangle)
    assert scene.warnings == ()
