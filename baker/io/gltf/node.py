"""Traverses a glTF node hierarchy and computes the world matrix of every node."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from baker.io.gltf.json import JsonObject

# Members of a node that change its matrix.
_MOVING = {"matrix", "rotation", "scale", "translation"}


@dataclass(frozen=True, slots=True)
class Placed:
    """A node of the loaded scene, with its world matrix.

    Attributes
    ----------
    index : int
    json : JsonObject
    matrix : (4, 4) float64, world from node
    """

    index: int
    json: JsonObject
    matrix: NDArray[np.float64]


def place_nodes(nodes: Sequence[JsonObject], roots: Sequence[int]) -> list[Placed]:
    """Return `roots` and all nodes below them: parents before children, children in the file's order.

    Nodes that KHR_node_visibility hides are left out together with their descendants.

    Parameters
    ----------
    nodes : sequence of JsonObject
        All nodes of the file; nodes that are not below a root may be broken.
    roots : sequence of int
        The scene's root nodes.

    Returns
    -------
    list of Placed
        The visible nodes with their world matrices.

    Raises
    ------
    InputError
        If nodes form a cycle, a node has two parents, or a matrix is not a finite affine map.
    """
    placed: list[Placed] = []
    parent: dict[int, int | None] = {}
    world = np.eye(4)
    waiting: list[tuple[int, int | None, NDArray[np.float64]]] = [(k, None, world) for k in reversed(roots)]
    while waiting:
        index, above, outer = waiting.pop()
        if index in parent:
            _refuse_second_parent(nodes, parent, index, above)
        parent[index] = above
        node = nodes[index]
        visibility = node.extension("KHR_node_visibility") if "extensions" in node else None
        if visibility is not None and not visibility.boolean("visible", True):
            continue
        matrix = outer
        # Skip the product for nodes without a transform, because files may have a million of them.
        if _MOVING & node.value.keys():
            with np.errstate(over="ignore", invalid="ignore"):
                matrix = outer @ local_matrix(node)
            if not np.isfinite(matrix).all():
                node.fail("the node's place in the world is not finite")
        placed.append(Placed(index, node, matrix))
        if "children" in node:
            children = node.indices("children", len(nodes), "nodes")
            waiting += [(k, index, matrix) for k in reversed(children)]
    return placed


def _refuse_second_parent(
    nodes: Sequence[JsonObject], parent: dict[int, int | None], index: int, above: int | None
) -> NoReturn:
    """Raise for a node that is reached twice, either through a cycle or because it has two parents."""
    ring: list[int] = []
    at = above
    while at is not None:
        ring.append(at)
        if at == index:
            downwards = [str(k) for k in (*reversed(ring), index)]
            shown = " -> ".join(downwards if len(downwards) < 9 else [*downwards[:7], "..."])
            nodes[index].fail(f"the nodes form a cycle ({shown}); a node may not be below itself")
        at = parent[at]
    first = parent[index]
    if first is None or above is None:
        nodes[index].fail("the node is used twice in the scene; a node may have one place only")
    nodes[index].fail(f"the node is used twice: below node {first} and below node {above}")


def local_matrix(node: JsonObject) -> NDArray[np.float64]:
    """Return a node's local matrix, from `matrix` or from translation, rotation and scale.

    Parameters
    ----------
    node : JsonObject
        The node.

    Returns
    -------
    (4, 4) float64
        The matrix that maps node space to the parent's space.

    Raises
    ------
    InputError
        If the length of the rotation quaternion is outside 1e-6 to 1e6, or the matrix is not affine.
    """
    if "matrix" in node:
        matrix = np.array(node.numbers("matrix", 16), np.float64).reshape(4, 4).T
        if np.abs(matrix[3] - (0.0, 0.0, 0.0, 1.0)).max() > 1e-6:
            node.fail("the matrix is not affine: its last row must be 0 0 0 1", "matrix")
        matrix[3] = (0.0, 0.0, 0.0, 1.0)
        return matrix
    turn = np.array(node.numbers("rotation", 4, (0.0, 0.0, 0.0, 1.0)), np.float64)
    length = float(np.sqrt((turn * turn).sum()))
    if not 1e-6 < length < 1e6:
        node.fail("the rotation is not a unit quaternion", "rotation")
    x, y, z, w = (float(v) for v in turn / length)
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= node.numbers("scale", 3, (1.0, 1.0, 1.0))
    matrix[:3, 3] = node.numbers("translation", 3, (0.0, 0.0, 0.0))
    return matrix
