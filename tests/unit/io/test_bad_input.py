"""Loading a broken file raises a one-sentence error that names the file and the broken member."""

from __future__ import annotations

import copy
import io
import json

import numpy as np
import pytest
from gltf_builder import QUAD, QUAD_TRIANGLE, GltfBuilder, mesh_glb, pack_glb, quad_builder, write
from PIL import Image

from baker.core.errors import BakerError, InputError
from baker.io.load import load_scene


def refuse(path, *words):
    """Assert that loading raises an InputError of one line that contains all `words`. Return the error."""
    with pytest.raises(InputError) as caught:
        load_scene(path)
    error = caught.value
    assert error.file is not None
    text = str(error)
    for word in words:
        assert word in text
    assert "\n" not in text
    assert error.exit_code == 3
    return error


def test_missing_file(tmp_path):
    error = refuse(tmp_path / "no.glb", "does not exist")
    assert error.file == str(tmp_path / "no.glb")


def test_folder(tmp_path):
    (tmp_path / "scene.glb").mkdir()
    refuse(tmp_path / "scene.glb", "is a folder")
    refuse(tmp_path, "is a folder")


@pytest.mark.parametrize("suffix", ["glb", "gltf", "obj", "ply", "stl", "off"])
def test_empty_and_senseless_files(tmp_path, suffix):
    path = tmp_path / f"a.{suffix}"
    refuse(write(path, b""), "is empty")
    for data in (b"\0" * 40, b"hello world, this is not a scene\n" * 3, bytes(range(256))):
        refuse(write(path, data), path.name)


def test_unknown_suffix_names_the_known_ones(tmp_path):
    refuse(write(tmp_path / "a.max", b"x"), "'.max'", ".glb", ".obj", ".ply")
    refuse(write(tmp_path / "a", b"x"), "no suffix", ".gltf")


def test_truncated_glb(tmp_path):
    data = quad_builder().glb()
    refuse(write(tmp_path / "a.glb", data[:10]), "cut off", "header")
    refuse(write(tmp_path / "a.glb", data[:-8]), "cut off", str(len(data)), str(len(data) - 8))


def test_broken_json(tmp_path):
    refuse(write(tmp_path / "a.gltf", b'{"asset": {"version": "2.0"'), "JSON is broken")
    refuse(write(tmp_path / "a.gltf", b'{"asset": "\xff"}'), "JSON is broken")
    refuse(write(tmp_path / "a.gltf", b"[1]"), "not an object")
    refuse(write(tmp_path / "a.gltf", b'{"asset": {"version": "2.0"}, "x": NaN}'), "JSON is broken")
    refuse(write(tmp_path / "a.gltf", b"[" * 200000), "nested too deeply")
    refuse(write(tmp_path / "a.gltf", b"{}"), "asset")


def test_other_versions_of_gltf(tmp_path):
    binary = bytearray(quad_builder().glb())
    binary[4] = 1
    refuse(write(tmp_path / "a.glb", bytes(binary)), "version 1", "glTF 2.0", "npx gltf-pipeline")
    old = {"asset": {"version": "1.0"}, "meshes": {"m": {}}}
    refuse(
        write(tmp_path / "a.gltf", json.dumps(old).encode()), "glTF 1.0", "asset.version", "npx gltf-pipeline"
    )
    new = {"asset": {"version": "2.1", "minVersion": "2.1"}}
    refuse(write(tmp_path / "a.gltf", json.dumps(new).encode()), "asset.minVersion")


@pytest.mark.parametrize("name", ["KHR_materials_subsurface", "ACME_magic"])
def test_required_extensions_are_refused_by_name(tmp_path, name):
    builder = quad_builder()
    builder.json["extensionsUsed"] = builder.json["extensionsRequired"] = [name]
    assert refuse(write(tmp_path / "a.glb", builder), "requires", name).object == name


def test_missing_and_short_outside_files(tmp_path):
    builder = quad_builder()
    builder.json["buffers"] = [{"byteLength": len(builder.blob), "uri": "gone.bin"}]
    refuse(write(tmp_path / "a.gltf", builder), "buffers[0].uri", "gone.bin", "missing")
    (tmp_path / "gone.bin").write_bytes(builder.blob[:-1])
    refuse(write(tmp_path / "a.gltf", builder), "buffers[0]", "too short", str(len(builder.blob)))
    builder.json["buffers"][0]["uri"] = "https://example.org/a.bin"
    refuse(write(tmp_path / "a.gltf", builder), "not a file beside the scene")
    builder.json["buffers"][0]["uri"] = "data:application/octet-stream;base64,@@@"
    refuse(write(tmp_path / "a.gltf", builder), "buffers[0].uri", "base64")
    builder.json["buffers"][0]["uri"] = "data:nothing"
    refuse(write(tmp_path / "a.gltf", builder), "no comma")
    builder = quad_builder(pbrMetallicRoughness={"baseColorTexture": {"index": 0}})
    builder.json |= {"images": [{"uri": "wood.png"}], "textures": [{"source": 0}]}
    refuse(write(tmp_path / "a.glb", builder), "images[0].uri", "wood.png", "missing")


def test_images_that_are_none(tmp_path):
    builder = quad_builder(emissiveTexture={"index": 0}, emissiveFactor=[1, 1, 1])
    builder.image(b"\x89PNG\r\n\x1a\n and then nothing")
    refuse(write(tmp_path / "a.glb", builder), "images[0]", "cannot be decoded")


def _set(path, value):
    def change(document):
        at = document
        for step in path[:-1]:
            at = at[step]
        at[path[-1]] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_set(["bufferViews", 0, "byteLength"], 10**6), ["bufferViews[0]", "outside its buffer"]),
        (_set(["bufferViews", 0, "byteOffset"], -4), ["bufferViews[0].byteOffset", "at least 0"]),
        (_set(["bufferViews", 0, "byteStride"], 4), ["accessors[0]", "byteStride"]),
        (_set(["bufferViews", 0, "buffer"], 3), ["bufferViews[0].buffer", "out of range"]),
        (_set(["accessors", 0, "count"], 5), ["accessors[0]", "outside its view"]),
        (_set(["accessors", 0, "byteOffset"], 400), ["accessors[0]", "outside its view"]),
        (_set(["accessors", 0, "count"], "4"), ["accessors[0].count", "expected an integer", "'4'"]),
        (_set(["accessors", 0, "count"], 0), ["accessors[0].count", "at least 1"]),
        (_set(["accessors", 0, "count"], 1e300), ["accessors[0].count", "too large"]),
        (_set(["accessors", 0, "componentType"], 5124), ["accessors[0]", "5124", "5126"]),
        (_set(["accessors", 0, "componentType"], 5123), ["accessors[0]", "POSITION must hold floats"]),
        (_set(["accessors", 0, "type"], "VEC2"), ["accessors[0].type", "VEC3"]),
        (_set(["accessors", 3, "componentType"], 5126), ["accessors[3].componentType", "5125"]),
        (_set(["accessors", 1, "count"], 3), ["attributes.NORMAL", "3 rows", "4"]),
        (
            _set(["meshes", 0, "primitives", 0, "indices"], 99),
            ["meshes[0].primitives[0].indices", "accessors"],
        ),
        (_set(["meshes", 0, "primitives", 0, "mode"], 7), ["primitives[0].mode", "7"]),
        (_set(["meshes", 0, "primitives", 0, "attributes"], {}), ["primitives[0]", "no POSITION"]),
        (_set(["meshes", 0, "primitives", 0, "material"], 4), ["primitives[0].material", "1 materials"]),
        (_set(["meshes", 0, "primitives"], {}), ["meshes[0].primitives", "expected a list"]),
        (_set(["meshes", 0], 5), ["meshes[0]", "expected an object"]),
        (_set(["nodes", 0, "mesh"], 1), ["nodes[0].mesh", "1 meshes"]),
        (_set(["nodes", 0, "mesh"], True), ["nodes[0].mesh", "expected an integer"]),
        (_set(["nodes", 0, "children"], [0]), ["nodes[0]", "cycle"]),
        (_set(["nodes", 0, "children"], [7]), ["nodes[0].children[0]", "out of range"]),
        (_set(["nodes", 0, "scale"], [1, 1]), ["nodes[0].scale", "3 numbers"]),
        (_set(["nodes", 0, "scale"], [1, "x", 1]), ["nodes[0].scale[1]", "expected a number"]),
        (_set(["nodes", 0, "translation"], [1e30, 0, 0]), ["nodes[0]", "further than"]),
        (_set(["nodes", 0, "translation"], [10**400, 0, 0]), ["nodes[0].translation[0]", "not finite"]),
        (_set(["nodes", 0, "rotation"], [0, 0, 0, 0]), ["nodes[0].rotation", "quaternion"]),
        (_set(["nodes", 0, "matrix"], [1] * 16), ["nodes[0].matrix", "affine"]),
        (_set(["scenes"], [{"nodes": [0, 0]}]), ["nodes[0]", "used twice"]),
        (_set(["scenes"], [{"nodes": []}]), ["scenes[0]", "no nodes"]),
        (_set(["scenes"], [{}]), ["scenes[0]", "no nodes"]),
        (_set(["scene"], 4), ["scene", "out of range"]),
        (_set(["nodes", 0], {}), ["scenes[0]", "nothing to bake"]),
        (_set(["materials"], [{"emissiveFactor": [1, 2]}]), ["materials[0].emissiveFactor", "3 numbers"]),
        (_set(["materials"], [{"alphaMode": "GLASS"}]), ["materials[0].alphaMode", "GLASS"]),
        (
            _set(["materials"], [{"emissiveTexture": {"index": 0}, "emissiveFactor": [1, 1, 1]}]),
            ["emissiveTexture.index", "0 textures"],
        ),
        (_set(["materials"], [{"doubleSided": 1}]), ["materials[0].doubleSided", "true or false"]),
        (_set(["materials"], [{"emissiveFactor": [-1, 0, 0]}]), ["materials[0]", "negative"]),
        (_set(["extensionsRequired"], "x"), ["extensionsRequired", "list of strings"]),
    ],
)
def test_wrong_members_are_named_with_their_place(tmp_path, change, words):
    document = copy.deepcopy(quad_builder(name="plain").document())
    change(document)
    refuse(write(tmp_path / "a.glb", pack_glb(document, quad_builder().blob)), *words)


@pytest.mark.parametrize(
    ("light", "words"),
    [
        ({"type": "area"}, ["lights[0].type", "area"]),
        ({"type": "point", "intensity": -1}, ["lights[0].intensity"]),
        ({"type": "point", "color": [1, 1]}, ["lights[0].color"]),
        ({"type": "spot", "spot": {"outerConeAngle": 2}}, ["outerConeAngle"]),
        ({"type": "spot", "spot": {"innerConeAngle": 1, "outerConeAngle": 0.5}}, ["innerConeAngle"]),
    ],
)
def test_wrong_lights(tmp_path, light, words):
    builder = quad_builder()
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    builder.json["nodes"][0]["extensions"] = {"KHR_lights_punctual": {"light": 0}}
    refuse(write(tmp_path / "a.glb", builder), *words)


def test_index_out_of_range_names_mesh_primitive_and_accessor(tmp_path):
    path = write(tmp_path / "a.glb", mesh_glb(QUAD, np.array([[0, 1, 2], [0, 2, 900]])))
    refuse(path, "meshes[0].primitives[0].indices", "index 900", "accessor 1", "4 vertices")


def test_long_cycles_and_shared_nodes(tmp_path):
    builder = quad_builder()
    builder.json["nodes"] = [{"children": [1], "mesh": 0}, {"children": [2]}, {"children": [0]}]
    builder.json["scenes"] = [{"nodes": [0]}]
    refuse(write(tmp_path / "a.glb", builder), "cycle", "0 -> 1 -> 2 -> 0")
    builder.json["nodes"] = [{"children": [2]}, {"children": [2]}, {"mesh": 0}]
    builder.json["scenes"] = [{"nodes": [0, 1]}]
    refuse(write(tmp_path / "a.glb", builder), "nodes[2]", "used twice", "node 0", "node 1")


def test_a_very_deep_tree_loads(tmp_path):
    builder = quad_builder()
    for k in range(5000):
        builder.node(children=[k], translation=[1, 0, 0])
    assert load_scene(write(tmp_path / "a.glb", builder)).instances[0].world_from_object[0, 3] == 5000


def test_files_that_hold_no_surface_say_so(tmp_path):
    builder = GltfBuilder()
    builder.node(mesh=builder.mesh(builder.primitive(QUAD, mode=0)))
    refuse(write(tmp_path / "points.glb", builder), "nothing to bake", "1 primitive of points or lines")
    nowhere = np.full_like(QUAD, np.nan)
    refuse(
        write(tmp_path / "nan.glb", mesh_glb(nowhere, QUAD_TRIANGLE)),
        "nothing to bake",
        "2 triangles with NaN",
    )
    flat = mesh_glb(QUAD * np.float32([1, 0, 0]), QUAD_TRIANGLE)
    refuse(write(tmp_path / "flat.glb", flat), "nothing to bake", "2 triangles without area")
    refuse(write(tmp_path / "empty.glb", GltfBuilder()), "nothing to bake")


def survives(path, data):
    """Load bytes that may be broken. Return True for a scene, False for a BakerError; raise other errors."""
    path.write_bytes(data)
    try:
        scene = load_scene(path)
    except BakerError:
        return False
    mesh = scene.meshes[0]
    assert np.isfinite(mesh.position).all()
    assert np.isfinite(mesh.normal).all()
    assert mesh.triangle.min() >= 0
    assert mesh.triangle.max() < len(mesh.position)
    return True


def _rich_scene():
    png = io.BytesIO()
    Image.new("RGB", (2, 2), (9, 99, 200)).save(png, "PNG")
    moved = {"KHR_texture_transform": {"offset": [0.5, 0], "rotation": 0.1}}
    builder = quad_builder(
        pbrMetallicRoughness={"baseColorTexture": {"index": 0, "extensions": moved}}, emissiveFactor=[1, 1, 0]
    )
    builder.image(png.getvalue())
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot"}]}}
    builder.node(extensions={"KHR_lights_punctual": {"light": 0}}, children=[0], scale=[1, 2, -1])
    return builder


def test_a_glb_cut_anywhere_never_surprises(tmp_path):
    data = _rich_scene().glb()
    path = tmp_path / "cut.glb"
    assert survives(path, data)
    assert not any(survives(path, data[:n]) for n in range(0, len(data), 64))


def test_flipped_bytes_never_surprise(tmp_path):
    data = _rich_scene().glb()
    text = _rich_scene().gltf()
    rng = np.random.default_rng(3)
    loaded = 0
    for round_ in range(600):
        source, path = ((data, tmp_path / "a.glb"), (text, tmp_path / "a.gltf"))[round_ % 2]
        broken = bytearray(source)
        for at in rng.integers(0, len(broken), 1 + round_ % 4):
            broken[at] = rng.integers(0, 256)
        loaded += survives(path, bytes(broken))
    assert 0 < loaded < 600


@pytest.mark.parametrize("strength", [1e16, 1e200])
def test_an_emission_too_strong_to_compute_with(tmp_path, strength):
    more = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    builder = quad_builder(name="lamp", emissiveFactor=[1, 1, 1], extensions=more)
    path = write(tmp_path / "a.glb", builder.glb())
    refuse(path, "material 'lamp'", "emission", "cd/m2")
    assert load_scene(path, lenient=True).materials
