"""Finds faces of closed pieces that are wound against the others.

A piece is closed if each of its edges belongs to exactly two faces; then one of its sides is the outside.
If the vertex normals agree over most of the piece's area, the front is the side that they point to. Otherwise
it is the side that most of the area has as its front in the file; if that is half of it, the outside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.weld import connected, number_by_first

# The vertex normals decide if the mean of sign(vertex normal . face normal) over a piece's area is above
# this, in absolute value. For the mean, all faces are wound like the first one.
_CLEAR = 0.5


@dataclass(frozen=True)
class Winding:
    """Defects of the winding of a mesh's faces.

    Attributes
    ----------
    flip : (T,) bool
        Faces to be flipped.
    n_pieces : int
        Closed pieces with faces to be flipped.
    n_one_sided : int
        Closed pieces that cannot be wound consistently (like a Klein bottle).
    """

    flip: NDArray[np.bool_]
    n_pieces: int
    n_one_sided: int


def find_wrong_winding(
    position: NDArray[np.float32],
    corner: NDArray[np.int64],
    normal: NDArray[np.float32] | None,
    *,
    open_too: bool = False,
) -> Winding:
    """Find the faces of closed pieces with wrong winding.

    Parameters
    ----------
    position : (P, 3) float32
    corner : (T, 3) int64
        Rows of `position` of each face's corners. The three rows of a face differ, and corners of different
        faces at the same position have the same row.
    normal : (T, 3) float32 or None
        Mean of the vertex normals of each face, zero where the file has none.
    open_too : bool
        Include open pieces of which no edge belongs to more than two faces.

    Returns
    -------
    Winding
    """
    n = len(corner)
    edge = _Edges(corner)
    piece, closed = edge.pieces(n, open_too=open_too)
    closed_face = closed[piece]
    if not closed_face.any():
        return Winding(np.zeros(n, bool), 0, 0)
    first_side, one_sided = _orient(edge, n, closed_face)
    n_pieces_all = int(piece.max()) + 1
    faulty = np.bincount(piece, one_sided, n_pieces_all) > 0
    tested = closed_face & ~faulty[piece]

    a, b, c = (position[corner[:, k]].astype(np.float64) for k in range(3))
    double_area = np.cross(b - a, c - a)
    # +1: wound like the piece's first face, -1: against it.
    sign = np.where(first_side, 1.0, -1.0)
    area = np.linalg.norm(double_area, axis=1)
    # Signed volume of each piece, relative to one of its own corners to lose few digits.
    anchor = np.zeros((n_pieces_all, 3))
    anchor[piece[::-1]] = a[::-1]
    a, b, c = (p - anchor[piece] for p in (a, b, c))
    volume = np.bincount(piece, sign * np.einsum("ij,ij->i", a, np.cross(b, c)), n_pieces_all)
    total = np.maximum(np.bincount(piece, area, n_pieces_all), 1e-300)
    as_wound = np.bincount(piece, sign * area, n_pieces_all) / total
    by_normal = np.zeros(n_pieces_all)
    if normal is not None:
        agree = np.sign(np.einsum("ij,ij->i", double_area, normal.astype(np.float64)))
        by_normal = np.bincount(piece, sign * area * agree, n_pieces_all) / total
    # `right` is +1 if the first face of the piece is wound correctly, else -1. The normals decide it; if they
    # do not agree, the area; if that is balanced, the signed volume.
    outside = np.where(volume >= 0, 1.0, -1.0)
    leaning = np.where(np.abs(as_wound) > 1e-9, np.sign(as_wound), outside)
    right = np.where(np.abs(by_normal) > _CLEAR, np.sign(by_normal), leaning)
    flip = tested & (sign != right[piece])
    turned = np.bincount(piece, flip, n_pieces_all) > 0
    return Winding(flip, int(turned.sum()), int((closed & faulty).sum()))


def count_edges(corner: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of faces at each edge of a mesh, (E,) int64; `corner` (T, 3) are its faces."""
    return _Edges(corner).count


class _Edges:
    """The edges of (T, 3) triangles, sorted so that equal ones are neighbours.

    Attributes
    ----------
    face : (3T,) int64
        Face of each sorted half edge.
    rising : (3T,) bool
        The face runs along the edge from the lower vertex to the higher one.
    number : (3T,) int64
        Edge of each half edge.
    count : (E,) int64
        Faces at each edge.
    second : (K,) int64
        Sorted half edges whose predecessor belongs to the same edge.
    """

    def __init__(self, corner: NDArray[np.int64]) -> None:
        start, end = corner.ravel(), np.roll(corner, -1, axis=1).ravel()
        n_vertices = int(corner.max(initial=0)) + 1
        key = np.minimum(start, end) * n_vertices + np.maximum(start, end)
        order = np.argsort(key, kind="stable")
        ordered = key[order]
        self.face = order // 3
        self.rising = (start < end)[order]
        new = np.ones(len(order), bool)
        new[1:] = ordered[1:] != ordered[:-1]
        self.number = np.cumsum(new) - 1
        self.count = np.bincount(self.number)
        self.second = np.flatnonzero(~new)

    def pieces(self, n_faces: int, *, open_too: bool) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the (T,) piece of each face, and the (P,) mask of closed pieces.

        With `open_too`, a piece counts as closed if none of its edges belongs to more than two faces.
        """
        a, b = self.face[self.second - 1], self.face[self.second]
        piece = _components(a, b, n_faces)
        good = self.count <= 2 if open_too else self.count == 2
        open_face = self.face[~good[self.number]]
        closed = np.ones(int(piece.max(initial=-1)) + 1, bool)
        closed[piece[open_face]] = False
        return piece, closed


def _orient(
    edge: _Edges, n: int, closed_face: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Return the (n,) masks of faces wound like the first of their piece, and of faces of one-sided pieces.

    A graph has two nodes for each face: as it is (f), and flipped (f + n). Neighbours that run along their
    edge in opposite directions agree, so f is connected to g and f + n to g + n; otherwise f to g + n and
    f + n to g. A piece that can be oriented consists of two components, one for each side; in a one-sided
    piece f and f + n are connected.
    """
    second = edge.second[closed_face[edge.face[edge.second]]]
    a, b = edge.face[second - 1], edge.face[second]
    crossed = edge.rising[second - 1] == edge.rising[second]
    label = _components(
        np.concatenate([a, a + n]),
        np.concatenate([np.where(crossed, b + n, b), np.where(crossed, b, b + n)]),
        2 * n,
    )
    one_sided = label[:n] == label[n:]
    # Components are numbered by first occurrence, and unflipped faces come first.
    return label[:n] < label[n:], one_sided


def _components(a: NDArray[np.int64], b: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    return number_by_first(connected(a, b, n)).astype(np.int64)
