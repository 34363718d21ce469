"""Files with Draco-compressed primitives load, and are written, as their uncompressed versions."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import pytest
from glb_reader import Glb
from gltf_builder import GltfBuilder
from io_scenes import make_atlas, split_layout, write

from baker.core.errors import InputError
from baker.io.gltf.write_baked import make_glb
from baker.io.load import load_scene

STREAMS = json.loads(Path(__file__).parents[1].joinpath("draco", "streams.json").read_text("utf-8"))
# A mesh with POSITION, NORMAL and TEXCOORD_0 as float32, and 16-bit colours.
CASE = next(case for case in STREAMS if [a["width"] for a in case["attributes"]] == [3, 3, 2, 4])
NAMES = ("POSITION", "NORMAL", "TEXCOORD_0", "COLOR_0")
DRACO = "KHR_draco_mesh_compression"
PICTURE = b"\x89PNG not decoded IEND"


def arrays():
    found = {}
    for name, attribute in zip(NAMES, CASE["attributes"], strict=True):
        data = np.frombuffer(base64.b64decode(attribute["data"]), attribute["dtype"])
        found[name] = data.reshape(-1, attribute["width"])
    return found, np.frombuffer(base64.b64decode(CASE["faces"]), np.uint32).astype(np.uint16)


def plain():
    attribute, index = arrays()
    builder = GltfBuilder()
    primitive = builder.primitive(attribute.pop("POSITION"), index, **attribute, extras={"kept": 1})
    builder.json["accessors"][primitive["attributes"]["COLOR_0"]]["normalized"] = True
    builder.node(mesh=builder.mesh(primitive))
    return builder


def packed(*, users: int = 1):
    attribute, index = arrays()
    builder = GltfBuilder()
    builder.image(PICTURE)
    stream = builder.view(base64.b64decode(CASE["stream"]))
    builder.image(PICTURE)
    codes = {"float32": 5126, "uint16": 5123}
    kinds = {2: "VEC2", 3: "VEC3", 4: "VEC4"}
    for _ in range(users):
        accessors = {}
        for name, value in attribute.items():
            accessors[name] = builder.add(
                "accessors",
                {
                    "componentType": codes[value.dtype.name],
                    "type": kinds[value.shape[1]],
                    "count": len(value),
                },
            )
        builder.json["accessors"][-1]["normalized"] = True
        indices = builder.add("accessors", {"componentType": 5123, "type": "SCALAR", "count": index.size})
        ids = {name: a["id"] for name, a in zip(NAMES, CASE["attributes"], strict=True)}
        primitive = {
            "attributes": accessors,
            "indices": indices,
            "extras": {"kept": 1},
            "extensions": {DRACO: {"bufferView": stream, "attributes": ids}},
        }
        builder.node(mesh=builder.mesh(primitive))
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = [DRACO]
    return builder


def load(path, builder):
    return load_scene(write(path / "a.glb", builder))


def test_compressed_primitives_hold_the_same_mesh(tmp_path):
    a, b = (load(tmp_path, made).meshes[0] for made in (plain(), packed()))
    for name in ("position", "normal", "triangle", "colour"):
        assert np.array_equal(getattr(a, name), getattr(b, name)), name
    assert np.array_equal(a.texcoord[0], b.texcoord[0])


def test_scene_glb_is_that_of_the_uncompressed_file(tmp_path):
    files, warnings = [], []
    for made in (plain(), packed()):
        scene = load(tmp_path, made)
        warnings.append(scene.warnings)
        data = make_glb(scene, make_atlas(split_layout(scene, 0))).data
        files.append(Glb(data))
    (a,), (b,) = (file.json["meshes"][0]["primitives"] for file in files)
    assert warnings[0] == warnings[1]
    assert a["attributes"].keys() == b["attributes"].keys()
    for attribute in a["attributes"]:
        assert np.array_equal(files[0].corners(a, attribute), files[1].corners(b, attribute)), attribute
    assert b["extras"] == {"kept": 1}
    assert "extensions" not in b
    after = files[1]
    assert "extensionsUsed" not in after.json
    assert "extensionsRequired" not in after.json
    for image in after.json["images"]:
        assert after.view(image["bufferView"]) == PICTURE
    # The compressed data is gone.
    assert b"DRACO" in packed().glb()
    assert b"DRACO" not in data


def test_primitives_share_a_stream(tmp_path):
    scene = load(tmp_path, packed(users=2))
    assert len(scene.meshes) == 2
    assert np.array_equal(scene.meshes[0].position, scene.meshes[1].position)


def test_an_accessor_of_two_streams_is_copied(tmp_path):
    """Files may use one accessor, without data of its own, for the equal counts of several primitives."""
    builder = packed(users=2)
    first, second = (mesh["primitives"][0] for mesh in builder.json["meshes"])
    second["attributes"], second["indices"] = first["attributes"].copy(), first["indices"]
    again = builder.view(base64.b64decode(CASE["stream"]))
    second["extensions"][DRACO]["bufferView"] = again
    second["extensions"][DRACO]["attributes"] = {"POSITION": 0, "NORMAL": 0, "TEXCOORD_0": 2, "COLOR_0": 3}
    scene = load(tmp_path, builder)
    assert np.array_equal(scene.meshes[0].position, scene.meshes[1].position)
    assert not np.array_equal(scene.meshes[0].normal, scene.meshes[1].normal)


def change(builder, place, key, value):
    primitive = builder.json["meshes"][0]["primitives"][0]
    extension = primitive["extensions"][DRACO]
    accessor = builder.json["accessors"][0]
    holders = {"extension": extension, "ids": extension["attributes"], "accessor": accessor}
    holders.get(place, primitive)[key] = value


@pytest.mark.parametrize(
    ("place", "key", "value", "words"),
    [
        ("extension", "bufferView", 0, "no Draco mesh"),
        ("extension", "bufferView", 99, "out of range"),
        ("ids", "POSITION", 9, "no attribute 9"),
        ("ids", "NORMAL", 2, "VEC3' does not have the 2 components"),
        ("accessor", "componentType", 5123, "does not fit the component type"),
        ("accessor", "componentType", 7, "is not a component type"),
        ("accessor", "count", 1 << 40, "largest size of a scene"),
        ("primitive", "mode", 6, "the mode is 6"),
    ],
)
def test_broken_primitives_are_named(tmp_path, place, key, value, words):
    builder = packed()
    change(builder, place, key, value)
    with pytest.raises(InputError, match=words) as caught:
        load(tmp_path, builder)
    assert caught.value.object.startswith(("meshes[0].primitives[0]", "accessors["))


def test_wrong_counts_are_corrected(tmp_path):
    builder = packed()
    for accessor in builder.json["accessors"]:
        accessor["count"] = 7
    assert load(tmp_path, builder).n_triangles == load(tmp_path, plain()).n_triangles


@pytest.mark.parametrize("reference", [{}, [0], "0", None, -1])
def test_malformed_references_elsewhere_do_not_stop_the_decoder(tmp_path, reference):
    builder = packed()
    builder.json["images"][0]["bufferView"] = reference
    assert load(tmp_path, builder).n_triangles == load(tmp_path, plain()).n_triangles
