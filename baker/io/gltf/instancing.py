"""Expands EXT_mesh_gpu_instancing: each instance becomes a node, because each instance has its own texels.

The new nodes are appended to the document, as children of the node that has the extension. Existing indices
do not change.

Based on: EXT_mesh_gpu_instancing.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.core.errors import InputError
from baker.io.gltf.accessor import read_accessor
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject

INSTANCING = "EXT_mesh_gpu_instancing"
_MEMBERS = {
    "TRANSLATION": ("VEC3", "translation"),
    "ROTATION": ("VEC4", "rotation"),
    "SCALE": ("VEC3", "scale"),
}


def spread_instances(document: GltfDocument) -> None:
    """Replace the extension by child nodes. Nodes with broken instance data or without a mesh keep it.

    Parameters
    ----------
    document : GltfDocument
        Changed in place.
    """
    root = document.root.value
    if INSTANCING not in root.get("extensionsUsed", []) and INSTANCING not in root.get(
        "extensionsRequired", []
    ):
        return
    nodes = document.root.children("nodes")
    broken = False
    for index, node in enumerate(nodes):
        try:
            if "mesh" in node and node.extension(INSTANCING) is not None:
                _spread(document, node, index)
        except InputError:
            broken = True
    document.root.forget("nodes")
    if not broken:
        for key in ("extensionsUsed", "extensionsRequired"):
            if INSTANCING in root.get(key, []):
                root[key] = [name for name in root[key] if name != INSTANCING]
                if not root[key]:
                    del root[key]


def refuse_broken(document: GltfDocument, node: JsonObject) -> None:
    """Raise `InputError` for a node whose instances could not be read.

    Parameters
    ----------
    document : GltfDocument
        The document after `spread_instances`.
    node : JsonObject
        A node of the document.
    """
    if "mesh" in node and node.extension(INSTANCING) is not None:
        _members(document, node)


def _members(document: GltfDocument, node: JsonObject) -> list[dict[str, Any]]:
    """For each instance of a node, return a dict with the translation, rotation and scale of a glTF node."""
    extension = node.extension(INSTANCING)
    assert extension is not None
    attributes, accessors = extension.child("attributes"), document.root.children("accessors")
    columns = {}
    for key, (kind, member) in _MEMBERS.items():
        if key in attributes:
            at = attributes.index(key, len(accessors), "accessors")
            value = read_accessor(document, at, types=(kind,)).astype(np.float64)
            if not np.isfinite(value).all():
                attributes.fail("a number is not finite", key)
            columns[member] = value
    counts = {len(value) for value in columns.values()}
    if len(counts) > 1:
        attributes.fail("its accessors have different numbers of rows")
    count = counts.pop() if counts else _count(document, attributes)
    return [{member: value[k].tolist() for member, value in columns.items()} for k in range(count)]


def _count(document: GltfDocument, attributes: JsonObject) -> int:
    """Return the count of a node's first attribute; used if no attribute is part of a transform."""
    accessors = document.root.children("accessors")
    for key in attributes.value:
        return accessors[attributes.index(key, len(accessors), "accessors")].integer("count", minimum=1)
    return 0


def _spread(document: GltfDocument, node: JsonObject, index: int) -> None:
    """Replace the extension of one node by child nodes, one for each instance."""
    members = _members(document, node)
    value, nodes = node.value, document.root.value["nodes"]
    name = node.string("name", f"node_{index}")
    first = len(nodes)
    for k, transform in enumerate(members):
        nodes.append({"name": f"{name}_{k}", "mesh": value["mesh"], **transform})
    value["children"] = [*node.indices("children", first, "nodes"), *range(first, len(nodes))]
    del value["mesh"]
    del value["extensions"][INSTANCING]
    if not value["extensions"]:
        del value["extensions"]
