"""Writes a glTF document with some primitives edited or replaced, and with its image files embedded."""

from __future__ import annotations

import copy
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import SourceDocument
from baker.io.gltf.accessor_bytes import gather_rows
from baker.io.gltf.dangling import break_dangling
from baker.io.gltf.edited_primitive import EditedPrimitive, ReplacedPrimitive
from baker.io.gltf.packer import COMPONENT, Json, Packer, primitive_accessors
from baker.io.gltf.write_baked import embed_images


def write_fixed(
    source: SourceDocument, edits: Mapping[tuple[int, int], EditedPrimitive | ReplacedPrimitive]
) -> bytes:
    """Return a copy of the document with edited or replaced primitives, as GLB.

    Parameters
    ----------
    source : SourceDocument
        The document; not changed.
    edits : mapping of (int, int) to EditedPrimitive or ReplacedPrimitive
        (index of the mesh, index of the primitive in the mesh) to the new primitive.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    InputError
        If data of the source cannot be read.
    ResourceError
        If the result is too large for the format.
    """
    document = copy.deepcopy(source.json)
    replaced: set[int] = set()
    for mesh, number in edits:
        primitive = document["meshes"][mesh]["primitives"][number]
        replaced.update(primitive_accessors(primitive))
        for key in ("attributes", "indices"):
            primitive.pop(key, None)
    break_dangling(document, source.buffers, source.missing)
    packer = Packer(document, source.buffers, frozenset(replaced), missing=source.missing)
    packer.chunks = source.chunks
    for (mesh, number), new in edits.items():
        primitive = document["meshes"][mesh]["primitives"][number]
        if isinstance(new, ReplacedPrimitive):
            _replace(packer, primitive, new)
        else:
            _rewrite(packer, source, source.json["meshes"][mesh]["primitives"][number], primitive, new)
        primitive["indices"] = packer.add_indices(new.triangle)
        # Strips and fans are written as triangle lists, the default mode.
        if primitive.get("mode", 4) != 4:
            del primitive["mode"]
    embed_images(packer, source)
    return packer.glb()


def _rewrite(
    packer: Packer, source: SourceDocument, old: Json, primitive: Json, new: EditedPrimitive
) -> None:
    """Write the reordered vertices of an edited primitive."""
    own: dict[str, NDArray[np.float32]] = {}
    if new.normal is not None:
        own["NORMAL"] = new.normal
    if new.uv is not None:
        own["TEXCOORD_1"] = new.uv
        if "TEXCOORD_0" not in old["attributes"]:
            # TEXCOORD numbers must be consecutive, so write the uv as TEXCOORD_0 as well.
            own["TEXCOORD_0"] = new.uv
    row = new.row.astype(np.int32)
    attributes = {}
    for name, index in old["attributes"].items():
        if name in own:
            continue
        accessor = source.json["accessors"][index]
        data = gather_rows(source.json, source.buffers, index, row)
        if name == "TANGENT" and new.turned.any():
            data = _turn_handedness(data, accessor, new.turned)
        attributes[name] = packer.add_rows(data, accessor, bounds=name == "POSITION")
    attributes.update({name: packer.add_floats(values) for name, values in own.items()})
    primitive["attributes"] = attributes


def _replace(packer: Packer, primitive: Json, new: ReplacedPrimitive) -> None:
    """Write the vertices of a replaced primitive."""
    attributes = {"POSITION": packer.add_floats(new.position, bounds=True)}
    if new.normal is not None:
        attributes["NORMAL"] = packer.add_floats(new.normal)
    if new.colour is not None:
        attributes["COLOR_0"] = packer.add_floats(new.colour)
    primitive["attributes"] = attributes


def _turn_handedness(data: NDArray[np.uint8], accessor: Json, turned: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """Return the tangents `data` (V, B), as bytes, with w negated at the vertices `turned` (V,).

    The normals of these vertices were reversed. Negating w keeps their bitangents.

    The bitangent is cross(normal, tangent.xyz) * tangent.w (glTF 2.0, section 3.7.2.1).
    """
    tangent = (
        np.ascontiguousarray(data).view(COMPONENT[accessor["componentType"]]).reshape(len(data), 4).copy()
    )
    # The lowest integer has no negative: replace it by the next one, which has the same normalised value.
    lowest = -1.0 if tangent.dtype.kind == "f" else -np.iinfo(tangent.dtype).max
    tangent[turned, 3] = -np.maximum(tangent[turned, 3], lowest)
    return tangent.view(np.uint8).reshape(len(data), -1)
