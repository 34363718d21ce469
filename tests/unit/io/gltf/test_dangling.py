"""Invalid references of a glTF document stay invalid in `scene.glb` and in fixed files."""

from __future__ import annotations

import pytest
from glb_reader import Glb
from gltf_builder import QUAD, GltfBuilder, quad_builder, write

import baker
from baker.io.gltf.dangling import NOWHERE, break_dangling
from baker.io.gltf.packer import Packer
from baker.io.gltf.write_baked import make_glb
from baker.repairs.fix_file import fix_file

QUADS = {"componentType": 5126, "count": 4, "type": "VEC3"}


def late_view(b: GltfBuilder) -> int:
    """Add a view that ends after the buffer, and return its index."""
    return b.add("bufferViews", {"buffer": 0, "byteOffset": len(b.blob) - 20, "byteLength": 48})


def late_accessor(b: GltfBuilder) -> int:
    """Add an accessor that ends after its view, and return its index."""
    return b.add("accessors", {**QUADS, "bufferView": 0, "count": 5})


def sparse(b: GltfBuilder, **views: int) -> int:
    """Add an accessor with sparse values in the given views, and return its index."""
    parts = {
        "count": 1,
        "indices": {"bufferView": views.get("indices", 3), "componentType": 5123},
        "values": {"bufferView": views.get("values", 0)},
    }
    return b.add("accessors", {**QUADS, "sparse": parts})


def n(b: GltfBuilder, key: str) -> int:
    return len(b.json[key])


VIEW, ACCESSOR = "bufferViews -1 buffer", "accessors -1 bufferView"
# {name: (function that adds an invalid reference, path of this reference in the document)}
CASES = {
    "view beyond its buffer": (late_view, VIEW),
    "view of no buffer": (lambda b: b.add("bufferViews", {"buffer": 1, "byteLength": 4}), VIEW),
    "view of a word": (lambda b: b.add("bufferViews", {"buffer": [], "byteLength": 4}), VIEW),
    "accessor beyond its view": (late_accessor, ACCESSOR),
    "accessor of no type": (lambda b: b.add("accessors", {"bufferView": 0}), ACCESSOR),
    "accessor of no view": (
        lambda b: b.add("accessors", {**QUADS, "bufferView": n(b, "bufferViews")}),
        ACCESSOR,
    ),
    "sparse indices": (
        lambda b: sparse(b, indices=n(b, "bufferViews")),
        "accessors -1 sparse indices bufferView",
    ),
    "sparse values": (lambda b: sparse(b, values=late_view(b)), VIEW),
    "image": (lambda b: b.add("images", {"bufferView": n(b, "bufferViews")}), "images -1 bufferView"),
    "skin": (
        lambda b: b.add("skins", {"joints": [0], "inverseBindMatrices": n(b, "accessors")}),
        "skins -1 inverseBindMatrices",
    ),
    "animation": (
        lambda b: b.add("animations", {"channels": [], "samplers": [{"output": n(b, "accessors")}]}),
        "animations -1 samplers 0 output",
    ),
    "unused mesh": (
        lambda b: b.mesh({"attributes": {"POSITION": n(b, "accessors") + 1}}),
        "meshes -1 primitives 0 attributes POSITION",
    ),
    "unused morph target": (
        lambda b: b.mesh({"attributes": {"POSITION": 0}, "targets": [{"NORMAL": n(b, "accessors")}]}),
        "meshes -1 primitives 0 targets 0 NORMAL",
    ),
    "unused indices": (
        lambda b: b.mesh({"attributes": {"POSITION": 0}, "indices": n(b, "accessors")}),
        "meshes -1 primitives 0 indices",
    ),
}


def at(document, path):
    for step in path.split():
        document = document[int(step) if step.lstrip("-").isdigit() else step]
    return document


@pytest.mark.parametrize("name", CASES)
def test_an_invalid_reference_does_not_become_valid_in_a_bake(name, tmp_path):
    add, path = CASES[name]
    builder = quad_builder()
    builder.image(b"\x89PNG", sampler=0)
    # The bake must not change this skin.
    builder.add("skins", {"joints": [0], "inverseBindMatrices": builder.accessor(QUAD[:1])})
    add(builder)
    index = {key: len(items) - 1 for key, items in builder.json.items() if isinstance(items, list)}
    key, _, rest = path.partition(" -1 ")
    scene = baker.load(write(tmp_path / "a.glb", builder))
    after = Glb(make_glb(scene, baker.unwrap(scene, resolution=32)).data)
    assert at(after.json[key][index[key]], rest) == NOWHERE
    assert after.json["images"][0]["bufferView"] != NOWHERE
    assert after.accessor(after.json["skins"][0]["inverseBindMatrices"]).tolist() == QUAD[:1].tolist()


def test_a_view_beyond_its_buffer_stays_invalid_in_a_fixed_file(tmp_path):
    builder = quad_builder()
    late_view(builder)
    builder.add("accessors", {**QUADS, "bufferView": n(builder, "bufferViews") - 1})
    # The fix adds normals.
    del builder.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"]
    fixed = fix_file(write(tmp_path / "a.glb", builder))
    assert fixed.fixed
    assert Glb(fixed.data).json["bufferViews"][4]["buffer"] == NOWHERE


def test_missing_buffers_and_valid_references_are_not_changed():
    document = {
        "buffers": [{"byteLength": 8}, {"byteLength": 8, "uri": "lost.bin"}],
        "bufferViews": [
            {"buffer": 0, "byteLength": 8, "extensions": {"EXT_x": {"buffer": 0, "byteLength": 9}}},
            {"buffer": 1, "byteLength": 8},
        ],
        "accessors": [{"bufferView": k, "componentType": 5126, "count": 2, "type": "SCALAR"} for k in (0, 1)],
        "nodes": [{"extensions": {"ACME": {"bufferView": 2}}, "extras": {"bufferView": 2}}],
    }
    buffers, missing = (b"12345678", b""), frozenset({1})
    break_dangling(document, buffers, missing)
    after = Glb(Packer(document, buffers, missing=missing).glb()).json
    assert [a["bufferView"] for a in after["accessors"]] == [0, 1]
    assert [v["buffer"] for v in after["bufferViews"]] == [0, 1]
    assert after["bufferViews"][0]["extensions"]["EXT_x"]["buffer"] == NOWHERE
    assert after["nodes"][0] == {"extensions": {"ACME": {"bufferView": NOWHERE}}, "extras": {"bufferView": 2}}
