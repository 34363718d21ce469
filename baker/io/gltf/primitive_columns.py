"""Reads the vertices of glTF primitives as bytes, and finds the primitives that must not be rewritten.

A primitive is rewritten only if all its vertex data can be reordered and nothing else in the file depends on
the order of its vertices.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import SourceDocument
from baker.io.gltf.accessor_bytes import gather_rows
from baker.io.gltf.packer import Json, objects

# Extensions of primitives and meshes that neither contain vertex data nor depend on the order of vertices.
_HARMLESS = frozenset({"KHR_materials_variants"})
_FLOAT = 5126


def read_columns(source: SourceDocument, primitive: Json) -> dict[str, NDArray[np.uint8]]:
    """Return the bytes of the vertex attributes of a primitive, by which vertices are compared.

    Parameters
    ----------
    source : SourceDocument
        The document.
    primitive : dict
        The primitive, glTF JSON.

    Returns
    -------
    dict of str to (V, B) uint8
        For each attribute name, the B bytes of each of the V vertices. In float attributes, -0 is replaced by
        0, except in application-specific attributes, whose names begin with `_`. An attribute that is
        malformed or has fewer elements than POSITION is left out.

    Raises
    ------
    InputError
        If an accessor's data cannot be read.
    """
    accessors = source.json["accessors"]
    rows = np.arange(accessors[primitive["attributes"]["POSITION"]]["count"], dtype=np.int32)
    column = {}
    for name, index in primitive["attributes"].items():
        if not _is_accessor(source.json, index) or accessors[index]["count"] < len(rows):
            continue
        data = gather_rows(source.json, source.buffers, index, rows)
        if accessors[index]["componentType"] == _FLOAT and not name.startswith("_"):
            # Adding 0 to a signalling NaN raises a warning.
            with np.errstate(invalid="ignore"):
                data = (np.ascontiguousarray(data).view("<f4") + np.float32(0.0)).view(np.uint8)
        column[name] = data
    return column


def why_locked(source: SourceDocument, mesh: int, primitive: Json) -> str:
    """Return the reason why a primitive must not be rewritten.

    Parameters
    ----------
    source : SourceDocument
        The document.
    mesh : int
        Index of the primitive's mesh in the file.
    primitive : dict
        The primitive, glTF JSON.

    Returns
    -------
    str
        The end of a sentence, such as "it is skinned"; empty if the primitive may be rewritten.
    """
    document = source.json
    holder = document["meshes"][mesh]
    malformed = _malformed(document, primitive)
    if malformed:
        return f"its {malformed} is malformed"
    if primitive.get("targets"):
        return "it has morph targets"
    skinned = any("skin" in node and node.get("mesh") == mesh for _, node in objects(document, "nodes"))
    if skinned or any(name.startswith("JOINTS_") for name in primitive["attributes"]):
        return "it is skinned"
    count = document["accessors"][primitive["attributes"]["POSITION"]]["count"]
    for name, index in primitive["attributes"].items():
        if document["accessors"][index]["count"] < count:
            return f"its attribute {name} has fewer elements than POSITION; export it again"
    named = [*primitive["attributes"].values(), *([primitive["indices"]] if "indices" in primitive else [])]
    if any("sparse" in document["accessors"][index] for index in named):
        return "it is stored as a sparse accessor"
    extended = [document["accessors"][index] for index in named]
    for thing in (primitive, holder, *extended):
        unknown = [name for name in thing.get("extensions", {}) if name not in _HARMLESS]
        if unknown:
            return f"its extension {unknown[0]} is not understood"
    return ""


def _malformed(document: dict[str, Any], primitive: Json) -> str:
    """Return the name of the first member of a primitive that is malformed, "" if there is none.

    An attribute or `indices` is malformed if it does not refer to a well-formed accessor. The importer checks
    only the members that a bake uses. This function checks all attributes.
    """
    if not isinstance(primitive.get("extensions", {}), dict):
        return "extensions"
    members = dict(primitive["attributes"])
    if "indices" in primitive:
        members["indices"] = primitive["indices"]
    for name, index in members.items():
        if not _is_accessor(document, index):
            return f"member {name}"
    return ""


def _is_accessor(document: dict[str, Any], index: Any) -> bool:
    """Return whether an index refers to an accessor whose count and buffer view are well-formed."""
    accessor = _item(document.get("accessors"), index)
    if accessor is None or not isinstance(accessor.get("count"), int):
        return False
    return (
        "bufferView" not in accessor or _item(document.get("bufferViews"), accessor["bufferView"]) is not None
    )


def _item(items: Any, index: Any) -> Json | None:
    """Return `items[index]` if it exists and is a JSON object with well-formed `extensions`, else None."""
    if not isinstance(items, list) or not isinstance(index, int) or not 0 <= index < len(items):
        return None
    item = items[index]
    return item if isinstance(item, dict) and isinstance(item.get("extensions", {}), dict) else None
