"""Edges of a triangle mesh: the faces that meet at each, and the direction of each along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.weld import connected, number_by_first


@dataclass(frozen=True)
class Edges:
    """Half edges, sorted by edge.

    Attributes
    ----------
    face, corner : (H,) int64
        Face of each half edge, and the corner of it at which it starts.
    first, count : (E,) int64
        First half edge of each edge, and their number.
    low, high : (E,) int64
        Vertices of the edge, low < high.
    balance : (E,) int64
        Half edges from low to high minus those from high to low.
    """

    face: NDArray[np.int64]
    corner: NDArray[np.int64]
    first: NDArray[np.int64]
    count: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]
    balance: NDArray[np.int64]

    def connected_faces(self, n_faces: int) -> NDArray[np.int32]:
        """Return the (F,) component of each face; faces that share an edge are of one."""
        link = np.ones(len(self.face), bool)
        link[self.first] = False
        b = np.flatnonzero(link)
        return number_by_first(connected(self.face[b - 1], self.face[b], n_faces))

    def pairs(self, chosen: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return both half edges of the chosen edges (E,), which have two each."""
        return self.first[chosen], self.first[chosen] + 1


def find_edges(triangle: NDArray[np.int64]) -> Edges:
    """Find the edges of faces.

    Parameters
    ----------
    triangle : (F, 3) int64
        Welded corners, which differ within each face.

    Returns
    -------
    Edges
        All edges, ascending by their vertices.
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
    """Return the stable order of keys (N,) below `largest`, and the keys in this order.

    Sorting one number made of key and index takes a fifth of the time of a stable `argsort`.
    """
    n = len(key)
    if largest * max(n, 1) >= 2**63:
        order = np.argsort(key, kind="stable")
        return order, key[order]
    ordered, order = np.divmod(np.sort(key * n + np.arange(n)), max(n, 1))
    return order, ordered
