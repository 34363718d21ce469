"""Walks a glTF node hierarchy and gives every node its world matrix."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.io.gltf_json import JsonObject


@dataclass(frozen=True)
class Placed:
    """A node of the chosen scene.

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
    """Return all nodes below `roots`, parents first, in the file's order of children.

    Parameters
    ----------
    nodes : sequence of JsonObject
        All nodes of the file.
    roots : sequence of int
        The scene's own nodes.

    Raises
    ------
    InputError
        If nodes form a cycle, a node has two places, or a matrix is not a finite affine map.
    """
    children = [node.indices("children", len(nodes), "nodes") for node in nodes]
    _check_tree(nodes, children)
    placed: list[Placed] = []
    seen: set[int] = set()
    waiting = [(k, np.eye(4)) for k in reversed(roots)]
    while waiting:
        index, parent = waiting.pop()
        if index in seen:
            nodes[index].fail("the node is used twice in the scene; a node may have one place only")
        seen.add(index)
        with np.errstate(over="ignore", invalid="ignore"):
            matrix = parent @ local_matrix(nodes[index])
        if not np.isfinite(matrix).all():
            nodes[index].fail("the node's place in the world is not finite")
        placed.append(Placed(index, nodes[index], matrix))
        waiting += [(k, matrix) for k in reversed(children[index])]
    return placed


def _check_tree(nodes: Sequence[JsonObject], children: Sequence[Sequence[int]]) -> None:
    parent: dict[int, int] = {}
    for index, below in enumerate(children):
        for child in below:
            if child in parent:
                nodes[child].fail(
                    f"the node is used twice: below node {parent[child]} and below node {index}"
                )
            parent[child] = index
    # With one parent each, every walk upwards ends at a root or goes round; known good nodes end it early.
    good: set[int] = set()
    for index in range(len(nodes)):
        path: dict[int, None] = {}
        at: int | None = index
        while at is not None and at not in good:
            if at in path:
                ring = [*path][[*path].index(at) :]
                # The walk went upwards; people read downwards.
                downwards = [str(k) for k in (ring[0], *reversed(ring[1:]), ring[0])]
                shown = " -> ".join(downwards if len(ring) < 8 else [*downwards[:7], "..."])
                nodes[at].fail(f"the nodes form a cycle ({shown}); a node may not be below itself")
            path[at] = None
            at = parent.get(at)
        good.update(path)


def local_matrix(node: JsonObject) -> NDArray[np.float64]:
    """Return a node's own (4, 4) float64 matrix, from `matrix` or from T R S.

    Raises
    ------
    InputError
        For a rotation of no length, or a matrix that is not affine.
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
