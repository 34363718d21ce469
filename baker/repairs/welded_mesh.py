"""Builds meshes with one vertex for each position, and measures the distance between two such meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.repairs import meshlab
from baker.repairs.primitive_edit import EditablePrimitive
from baker.topology.triangle_check import usable_vertices, zero_area
from baker.topology.unique_rows import first_equal, unique_rows


@dataclass(frozen=True)
class WeldedMesh:
    """The faces of all primitives of a mesh, with one vertex for each position.

    Attributes
    ----------
    position : (P, 3) float32, object space
        The distinct positions.
    triangle : (T, 3) int64
        Indices into `position`.
    owner : (T,) int64
        Index of each face's primitive.
    row : (T, 3) int64
        Index of each corner's vertex in its primitive.
    """

    position: NDArray[np.float32]
    triangle: NDArray[np.int64]
    owner: NDArray[np.int64]
    row: NDArray[np.int64]

    @property
    def diagonal(self) -> float:
        """Return the length of the diagonal of the faces' bounding box, in object space."""
        used = self.position[self.triangle].reshape(-1, 3)
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0))) if len(used) else 0.0

    @property
    def corner(self) -> NDArray[np.float64]:
        """Return the corner positions, (T, 3, 3) float64."""
        return self.position[self.triangle].astype(np.float64)

    def take(self, keep: NDArray[np.bool_]) -> WeldedMesh:
        """Return the mesh with the faces that the (T,) mask `keep` selects."""
        return WeldedMesh(self.position, self.triangle[keep], self.owner[keep], self.row[keep])


def weld_primitives(primitives: Sequence[EditablePrimitive]) -> WeldedMesh:
    """Return one mesh of all primitives, without faces that have unusable coordinates or no area."""
    start = np.cumsum([0] + [len(p.arrays.position) for p in primitives])
    position = np.concatenate([p.arrays.position for p in primitives])
    row = np.concatenate([p.arrays.triangle for p in primitives])
    owner = np.repeat(np.arange(len(primitives)), [len(p.arrays.triangle) for p in primitives])
    vertex = row + start[owner][:, None]
    drawn = np.asarray(usable_vertices(position)[vertex].all(axis=1))
    drawn[drawn] = ~zero_area(position, vertex[drawn])
    kept, number = unique_rows([position + np.float32(0.0)], len(position))
    return WeldedMesh(position[kept], number[vertex[drawn]], owner[drawn], row[drawn])


def distance(one: WeldedMesh, two: WeldedMesh) -> float:
    """Return the Hausdorff distance: the largest distance from a point on either surface to the other.

    Faces that both meshes have contribute 0 and are not sampled.
    """
    largest = 0.0
    for sampled, target in ((one, two), (two, one)):
        own = np.ones(len(sampled.triangle), bool)
        if sampled.position is target.position:
            both = np.sort(np.concatenate([target.triangle, sampled.triangle]), axis=1)
            own = first_equal([both], len(both))[len(target.triangle) :] >= len(target.triangle)
        moved = meshlab.largest_distance(
            (sampled.position, sampled.triangle[own]), (target.position, target.triangle)
        )
        largest = max(largest, moved)
    return largest
