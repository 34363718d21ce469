"""Rewrites scene.glb for Unreal Engine: materials become entries of `lightmap.json`, textures become files.

Unreal's importer would create lit materials. The script of the export creates its own materials instead, so
it needs neither the names nor the parameters of imported materials. The transforms of objects are converted
to Unreal's units and axes: cm, z up, left-handed. The position (x, y, z) m in glTF is (100 x, 100 z, 100 y).

Based on: Unreal Engine, GLTFCore, ConversionUtilities.h (axes, quaternions) and InterchangeGltfTranslator.cpp
(centimetres; the slots of a mesh have the names of its materials).
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import SceneWarning
from baker.exporters.common import SCENE_NAME, unique_name
from baker.io.gltf.json import JsonObject
from baker.io.gltf.node import place_nodes
from baker.io.gltf.surface import read_surface
from baker.io.images import decode_image
from baker.io.png import encode_png

TEXTURE_FOLDER = "textures"
# Blend modes of Unreal, by glTF's `alphaMode`.
BLEND = {"OPAQUE": "opaque", "MASK": "masked", "BLEND": "translucent"}
# Wrap modes by glTF's codes.
WRAP = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
# Formats that Unreal imports; others become PNG.
SUFFIX = {"image/png": ".png", "image/jpeg": ".jpg"}
CENTIMETRES = 100.0
# Extensions of materials and textures, which the rewritten scene no longer has.
_REMOVED = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "EXT_materials_", "MSFT_texture_dds")
_KEPT = ("KHR_materials_variants",)
# Largest absolute difference between an element of the unit axes and of the nearest rotation. Above it, a
# transform counts as sheared.
_SHEAR = 1e-3

Json = dict[str, Any]


def split_scene(document: Json, description: Json, binary: bytes) -> dict[str, bytes]:
    """Move materials and textures out of a scene, and add them and the places of objects to its description.

    Parameters
    ----------
    document : dict
        glTF document with unique node names. Its materials keep only names and factors.
    description : dict
        Content of `lightmap.json`; gets `materials` and `textures`, and each object `mesh`, `materials`,
        `location`, `rotation`, `scale` and `sheared`.
    binary : bytes
        The binary chunk with its 8-byte header.

    Returns
    -------
    dict of str to bytes
        The texture files, by path.
    """
    textures = _Textures(document, binary[8:])
    materials: dict[int, Json] = {}
    matrices = world_matrices(document)
    for entry in description["objects"]:
        mesh = document["meshes"][document["nodes"][entry["node"]]["mesh"]]
        entry["mesh"] = mesh["name"]
        numbers = dict.fromkeys(primitive.get("material") for primitive in mesh["primitives"])
        for number in numbers:
            if number is not None and number not in materials:
                materials[number] = _material(document, number, textures)
        entry["materials"] = [None if n is None else materials[n]["name"] for n in numbers]
        entry |= actor_transform(matrices[entry["node"]])
    description["materials"] = [materials[number] for number in sorted(materials)]
    description["textures"] = list(textures.entries.values())
    _simplify(document)
    return textures.files


def world_matrices(document: Json) -> dict[int, NDArray[np.float64]]:
    """Return the (4, 4) world matrix of each visible node of the scene."""
    nodes = [_object(node, f"nodes[{k}]") for k, node in enumerate(document["nodes"])]
    scenes = document.get("scenes")
    if scenes:
        roots = scenes[document.get("scene", 0)].get("nodes", [])
    else:
        inside = {child for node in document["nodes"] for child in node.get("children", [])}
        roots = [k for k in range(len(nodes)) if k not in inside]
    return {placed.index: placed.matrix for placed in place_nodes(nodes, roots)}


def actor_transform(matrix: NDArray[np.float64]) -> Json:
    """Return location (cm), rotation (quaternion x, y, z, w) and scale of an actor in Unreal's axes.

    A mirrored object has a negative scale. `sheared` is true if the axes of the matrix are not orthogonal;
    then the result is not exact, because actors cannot be sheared.
    """
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    if np.linalg.det(matrix[:3, :3]) < 0:
        scale[0] = -scale[0]
    axes = matrix[:3, :3] / np.where(scale == 0.0, 1.0, scale)
    left, _, right = np.linalg.svd(axes)
    turn = left @ right
    x, y, z, w = _quaternion(turn)
    return {
        "location": [CENTIMETRES * float(matrix[axis, 3]) for axis in (0, 2, 1)],
        "rotation": [-x, -z, -y, w],
        "scale": [float(scale[axis]) for axis in (0, 2, 1)],
        "sheared": bool(np.abs(turn - axes).max() > _SHEAR),
    }


def _quaternion(turn: NDArray[np.float64]) -> tuple[float, float, float, float]:
    """Return x, y, z, w of a rotation matrix."""
    # The symmetric matrix whose eigenvector of eigenvalue 1 is the quaternion (Bar-Itzhack).
    a, b, c = turn
    table = np.array(
        [
            [a[0] - b[1] - c[2], b[0] + a[1], c[0] + a[2], c[1] - b[2]],
            [b[0] + a[1], b[1] - a[0] - c[2], c[1] + b[2], a[2] - c[0]],
            [c[0] + a[2], c[1] + b[2], c[2] - a[0] - b[1], b[0] - a[1]],
            [c[1] - b[2], a[2] - c[0], b[0] - a[1], a[0] + b[1] + c[2]],
        ]
    )
    q = np.linalg.eigh(table)[1][:, -1]
    x, y, z, w = (float(v) for v in (q if q[3] >= 0 else -q))
    return x, y, z, w


class _Textures:
    """Collects the textures that materials use, as files.

    Parameters
    ----------
    document : dict
    data : bytes
        The single buffer of the document.

    Attributes
    ----------
    entries : dict of int to dict
        `file` and `wrap` of each texture, by its index.
    files : dict of str to bytes
    """

    def __init__(self, document: Json, data: bytes) -> None:
        self._document = document
        self._data = data
        self.entries: dict[int, Json] = {}
        self.files: dict[str, bytes] = {}

    def file(self, number: int) -> str:
        """Return the path of a texture's file."""
        if number not in self.entries:
            texture = self._document["textures"][number]
            source = texture.get("extensions", {}).get("EXT_texture_webp", texture)["source"]
            image = self._document["images"][source]
            sampler = self._document["samplers"][texture["sampler"]] if "sampler" in texture else {}
            view = self._document["bufferViews"][image["bufferView"]]
            start = view.get("byteOffset", 0)
            content = self._data[start : start + view["byteLength"]]
            suffix = SUFFIX.get(image.get("mimeType", ""))
            if suffix is None:
                suffix = ".png"
                content = encode_png(decode_image(content, file=SCENE_NAME, object=f"images[{source}]"))
            name = unique_name(str(image.get("name", "texture")), number, "t")
            path = f"{TEXTURE_FOLDER}/{name}{suffix}"
            self.files[path] = content
            wrap = [WRAP[sampler.get(key, 10497)] for key in ("wrapS", "wrapT")]
            self.entries[number] = {"file": path, "wrap": wrap}
        return str(self.entries[number]["file"])

    def lookup(self, info: Json | None) -> Json:
        """Return file, uv set and uv transform of a material's texture; the file is None if there is none."""
        if info is None:
            return {"file": None, "uv_set": 0, "scale_offset": [1.0, 1.0, 0.0, 0.0], "turned": False}
        moved = info.get("extensions", {}).get("KHR_texture_transform", {})
        return {
            "file": self.file(info["index"]),
            "uv_set": moved.get("texCoord", info.get("texCoord", 0)),
            "scale_offset": [*moved.get("scale", (1.0, 1.0)), *moved.get("offset", (0.0, 0.0))],
            "turned": math.remainder(moved.get("rotation", 0.0), math.tau) != 0.0,
        }


def _material(document: Json, number: int, textures: _Textures) -> Json:
    """Return the entry of a material in `lightmap.json`."""
    material = document["materials"][number]
    name = unique_name(str(material.get("name", "material")), number, "m")
    warnings: list[SceneWarning] = []
    surface = read_surface(_object(material, f"materials[{number}]"), name, warnings)
    extensions = material.get("extensions", {})
    strength = extensions.get("KHR_materials_emissive_strength", {}).get("emissiveStrength", 1.0)
    if "KHR_materials_unlit" in extensions:
        strength = 0.0
    emission = [strength * value for value in material.get("emissiveFactor", (0.0, 0.0, 0.0))]
    emissive = material.get("emissiveTexture") if any(emission) else None
    return {
        "name": name,
        "blend": BLEND[material.get("alphaMode", "OPAQUE")],
        "two_sided": material.get("doubleSided", False),
        "alpha_cutoff": material.get("alphaCutoff", 0.5),
        "base_color": list(surface.colour),
        "base_color_texture": textures.lookup(surface.holder.value.get(surface.texture)),
        "emission": emission,
        "emission_texture": textures.lookup(emissive),
    }


def _simplify(document: Json) -> None:
    """Remove textures from a document, and everything but names and factors from its materials."""
    for key in ("textures", "images", "samplers"):
        document.pop(key, None)
    for number, material in enumerate(document.get("materials", [])):
        name = unique_name(str(material.get("name", "material")), number, "m")
        kept = {key: material[key] for key in ("alphaMode", "alphaCutoff", "doubleSided") if key in material}
        material.clear()
        material |= {"name": name, **kept}
    for key in ("extensionsUsed", "extensionsRequired"):
        names = document.pop(key, [])
        left = [name for name in names if name in _KEPT or not name.startswith(_REMOVED)]
        if left:
            document[key] = left


def _object(value: Json, where: str) -> JsonObject:
    """Return a JSON object of scene.glb, with its path for messages."""
    return JsonObject(value, where, SCENE_NAME)
