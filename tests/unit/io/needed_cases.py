"""A glTF file with used and unused objects of each kind, and changes that each break one member."""

from __future__ import annotations

import base64
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from gltf_builder import QUAD, QUAD_NORMAL, QUAD_TRIANGLE, GltfBuilder
from io_scenes import IDENTITY, PICTURE

Document = dict[str, Any]
UV = QUAD[:, :2].copy()


def builder() -> GltfBuilder:
    """Return a glTF file with used and unused objects of each kind.

    Used objects: node 0 has mesh 0 with material 0, node 1 has the camera, node 2 has the light, and node 3
    is a joint. Images 0 to 3 are the base colour, normal, metallic-roughness and occlusion of material 0.

    Unused objects: node 4 is in no scene. Only this node has mesh 1, and only this mesh has material 1 with
    texture 4 and image 4. The last accessor is unused. Only its view reads buffer 1.
    """
    b = GltfBuilder()
    for _ in range(5):
        b.image(PICTURE, sampler=0)
    b.json["samplers"] = [{"wrapS": 33071}, {"wrapS": 33648}]
    moved = {"KHR_texture_transform": {"offset": [0.5, 0.0]}}
    b.add(
        "materials",
        {
            "name": "wall",
            "pbrMetallicRoughness": {
                "baseColorFactor": [0.5, 0.5, 0.5, 1.0],
                "baseColorTexture": {"index": 0, "extensions": moved},
                "metallicRoughnessTexture": {"index": 2},
            },
            "normalTexture": {"index": 1},
            "occlusionTexture": {"index": 3},
            "emissiveTexture": {"index": 0},
            "emissiveFactor": [1.0, 0.5, 0.0],
            "extensions": {"KHR_materials_clearcoat": {"clearcoatNormalTexture": {"index": 1}}},
        },
    )
    b.add("materials", {"name": "unused", "pbrMetallicRoughness": {"baseColorTexture": {"index": 4}}})
    more = {
        "NORMAL": QUAD_NORMAL,
        "TEXCOORD_0": UV,
        "TEXCOORD_2": UV,
        "TANGENT": np.float32([[1, 0, 0, 1]] * 4),
        "COLOR_0": np.full((4, 4), 0.5, np.float32),
        "_HEAT": np.float32([1, 2, 3, 4]),
    }
    first = b.primitive(QUAD, QUAD_TRIANGLE, material=0, **more)
    first["targets"] = [{"POSITION": b.accessor(QUAD), "NORMAL": b.accessor(QUAD_NORMAL)}]
    b.node(mesh=b.mesh(first, name="body"), name="shown")
    b.add("cameras", {"type": "perspective", "perspective": {"yfov": 0.7, "znear": 0.1}})
    b.node(camera=0, name="eye", translation=[0, 0, 5])
    b.json["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "point", "intensity": 5.0}]}}
    b.node(extensions={"KHR_lights_punctual": {"light": 0}}, name="lamp", translation=[0, 0, 2])
    b.node(name="joint")
    other = b.primitive(QUAD, QUAD_TRIANGLE, material=1, TEXCOORD_0=UV)
    b.node(mesh=b.mesh(other, name="spare"), name="apart")
    bind = {"type": "MAT4", "componentType": 5126, "bufferView": b.view(IDENTITY.tobytes()), "count": 1}
    b.add("skins", {"joints": [3], "inverseBindMatrices": b.add("accessors", bind)})
    times, moves = b.accessor(np.float32([0, 1])), b.accessor(np.zeros((2, 3), np.float32))
    channel = {"sampler": 0, "target": {"node": 3, "path": "translation"}}
    b.add("animations", {"channels": [channel], "samplers": [{"input": times, "output": moves}]})
    b.json["scenes"] = [{"nodes": [0, 1, 2, 3]}]
    b.json["scene"] = 0
    b.json["extensionsUsed"] = ["KHR_lights_punctual", "KHR_texture_transform", "KHR_materials_clearcoat"]
    b.json["buffers"] = [{"byteLength": len(b.blob)}, {"byteLength": 4, "uri": "data:;base64,AAAAAA=="}]
    view = b.add("bufferViews", {"buffer": 1, "byteLength": 4, "name": "spare"})
    spare = {"bufferView": view, "componentType": 5121, "count": 4, "type": "SCALAR"}
    b.add("accessors", spare)
    return b


WHOLE = builder()
BLOB = WHOLE.blob
DOCUMENT = WHOLE.document()
FIRST = DOCUMENT["meshes"][0]["primitives"][0]
SPARE_ACCESSOR = len(DOCUMENT["accessors"]) - 1
SPARE_VIEW = len(DOCUMENT["bufferViews"]) - 1


def at(path: str, value: Any) -> Callable[[Document], None]:
    """Return a change that sets the member at a path such as "nodes.0.mesh". The value `...` deletes it."""

    def change(document: Document) -> None:
        holder: Any = document
        *steps, last = [int(s) if s.isdigit() else s for s in path.split(".")]
        for step in steps:
            holder = holder[step]
        if value is ...:
            del holder[last]
        else:
            holder[last] = value

    return change


def accessor(name: str, key: str, value: Any, holder: Document | None = None) -> Callable[[Document], None]:
    """Return a change that sets `key` of the accessor whose index is `holder[name]`.

    By default, `holder` is the attributes of the first primitive.
    """
    index = (FIRST["attributes"] if holder is None else holder)[name]
    return at(f"accessors.{index}.{key}", value)


def both(*changes: Callable[[Document], None]) -> Callable[[Document], None]:
    """Return a change that makes several changes one after the other."""

    def change(document: Document) -> None:
        for one in changes:
            one(document)

    return change


def bytes_of(name: str, data: bytes) -> Callable[[Document], bytes]:
    """Return a function that returns the buffer with `data` written over the start of an attribute's view."""

    def change(document: Document) -> bytes:
        index = FIRST["indices"] if name == "indices" else FIRST["attributes"][name]
        start = document["bufferViews"][document["accessors"][index]["bufferView"]]["byteOffset"]
        return BLOB[:start] + data + BLOB[start + len(data) :]

    return change


GONE = {"uri": "gone.png"}
TARGET = FIRST["targets"][0]
POSITION_VIEW = DOCUMENT["accessors"][FIRST["attributes"]["POSITION"]]["bufferView"]
SKIN = DOCUMENT["skins"][0]

# Changes that affect neither the bake nor its warnings.
SILENT = {
    "unused mesh is no object": at("meshes.1", 5),
    "unused mesh without primitives": at("meshes.1.primitives", ...),
    "unused mesh's index": at("meshes.1.primitives.0.indices", 999),
    "unused mesh's attribute": at("meshes.1.primitives.0.attributes.POSITION", -3),
    "unused mesh's attributes": at("meshes.1.primitives.0.attributes", [1, 2]),
    "unused mesh's material": at("meshes.1.primitives.0.material", 77),
    "unused mesh's targets": at("meshes.1.primitives.0.targets", 4),
    "unused mesh's extensions": at("meshes.1.primitives.0.extensions", 4),
    "unused material is no object": at("materials.1", "x"),
    "unused material's factor": at("materials.1.emissiveFactor", "red"),
    "unused material's texture": at("materials.1.pbrMetallicRoughness.baseColorTexture.index", 99),
    "unused node is no object": at("nodes.4", None),
    "unused node's mesh": at("nodes.4.mesh", 99),
    "unused node's mesh is a list": at("nodes.4.mesh", [0]),
    "unused node below itself": at("nodes.4.children", [4]),
    "unused node holds a used one": at("nodes.4.children", [0]),
    "unused node's matrix": at("nodes.4.matrix", [0, "x"]),
    "unused accessor is no object": at(f"accessors.{SPARE_ACCESSOR}", True),
    "unused accessor's count": at(f"accessors.{SPARE_ACCESSOR}.count", -1),
    "unused accessor's size": at(f"accessors.{SPARE_ACCESSOR}.count", 2**40),
    "unused accessor's type": at(f"accessors.{SPARE_ACCESSOR}.type", "VEC9"),
    "unused accessor's view": at(f"accessors.{SPARE_ACCESSOR}.bufferView", 999),
    "unused accessor's sparse": at(f"accessors.{SPARE_ACCESSOR}.sparse", {"count": 1}),
    "unused view is no object": at(f"bufferViews.{SPARE_VIEW}", []),
    "unused view's buffer": at(f"bufferViews.{SPARE_VIEW}.buffer", 8),
    "unused view's length": at(f"bufferViews.{SPARE_VIEW}.byteLength", 10**9),
    "unused view's offset": at(f"bufferViews.{SPARE_VIEW}.byteOffset", -4),
    "unused view without a length": at(f"bufferViews.{SPARE_VIEW}.byteLength", ...),
    "unused view's stride": at(f"bufferViews.{SPARE_VIEW}.byteStride", 1),
    "unused image without data": at("images.4", {}),
    "unused image's view": at("images.4.bufferView", 500),
    "unused texture without source": at("textures.4", {}),
    "unused texture's source": at("textures.4.source", 50),
    "unused texture's sampler": at("textures.4.sampler", 50),
    "unused sampler's wrap": at("samplers.1.wrapS", 1),
    "skin's matrices": at("skins.0.inverseBindMatrices", 999),
    "skin's matrices are no number": at("skins.0.inverseBindMatrices", "x"),
    "skin's joints": at("skins.0.joints", [99]),
    "skin is no object": at("skins.0", 3),
    "skin's data": accessor("inverseBindMatrices", "count", 99, SKIN),
    "animation's input": at("animations.0.samplers.0.input", 999),
    "animation without output": at("animations.0.samplers.0.output", ...),
    "animation's samplers": at("animations.0.samplers", {}),
    "animation's target": at("animations.0.channels.0.target.node", 99),
    "animation is no object": at("animations.0", "x"),
    "camera list": at("cameras.0.type", "orthographic"),
    "normal texture's sampler": at("textures.1.sampler", 9),
    "indices written as 0.0": both(
        at("nodes.0.mesh", 0.0),
        at("meshes.0.primitives.0.attributes.POSITION", float(FIRST["attributes"]["POSITION"])),
    ),
    "bounds of positions": accessor("POSITION", "min", [9, 9, 9]),
    "number beyond doubles in extras": at("extras", {"far": float("inf")}),
}

# Changes that give a warning and do not affect the bake: (change, code of the warning, text in its message).
WARNED = {
    "missing normal map": (at("images.1", GONE), "missing-texture", "normalTexture"),
    "missing metallic-roughness map": (at("images.2", GONE), "missing-texture", "metallicRoughnessTexture"),
    "missing occlusion map": (at("images.3", GONE), "missing-texture", "occlusionTexture"),
    "missing map of a layer": (at("images.1", GONE), "missing-texture", "clearcoatNormalTexture"),
    "normal map is text": (at("images.1", {"uri": "data:,hello"}), "missing-texture", "no image"),
    "normal map is cut off": (
        at("images.1", {"uri": "data:;base64," + base64.b64encode(PICTURE[:-20]).decode()}),
        "missing-texture",
        "cut off",
    ),
    "normal map on the web": (at("images.1", {"uri": "https://x.org/a.png"}), "missing-texture", "x.org"),
    "normal map's view": (at("images.1.bufferView", 999), "missing-texture", "images[1]"),
    "normal map without data": (at("images.1", {}), "missing-texture", "neither a uri"),
    "normal texture's index": (at("materials.0.normalTexture.index", 99), "missing-texture", "99"),
    "normal texture without index": (at("materials.0.normalTexture", {}), "missing-texture", "'index'"),
    "normal texture without source": (at("textures.1", {"sampler": 0}), "missing-texture", "textures[1]"),
    "occlusion texture's source": (at("textures.3.source", 99), "missing-texture", "textures[3]"),
    "missing unused image": (at("images.4", GONE), "missing-file", "gone.png"),
    "unused image is no object": (at("images.4", 1), "missing-file", "expected an object"),
    "missing unused buffer": (at("buffers.1.uri", "gone.bin"), "missing-file", "gone.bin"),
    "unused buffer without data": (at("buffers.1.uri", ...), "missing-file", "neither a uri"),
    "short unused buffer": (at("buffers.1.byteLength", 999), "missing-file", "too short"),
    "unused buffer without length": (at("buffers.1.byteLength", ...), "missing-file", "byteLength"),
    "unused buffer is no object": (at("buffers.1", 7), "missing-file", "expected an object"),
    "unknown extension": (at("extensionsUsed", ["ACME_magic"]), "extension-ignored", "ACME_magic"),
    "camera's index": (at("nodes.1.camera", 9), "broken-camera", "out of range"),
    "camera's field of view": (at("cameras.0.perspective.yfov", 7), "broken-camera", "yfov"),
    "camera without type": (at("cameras.0.type", ...), "broken-camera", "type"),
    "tangents outside their view": (accessor("TANGENT", "count", 99), "broken-attribute", "TANGENT"),
    "tangents of an unknown type": (accessor("TANGENT", "type", "V4"), "broken-attribute", "TANGENT"),
    "unread uv set": (accessor("TEXCOORD_2", "bufferView", 999), "broken-attribute", "TEXCOORD_2"),
    "custom attribute": (accessor("_HEAT", "componentType", 1), "broken-attribute", "_HEAT"),
    "attribute's index": (
        at("meshes.0.primitives.0.attributes._HEAT", -1),
        "broken-attribute",
        "_HEAT",
    ),
    "attribute that is no index": (
        at("meshes.0.primitives.0.attributes.TANGENT", {}),
        "broken-attribute",
        "TANGENT",
    ),
    "morph target": (accessor("POSITION", "bufferView", 999, TARGET), "broken-attribute", "morph target 0"),
}

# Changes that a bake refuses: (change, texts in the error message).
REFUSED = {
    "missing base colour": (at("images.0", GONE), ["images[0].uri", "gone.png", "missing"]),
    "base colour is text": (at("images.0", {"uri": "data:,hello"}), ["images[0]", "cannot be decoded"]),
    "base colour's index": (
        at("materials.0.pbrMetallicRoughness.baseColorTexture.index", 99),
        ["baseColorTexture.index", "5 textures"],
    ),
    "emissive texture's index": (at("materials.0.emissiveTexture.index", -1), ["emissiveTexture.index"]),
    "base colour without source": (at("textures.0", {}), ["textures[0]", "no image"]),
    "base colour's sampler": (at("textures.0.sampler", 9), ["textures[0].sampler", "2 samplers"]),
    "sampler's wrap": (at("samplers.0.wrapS", 3), ["samplers[0].wrapS"]),
    "used material is no object": (at("materials.0", 1), ["materials[0]", "expected an object"]),
    "material's index": (at("meshes.0.primitives.0.material", 9), ["primitives[0].material"]),
    "base colour factor": (
        at("materials.0.pbrMetallicRoughness.baseColorFactor", [1, 1]),
        ["baseColorFactor", "4 numbers"],
    ),
    "uv that is read": (accessor("TEXCOORD_0", "bufferView", 999), ["bufferView", "out of range"]),
    "positions' view": (accessor("POSITION", "bufferView", 999), ["bufferView", "out of range"]),
    "positions' component type": (accessor("POSITION", "componentType", 5122), ["POSITION must hold floats"]),
    "positions' type": (accessor("POSITION", "type", "VEC2"), ["VEC3"]),
    "positions' count": (accessor("POSITION", "count", -4), ["count", "at least 1"]),
    "positions' huge count": (accessor("POSITION", "count", 2**50), ["outside its view"]),
    "positions' stride": (
        at(f"bufferViews.{POSITION_VIEW}.byteStride", 4),
        ["byteStride of 4"],
    ),
    "huge count without data": (
        both(accessor("POSITION", "bufferView", ...), accessor("POSITION", "count", 2**40)),
        ["rows but no data"],
    ),
    "normals' count": (accessor("NORMAL", "count", 2), ["attributes.NORMAL", "2 rows"]),
    "normals' view": (accessor("NORMAL", "bufferView", 999), ["bufferView", "out of range"]),
    "colours' view": (accessor("COLOR_0", "bufferView", 999), ["bufferView", "out of range"]),
    "indices' view": (accessor("indices", "bufferView", 999, FIRST), ["bufferView", "out of range"]),
    "indices' component type": (accessor("indices", "componentType", 5126, FIRST), ["indices must have"]),
    "indices' signed type": (accessor("indices", "componentType", 5122, FIRST), ["indices must have"]),
    "sparse positions": (
        accessor(
            "POSITION",
            "sparse",
            {"count": 9, "indices": {"bufferView": 0, "componentType": 5125}, "values": {"bufferView": 999}},
        ),
        ["sparse"],
    ),
    "index out of range": (bytes_of("indices", struct.pack("<H", 900)), ["index 900", "4 vertices"]),
    "NaN positions": (bytes_of("POSITION", np.full(12, np.nan, "<f4").tobytes()), ["nothing to bake", "NaN"]),
    "used buffer too short": (at("buffers.0.byteLength", 10**6), ["buffers[0]", "too short"]),
    "used buffer gone": (at("buffers.0.uri", "gone.bin"), ["buffers[0].uri", "gone.bin"]),
    "used view outside": (at("bufferViews.5.byteLength", 10**6), ["bufferViews[5]", "outside its buffer"]),
    "node below itself": (at("nodes.0.children", [0]), ["nodes[0]", "cycle"]),
    "node with two parents": (
        both(at("nodes.1.children", [3]), at("nodes.2.children", [3]), at("scenes.0.nodes", [0, 1, 2])),
        ["nodes[3]", "used twice", "node 1", "node 2"],
    ),
    "root below another root": (at("nodes.0.children", [3]), ["nodes[3]", "used twice"]),
    "used node is no object": (at("nodes.0", 5), ["nodes[0]", "expected an object"]),
    "used mesh is no object": (at("meshes.0", 5), ["meshes[0]", "expected an object"]),
    "light's index": (at("nodes.2.extensions.KHR_lights_punctual.light", 4), ["light", "out of range"]),
    "samplers are no list": (at("samplers", 5), ["samplers", "expected a list"]),
    "meshes are no list": (at("meshes", {}), ["meshes", "expected a list"]),
    "extension required": (at("extensionsRequired", ["ACME_magic"]), ["ACME_magic", "requires"]),
}  # fmt: skip
