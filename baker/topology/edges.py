"""Finds the edges of a triangle mesh, the faces at each edge, and the directions of the faces along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.weld import connected, number_by_first


@dataclass(frozen=True)
class Edges:
    """The E edges of a mesh and their H half edges, which are sorted by edge.

    A half edge is one of the three sides of a face, directed by the face's winding.

    Attributes
    ----------
    face : (H,) int64
        Face of each half edge.
    corner : (H,) int64
        Corner of the face, 0 to 2, at which the half edge starts.
    first, count : (E,) int64
        Index of the first half edge of each edge, and the number of half edges of each edge.
    low, high : (E,) int64
        The two vertices of each edge, low < high.
    balance : (E,) int64
        Number of half edges from low to high, minus the number from high to low.
    """

    face: NDArray[np.int64]
    corner: NDArray[np.int64]
    first: NDArray[np.int64]
    count: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    balance: NDArray[np.int64]

    def connected_faces(self, n_faces: int) -> NDArray[np.int32]:
        """Return (F,) int32: the connected component of each face. Faces that share an edge are connected."""
        link = np.ones(len(self.face), bool)
        link[self.first] = False
        b = np.flatnonzero(link)
        return number_by_first(connected(self.face[b - 1], self.face[b], n_faces))

    def pairs(self, chosen: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return the two half edges of each edge in `chosen` (E,) bool, which must have exactly two."""
        return self.first[chosen], self.first[chosen] + 1


def find_edges(triangle: NDArray[np.int64]) -> Edges:
    """Find the edges of faces.

    Parameters
    ----------
    triangle : (F, 3) int64
        Vertices of each face, welded; the three vertices of a face must differ.

    Returns
    -------
    Edges
        All edges, sorted by (low, high).
    """
    n = int(triangle.max(initial=0)) + 1
    begin = triangle.reshape(-1)
    end = np.roll(triangle, -1, axis=1).reshape(-1)
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    order, ordered = _stable_order(low * n + high, n * n)
    new = np.ones(len(order), bool)
    new[1:] = ordered[1:] != ordered[:-1]
    first = np.flatnonzero(new)
    count = np.diff(np.append(first, len(order)))
    direction = np.where(begin[order] < end[order], 1, -1)
    balance = np.add.reduceat(direction, first) if len(first) else np.zeros(0, np.int64)
    at = order[first]
    return Edges(order // 3, order % 3, first, count, low[at], high[at], balance)


def _stable_order(key: NDArray[np.int64], largest: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the order (N,) that sorts keys (N,) below `largest` stably, and the sorted keys.

    If key and index fit into one number, these numbers are sorted, which is faster than a stable `argsort`.
    """
    n = len(key)
    if largest * max(n, 1) >= 2**63:
        order = np.argsort(key, kind="stable")
        return order, key[order]
    ordered, order = np.divmod(np.sort(key * n + np.arange(n)), max(n, 1))
    return order, ordered
