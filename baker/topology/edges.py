"""The edges of a triangle mesh: which faces meet at each, and in which direction they run along it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.weld import connected, number_by_first


@dataclass(frozen=True)
class Edges:
    """Half edges, sorted so that those of one edge stand together.

    Attributes
    ----------
    face, corner : (H,) int64
        Face of each half edge, and which of its corners it starts at.
    first, count : (E,) int64
        Where each edge's half edges start, and how many there are.
    low, high : (E,) int64
        The edge's vertices, low < high.
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
        """Return the (F,) component of each face: faces that share an edge."""
        link = np.ones(len(self.face), bool)
        link[self.first] = False
        b = np.flatnonzero(link)
        return number_by_first(connected(self.face[b - 1], self.face[b], n_faces))

    def pairs(self, chosen: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return both half edges of the chosen edges, which have two each."""
        return self.first[chosen], self.first[chosen] + 1


def find_edges(triangle: NDArray[np.int64]) -> Edges:
    """Find the edges of (F, 3) faces whose corners are welded and differ."""
    n = int(triangle.max(initial=0)) + 1
    begin = triangle.reshape(-1)
    end = np.roll(triangle, -1, axis=1).reshape(-1)
    low, high = np.minimum(begin, end), np.maximum(begin, end)
    order, ordered = _stable_order(low * n + high, n * n)
    new = np.ones(len(order), bool)
    new[1:] = ordered[1:] != ordered[:-1]
    first = np.flatnonzero(new)
    count = np.diff(np.append(first, len(order)))
    way = np.where(begin[order] < end[order], 1, -1)
    balance = np.add.reduceat(way, first) if len(first) else np.zeros(0, np.int64)
    at = order[first]
    return Edges(order // 3, order % 3, first, count, low[at], high[at], balance)


def _stable_order(key: NDArray[np.int64], largest: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the stable order of (N,) keys below `largest`, and the keys in this order.

    Sorting keys with their index in one number takes a fifth of the time of a stable `argsort`.
    """
    n = len(key)
    if largest * max(n, 1) >= 2**63:
        order = np.argsort(key, kind="stable")
        return order, key[order]
    ordered, order = np.divmod(np.sort(key * n + np.arange(n)), max(n, 1))
    return order, ordered
