"""Leaves out the lower levels of detail of MSFT_lod; only the first level of an object is baked.

Based on: MSFT_lod.
"""

from __future__ import annotations

from collections.abc import Sequence

from baker.core.errors import InputError
from baker.core.scene import SceneWarning
from baker.io.gltf.json import JsonObject
from baker.io.gltf.node import Placed

LOD = "MSFT_lod"


def without_lower_levels(
    placed: Sequence[Placed], n_nodes: int, warnings: list[SceneWarning]
) -> list[Placed]:
    """Return the nodes of a scene without lower levels of detail and the nodes below these.

    Parameters
    ----------
    placed : sequence of Placed
        The nodes of the scene, parents before children.
    n_nodes : int
        Number of nodes of the file.
    warnings : list of SceneWarning
        A warning is added if a node of the scene has lower levels, also if these are in no scene.

    Returns
    -------
    list of Placed
        The remaining nodes.
    """
    levels = {node.index: _levels(node.json, n_nodes) for node in placed if "extensions" in node.json}
    levels = {index: lower for index, lower in levels.items() if lower}
    if not levels:
        return list(placed)
    dropped = set().union(*levels.values())
    kept = []
    for node in placed:
        if node.index not in dropped:
            kept.append(node)
        elif "children" in node.json:
            dropped.update(node.json.indices("children", n_nodes, "nodes"))
    first = next(node for node in placed if node.index in levels)
    some = "the object has" if len(levels) == 1 else f"this object and {len(levels) - 1} more have"
    message = (
        f"{some} further levels of detail ({LOD}); the first level is baked, and the others neither block "
        "nor get light"
    )
    warnings.append(SceneWarning("lower-levels", message, first.json.string("name", f"node_{first.index}")))
    return kept


def _levels(node: JsonObject, n_nodes: int) -> set[int]:
    """Return the indices of the lower levels of a node; malformed ones are ignored."""
    try:
        extension = node.extension(LOD)
        found = extension.indices("ids", n_nodes, "nodes") if extension is not None else []
    except InputError:
        return set()
    return set(found)
