"""Finds triangles that form closed surfaces, and the side of each triangle that faces the enclosed space.

A part is a set of triangles of one object that are connected by edges. Open parts whose boundary edges
coincide are joined, so that a box made of six objects is closed as well. The file's windings may be
inconsistent, so triangles are reversed until neighbours traverse their shared edge in opposite directions.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.topology.edges import Edges, find_edges
from baker.topology.weld import connected, number_by_first, number_rows

# Limit of the area of a part's holes divided by the area of its triangles. Up to this limit, the part is
# closed.
SMALL_HOLES = 0.005
# Limit of the same ratio. Up to this limit, the part is watertight. The limit is above 0 to allow slits
# without width, where one edge meets two shorter edges.
NO_HOLES = 1e-6
# Limit of the volume of a part, divided by its area and by the largest distance of a vertex from the part's
# centre. Up to this limit, the part is treated as enclosing no space, because it is about as thin as the
# offsets of ray origins.
THINNEST = 1e-5
# Limit of the largest distance of a boundary loop from its plane, divided by the square root of the loop's
# area. Up to this limit, the loop is flat. A part without a lid has a single boundary loop, which is flat.
_FLAT = 0.1
# Limit of the area of the missing lid divided by the area of the part. Above this limit, the part is a sheet,
# not a part without a lid.
_WIDEST_LID = 0.9
# Limit of the distance of two vertices of different objects along each axis, divided by the largest
# coordinate of all vertices. Up to this limit, the vertices coincide.
_TOGETHER = 4e-7


class ClosedParts(NamedTuple):
    """The P parts of a scene of T triangles.

    Attributes
    ----------
    part : (T,) int32
        Part of each triangle, -1 for triangles that were left out. The common wall of two touching boxes of
        one object is left out as well.
    outward : (T,) int8
        1 if the triangle's normal points out of the space that its part encloses, -1 if it points into that
        space, 0 if the part encloses no space. Parts without a lid are treated as if they had a lid.
    closed : (P,) bool
        Whether the part encloses a space, with at most small holes.
    watertight : (P,) bool
        Whether the part is closed and has no holes.
    lidless : (P,) bool
        Whether the part is open, but a flat lid on its only hole would close it.
    area : (P,) float64
        Area of the part's triangles, m2.
    low, high : (P, 3) float64
        Lower and upper corner of the part's bounding box, metres.
    """

    part: NDArray[np.int32]
    outward: NDArray[np.int8]
    closed: NDArray[np.bool_]
    watertight: NDArray[np.bool_]
    lidless: NDArray[np.bool_]
    area: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


class _Pieces(NamedTuple):
    """The P pieces of F faces: sets of faces connected by edges, from which parts are made.

    Attributes
    ----------
    piece : (F,) int32
        Piece of each face.
    turn : (F,) int8
        -1 for faces that are reversed to make windings agree, else 1; see `_turns`.
    bad : (B,) int64
        Boundary edges: edges whose numbers of half edges in the two directions differ after the reversal.
    edges : Edges
        Edges of the faces.
    holes, area : (P,) float64
        For each piece, the area of its holes, and the area of its faces, m2.
    flat : (P,) bool
        Whether the piece has exactly one boundary loop, which is flat.
    """

    piece: NDArray[np.int32]
    turn: NDArray[np.int8]
    bad: NDArray[np.int64]
    edges: Edges
    holes: NDArray[np.float64]
    area: NDArray[np.float64]
    flat: NDArray[np.bool_]


def find_closed_parts(
    position: NDArray[np.float32],
    triangle: NDArray[np.integer],
    instance: NDArray[np.integer],
    used: NDArray[np.bool_],
) -> ClosedParts:
    """Find the parts of a scene, and which of them are closed.

    Parameters
    ----------
    position : (V, 3) float32, metres, world
        Vertices.
    triangle : (T, 3) int
        Indices of the triangles' vertices.
    instance : (T,) int
        Object of each triangle.
    used : (T,) bool
        False for triangles to leave out.

    Returns
    -------
    ClosedParts
        The parts.
    """
    n = len(triangle)
    part, outward = np.full(n, -1, np.int32), np.zeros(n, np.int8)
    rows = np.flatnonzero(used)
    vertex = _weld(position, triangle[rows], instance[rows])
    distinct = _distinct(vertex)
    rows, vertex = rows[distinct], vertex[distinct]
    if not len(rows):
        none = np.zeros((0, 3))
        nothing = np.zeros(0, bool)
        return ClosedParts(part, outward, nothing, nothing, nothing, np.zeros(0), none, none)
    first, same_winding = _twins(vertex)
    single = _single(vertex, first, same_winding)
    corner = position[triangle[rows[single]]].astype(np.float64)
    vertex = vertex[single]
    pieces = _pieces(vertex, corner)
    pieces = _join_objects(pieces, vertex, corner)
    whole = _enclosing(pieces, corner)
    number = np.full(len(rows), -1)
    number[single] = np.arange(len(single))
    of = number[first]
    part[rows] = np.where(of >= 0, pieces.piece[of], -1)
    outward[rows] = np.where(of >= 0, whole[of] * same_winding, 0)
    n_parts = len(pieces.area)
    closed = np.zeros(n_parts, bool)
    closed[pieces.piece[whole != 0]] = True
    lidless = closed & (pieces.holes > SMALL_HOLES * pieces.area)
    closed &= ~lidless
    order = np.argsort(pieces.piece, kind="stable")
    start = np.searchsorted(pieces.piece[order], np.arange(n_parts))
    a, b, c = (corner[order, k] for k in range(3))
    low = np.minimum.reduceat(np.minimum(np.minimum(a, b), c), start, axis=0)
    high = np.maximum.reduceat(np.maximum(np.maximum(a, b), c), start, axis=0)
    watertight = closed & (pieces.holes <= NO_HOLES * pieces.area)
    return ClosedParts(part, outward, closed, watertight, lidless, pieces.area, low, high)


def face_areas(corner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the areas (F,) float64, m2, of triangles.

    corner : (F, 3, 3) float64, positions of the corners, metres
    """
    (ux, uy, uz), (vx, vy, vz) = (corner[:, 1] - corner[:, 0]).T, (corner[:, 2] - corner[:, 0]).T
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    area: NDArray[np.float64] = 0.5 * np.sqrt(x * x + y * y + z * z)
    return area


def _distinct(vertex: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return (F,) bool: whether the three vertices (F, 3) of each face differ."""
    a, b, c = vertex.T
    distinct: NDArray[np.bool_] = (a != b) & (b != c) & (c != a)
    return distinct


def _weld(
    position: NDArray[np.float32], triangle: NDArray[np.integer], instance: NDArray[np.integer]
) -> NDArray[np.int64]:
    """Return welded vertices (F, 3) int64: corners with equal position and object get the same number."""
    marked = np.zeros(len(position), bool)
    marked[triangle.reshape(-1)] = True
    used = np.flatnonzero(marked)
    owner = np.zeros(len(position), np.float32)
    owner[triangle.reshape(-1)] = np.repeat(instance, 3)
    number = np.zeros(len(position), np.int64)
    number[used] = number_rows(np.concatenate([position[used], owner[used, None]], axis=1))
    welded: NDArray[np.int64] = number[triangle]
    return welded


def _twins(vertex: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """Return for each face the first face with the same corners, and whether the two windings agree.

    vertex : (F, 3) int64, welded vertices
    Returns (F,) int64, index of the first face; (F,) int8, 1 if the windings agree, -1 if they are opposite.
    """
    a, b, c = vertex.T
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    ordered = np.stack([low, a + b + c - low - high, high], axis=1)
    n = int(ordered.max(initial=0)) + 1
    # Find candidates by a hash of the three corners, because a number made of all three would overflow.
    key = (ordered[:, 0] * n + ordered[:, 1]).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    key ^= ordered[:, 2].astype(np.uint64) * np.uint64(0xBF58476D1CE4E5B9)
    order = np.argsort(key, kind="stable")
    of, winding = np.arange(len(vertex)), np.ones(len(vertex), np.int8)
    begin, end = order[:-1], order[1:]
    for k in np.flatnonzero(key[begin] == key[end]):
        if (ordered[begin[k]] == ordered[end[k]]).all():
            twin, first = int(end[k]), int(of[begin[k]])
            of[twin] = first
            turned = [np.roll(vertex[twin], shift).tolist() for shift in range(3)]
            winding[twin] = 1 if vertex[first].tolist() in turned else -1
    return of, winding


def _single(
    vertex: NDArray[np.int64], first: NDArray[np.int64], same_winding: NDArray[np.int8]
) -> NDArray[np.int64]:
    """Return the indices of the faces that form pieces.

    If several faces have the same corners, only the first is used. If two boxes of one object touch, their
    common wall occurs with both windings. The wall lies inside the union of the boxes and is left out. If all
    faces of a piece occur with both windings, none of them is left out.

    vertex : (F, 3) int64; first : (F,) int64, same_winding : (F,) int8, see `_twins`
    """
    single = np.flatnonzero(first == np.arange(len(first)))
    paired = np.zeros(len(first), bool)
    paired[first[same_winding < 0]] = True
    if not paired.any():
        return single
    piece = find_edges(vertex[single]).connected_faces(len(single))
    some = np.zeros(int(piece.max()) + 1, bool)
    some[piece[~paired[single]]] = True
    return single[~(paired[single] & some[piece])]


def _pieces(vertex: NDArray[np.int64], corner: NDArray[np.float64]) -> _Pieces:
    """Find the pieces of faces, make the windings of each piece agree, and measure the holes.

    vertex : (F, 3) int64, welded vertices; corner : (F, 3, 3) float64, positions of the corners, metres
    """
    n = len(vertex)
    edges = find_edges(vertex)
    piece = edges.connected_faces(n)
    n_pieces = int(piece.max(initial=-1)) + 1
    turn = _turns(edges, piece, n_pieces)
    half = np.repeat(np.arange(len(edges.first)), edges.count)
    begin = vertex[edges.face, edges.corner]
    direction = np.where(begin == edges.low[half], 1, -1) * turn[edges.face]
    balance = np.add.reduceat(direction, edges.first)
    total = np.bincount(piece, face_areas(corner), minlength=n_pieces).astype(np.float64)
    bad = np.flatnonzero(balance != 0)
    holes, flat = np.zeros(n_pieces), np.zeros(n_pieces, bool)
    if len(bad):
        loop, size, even = _loops(vertex, corner, edges, bad, balance[bad])
        owner = np.zeros(len(size), np.int64)
        owner[loop] = piece[edges.face[edges.first[bad]]]
        holes = holes + np.bincount(owner, size, minlength=n_pieces)
        count = np.bincount(owner, minlength=n_pieces)
        flat[owner[even]] = True
        flat &= count == 1
    return _Pieces(piece, turn, bad, edges, holes, total, flat)


def _loops(
    vertex: NDArray[np.int64],
    corner: NDArray[np.float64],
    edges: Edges,
    bad: NDArray[np.int64],
    balance: NDArray[np.int64],
) -> tuple[NDArray[np.int32], NDArray[np.float64], NDArray[np.bool_]]:
    """Find the loops that boundary edges form. Edges that share a vertex are in the same loop.

    vertex, corner : see `_pieces`; bad : (B,) int64, boundary edges
    balance : (B,) int64, `Edges.balance` of these edges after reversal of faces
    Returns the loop of each edge, (B,) int32; the area of each loop, (L,) float64, m2; and whether each loop
    is flat, (L,) bool.
    """
    name, ends = np.unique(np.stack([edges.low[bad], edges.high[bad]]), return_inverse=True)
    ends = ends.reshape(2, -1)
    loop = number_by_first(connected(ends[0], ends[1], len(name))[ends[0]])
    face, c = edges.face[edges.first[bad]], edges.corner[edges.first[bad]]
    begin, end = corner[face, c], corner[face, (c + 1) % 3]
    forward = (vertex[face, c] == edges.low[bad])[:, None]
    begin, end = np.where(forward, begin, end), np.where(forward, end, begin)
    count = np.bincount(loop)
    middle = np.stack([np.bincount(loop, begin[:, k]) / count for k in range(3)], axis=1)[loop]
    turned = 0.5 * balance[:, None] * np.cross(begin - middle, end - middle)
    vector = np.stack([np.bincount(loop, turned[:, k]) for k in range(3)], axis=1)
    size = np.linalg.norm(vector, axis=1)
    normal = vector / np.maximum(size, 1e-300)[:, None]
    away = np.zeros(len(count))
    np.maximum.at(away, loop, np.abs(np.einsum("bx,bx->b", begin - middle, normal[loop])))
    return loop, size, away <= _FLAT * np.sqrt(size)


def _turns(edges: Edges, piece: NDArray[np.int32], n_pieces: int) -> NDArray[np.int8]:
    """Return (F,) int8: -1 for faces to reverse, 1 for other faces.

    After the reversal, windings agree across all edges that exactly two faces share. A graph has two nodes
    for each face: one for its winding, and one for the reversed winding. If a winding of one face agrees with
    a winding of its neighbour, a graph edge connects the two nodes. Faces of a one-sided surface (a Moebius
    strip) keep their windings.
    """
    n = len(piece)
    turn = np.ones(n, np.int8)
    pair = edges.count == 2
    first = edges.first
    mixed = np.zeros(n_pieces, bool)
    mixed[piece[edges.face[first[pair & (edges.balance != 0)]]]] = True
    if not mixed.any():
        return turn
    chosen = np.flatnonzero(pair & mixed[piece[edges.face[first]]])
    a, b = edges.face[first[chosen]], edges.face[first[chosen] + 1]
    other = np.where(edges.balance[chosen] == 0, 0, n)
    label = connected(np.concatenate([a, a + n]), np.concatenate([b + other, b + n - other]), 2 * n)
    turn[label[:n] > label[n:]] = -1
    return turn


def _join_objects(pieces: _Pieces, vertex: NDArray[np.int64], corner: NDArray[np.float64]) -> _Pieces:
    """Join pieces whose boundary edges coincide, if the joined piece is closed.

    vertex, corner : see `_pieces`
    """
    edges, bad = pieces.edges, pieces.bad
    is_open = pieces.holes > SMALL_HOLES * pieces.area
    bad = bad[is_open[pieces.piece[edges.face[edges.first[bad]]]]]
    if len(bad) < 2:
        return pieces
    at = edges.first[bad]
    face, c = edges.face[at], edges.corner[at]
    ends = np.stack([corner[face, c], corner[face, (c + 1) % 3]]).reshape(-1, 3)
    label_of_end = _near_alike(ends, _TOGETHER * float(np.abs(corner).max(initial=0.0)))
    here = np.sort(label_of_end.reshape(2, -1), axis=0)
    _, key = np.unique(here[0] * (int(label_of_end.max()) + 1) + here[1], return_inverse=True)
    key = key.reshape(-1)
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    owner = pieces.piece[face].astype(np.int64)
    a, b = owner[order[:-1][same]], owner[order[1:][same]]
    if not len(a):
        return pieces
    group = connected(a, b, len(pieces.area))
    joined = np.zeros(len(pieces.area), bool)
    joined[np.unique(np.concatenate([group[a], group[b]]))] = True
    chosen = np.flatnonzero(joined[group[pieces.piece]])
    # Renumber vertices on boundaries by position, so that coincident vertices of different objects become
    # equal.
    shared = vertex.copy()
    base = int(vertex.max()) + 1
    renamed = np.arange(base)
    renamed[np.concatenate([vertex[face, c], vertex[face, (c + 1) % 3]])] = base + label_of_end
    shared = renamed[vertex[chosen]]
    distinct = _distinct(shared)
    chosen, shared = chosen[distinct], shared[distinct]
    again = _pieces(shared, corner[chosen])
    closes = again.holes <= SMALL_HOLES * again.area
    chosen_closes = closes[again.piece]
    if not chosen_closes.any():
        return pieces
    piece, turn = pieces.piece.astype(np.int64), pieces.turn.copy()
    piece[chosen[chosen_closes]] = len(pieces.area) + again.piece[chosen_closes]
    turn[chosen[chosen_closes]] = again.turn[chosen_closes]
    name, number = np.unique(piece, return_inverse=True)
    holes = np.concatenate([pieces.holes, again.holes])[name]
    # If a piece lost faces to a joined piece, its hole area and face area are not updated.
    area = np.concatenate([pieces.area, again.area])[name]
    flat = np.concatenate([pieces.flat, again.flat])[name]
    return pieces._replace(
        piece=number.reshape(-1).astype(np.int32), turn=turn, holes=holes, area=area, flat=flat
    )


def _near_alike(point: NDArray[np.float64], step: float) -> NDArray[np.int64]:
    """Number points (N, 3) by position: points close together get the same number. Return (N,).

    Two points get different numbers if, along any axis, the sorted coordinates of all points have a gap wider
    than `step` between them.
    """
    label = np.zeros(point.shape, np.int64)
    for axis in range(3):
        order = np.argsort(point[:, axis], kind="stable")
        label[order[1:], axis] = np.cumsum(np.diff(point[order, axis]) > step)
    xy = label[:, 0] * (int(label[:, 1].max()) + 1) + label[:, 1]
    _, xy = np.unique(xy, return_inverse=True)
    _, number = np.unique(xy.reshape(-1) * (int(label[:, 2].max()) + 1) + label[:, 2], return_inverse=True)
    return number.reshape(-1).astype(np.int64)


def _enclosing(pieces: _Pieces, corner: NDArray[np.float64]) -> NDArray[np.int8]:
    """Return (F,) int8: 1 if a face's normal points out of the space that its piece encloses, -1 if into it.

    The value is 0 for faces of pieces that enclose no space.

    corner : (F, 3, 3) float64, positions of the corners, metres
    """
    n_pieces = len(pieces.area)
    centre = (
        np.stack([np.bincount(pieces.piece, corner[:, 0, k], minlength=n_pieces) for k in range(3)], axis=1)
        / np.maximum(np.bincount(pieces.piece, minlength=n_pieces), 1)[:, None]
    )
    local = corner - centre[pieces.piece][:, None]
    six = np.einsum("fx,fx->f", local[:, 0], np.cross(local[:, 1], local[:, 2])) * pieces.turn
    volume = np.bincount(pieces.piece, six, minlength=n_pieces) / 6.0
    far = np.zeros(n_pieces)
    np.maximum.at(far, pieces.piece, np.einsum("fcx,fcx->fc", local, local).max(axis=1))
    thick = np.abs(volume) > THINNEST * np.sqrt(far) * pieces.area
    lidless = pieces.flat & (pieces.holes <= _WIDEST_LID * pieces.area)
    closed = thick & (lidless | (pieces.holes <= SMALL_HOLES * pieces.area))
    sign = np.where(volume < 0, -1, 1) * closed
    return (sign[pieces.piece] * pieces.turn).astype(np.int8)
