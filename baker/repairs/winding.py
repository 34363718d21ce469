"""Finds faces whose winding disagrees with the intended front of their closed piece.

A piece is a set of faces that are connected by edges. It is closed if each of its edges belongs to exactly
two faces. The intended front of a piece is determined by the first rule that gives an answer:

1. the side to which the vertex normals point, if they agree over most of the piece's area;
2. the side that is the front of more than half of the area in the file;
3. the outside, by the signed volume.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.weld import connected, number_by_first

# Rule 1 applies if |m| is above this value, where m is the area-weighted mean of sign(vertex normal . face
# normal) over a piece. For this mean, all faces are wound consistently with the first face of the piece.
_CLEAR = 0.5


@dataclass(frozen=True)
class Winding:
    """The faces of a mesh to flip, and counts of its closed pieces.

    Attributes
    ----------
    flip : (T,) bool
        The faces to flip.
    n_pieces : int
        Number of closed pieces with faces to flip.
    n_one_sided : int
        Number of closed pieces that cannot be wound consistently, such as a Klein bottle.
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
        The faces, as indices into `position`. The three indices of a face differ, and corners at the same
        position have the same index.
    normal : (T, 3) float32 or None
        Mean vertex normal of each face, zero for faces without vertex normals.
    open_too : bool
        Whether open pieces are included. Pieces with an edge of more than two faces are never included.

    Returns
    -------
    Winding
        The faces to flip.
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
    # Set `sign` to +1 for faces wound consistently with the first face of their piece, and -1 for the others.
    sign = np.where(first_side, 1.0, -1.0)
    area = np.linalg.norm(double_area, axis=1)
    # Compute the signed volume of each piece, relative to one of its corners to reduce rounding errors.
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
    # Set `right` to +1 if the first face of the piece is wound correctly, else to -1, by the first rule that
    # applies: normals, area, signed volume.
    outside = np.where(volume >= 0, 1.0, -1.0)
    leaning = np.where(np.abs(as_wound) > 1e-9, np.sign(as_wound), outside)
    right = np.where(np.abs(by_normal) > _CLEAR, np.sign(by_normal), leaning)
    flip = tested & (sign != right[piece])
    turned = np.bincount(piece, flip, n_pieces_all) > 0
    return Winding(flip, int(turned.sum()), int((closed & faulty).sum()))


def count_edges(corner: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the number of faces at each edge of a mesh, (E,) int64; `corner` (T, 3) are the mesh's faces."""
    return _Edges(corner).count


class _Edges:
    """The half edges of triangles (T, 3), sorted so that half edges of the same edge are consecutive.

    Attributes
    ----------
    face : (3T,) int64
        Face of each half edge.
    rising : (3T,) bool
        Whether the half edge runs from the vertex with the lower index to the one with the higher index.
    number : (3T,) int64
        Edge number of each half edge.
    count : (E,) int64
        Number of faces at each edge.
    second : (K,) int64
        Indices of the half edges whose predecessor in this order belongs to the same edge.
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
        """Return the piece of each face (T,), and the mask of closed pieces (P,).

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
    """Return two masks (n,): faces wound like the first face of their piece, faces of one-sided pieces.

    A graph has two nodes for each face: node f is the face as it is, and node f + n the flipped face. The
    edges of the graph depend on the half edges of two neighbouring faces f and g. If they run in opposite
    directions, the faces are wound consistently, and f is connected to g, and f + n to g + n. Otherwise f is
    connected to g + n, and f + n to g. A piece that can be oriented forms two components of the graph, one
    for each orientation. In a one-sided piece, f and f + n are in the same component.
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
    # Components are numbered by first occurrence, so the component with the unflipped first face is lower.
    return label[:n] < label[n:], one_sided


def _components(a: NDArray[np.int64], b: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    return number_by_first(connected(a, b, n)).astype(np.int64)
