"""Welds vertices that are equal, and finds connected components of triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.topology.unique_rows import FEW, unique_rows


def weld(*key: NDArray[np.floating]) -> NDArray[np.int32]:
    """Number rows by value: equal rows get the same number, in the order of first occurrence.

    Parameters
    ----------
    *key : (V, K) float arrays
        Two rows are equal if they are equal in all arrays; -0 equals 0.

    Returns
    -------
    (V,) int32
        Number of each row's value, from 0.
    """
    # + 0 makes -0 equal to 0.
    return unique_rows([array + 0.0 for array in key], len(key[0]))[1].astype(np.int32)


def number_rows(row: NDArray[np.float32]) -> NDArray[np.int64]:
    """Number rows by value: equal rows get the same number, in the order of a hash of the rows.

    -0 equals 0, and NaN equals NaN with the same bits.

    Parameters
    ----------
    row : (V, K) float32
        Rows.

    Returns
    -------
    (V,) int64
        Number of each row's value, from 0.

    Notes
    -----
    `unique_rows` is as fast, but numbers rows by first occurrence. `topology.closed_parts` adds areas in the
    order of the numbers. So with `unique_rows`, the last digits of bakes would change.
    """
    if not len(row):
        return np.zeros(0, np.int64)
    bits = np.ascontiguousarray(row + np.float32(0.0)).view(np.uint32)
    key = np.zeros(len(bits), np.uint64)
    for k in range(bits.shape[1]):
        key = (key ^ bits[:, k]) * np.uint64(0x9E3779B97F4A7C15)
        key ^= key >> np.uint64(29)
    order = np.argsort(key)
    ordered, sorted_key = bits[order], key[order]
    new = np.ones(len(order), bool)
    new[1:] = sorted_key[1:] != sorted_key[:-1]
    if (~new[1:] & (ordered[1:] != ordered[:-1]).any(axis=1)).any():
        return weld(row).astype(np.int64)
    number = np.zeros(len(order), np.int64)
    number[order] = np.cumsum(new) - 1
    return number


def connected_vertices(triangle: NDArray[np.integer], n_vertices: int) -> NDArray[np.int32]:
    """Return the piece of each triangle. The triangles of a piece are connected by shared vertices.

    Parameters
    ----------
    triangle : (T, 3) int
        Vertex indices of each triangle.
    n_vertices : int
        Number of vertices.

    Returns
    -------
    (T,) int32
        Piece of each triangle. Pieces are numbered in the order of their first triangles.
    """
    a = np.concatenate([triangle[:, 0], triangle[:, 1]])
    b = np.concatenate([triangle[:, 1], triangle[:, 2]])
    label = connected(a, b, n_vertices)
    return number_by_first(label[triangle[:, 0]])


def connected_faces(
    triangle: NDArray[np.integer],
    kind: NDArray[np.integer],
    normal: NDArray[np.float64] | None = None,
    min_dot: float = -1.0,
) -> NDArray[np.int32]:
    """Return the piece of each triangle. The triangles of a piece have one kind and are connected by edges.

    Parameters
    ----------
    triangle : (T, 3) int
        Vertex indices of each triangle.
    kind : (T,) int
        Kind of each triangle, at least 0. Edges do not connect triangles of different kinds.
    normal : (T, 3) float64, optional
        Unit normal of each triangle.
    min_dot : float
        If `normal` is given, an edge connects two triangles only if the dot product of their normals is above
        `min_dot`.

    Returns
    -------
    (T,) int32
        Piece of each triangle. Pieces are numbered in the order of their first triangles.
    """
    n = len(triangle)
    if n == 0:
        return np.zeros(0, np.int32)
    wide = triangle.astype(np.int64)
    ends = np.sort(np.stack([wide, np.roll(wide, -1, axis=1)], axis=2), axis=2).reshape(-1, 2)
    key = (ends[:, 0] * (int(wide.max()) + 1) + ends[:, 1]) * (int(kind.max()) + 1) + np.repeat(
        kind.astype(np.int64), 3
    )
    order = np.argsort(key, kind="stable")
    same = key[order][1:] == key[order][:-1]
    face = order // 3
    a, b = face[:-1][same], face[1:][same]
    if normal is not None:
        smooth = np.einsum("ex,ex->e", normal[a], normal[b]) > min_dot
        a, b = a[smooth], b[smooth]
    return number_by_first(connected(a, b, n))


def connected(a: NDArray[np.integer], b: NDArray[np.integer], n: int) -> NDArray[np.int64]:
    """Return the connected component of each node of a graph, named by its smallest node.

    Parameters
    ----------
    a, b : (m,) int
        The two nodes of each edge.
    n : int
        Number of nodes.

    Returns
    -------
    (n,) int64
        Smallest node in the component of each node.

    Notes
    -----
    `scipy.sparse.csgraph` has this function, but importing it takes 0.1 s.
    Based on: Zhang, Azad and Buluc, Parallel algorithms for finding connected components, 2020 (FastSV).
    """
    parent = np.arange(n)
    while len(a):
        up, down = parent[a], parent[b]
        low = np.minimum(up, down)
        for node in (up, down):
            np.minimum.at(parent, node, low)
        above = parent[parent]
        while (above != parent).any():
            parent, above = above, above[above]
        apart = parent[a] != parent[b]
        a, b = a[apart], b[apart]
    return parent


def number_by_first(label: NDArray[np.integer]) -> NDArray[np.int32]:
    """Renumber labels from 0 in the order of their first occurrence.

    Parameters
    ----------
    label : (N,) int
        Labels. A negative label means that the item has none.

    Returns
    -------
    (N,) int32
        New labels; -1 for negative labels.
    """
    if len(label) <= FEW:
        number: dict[int, int] = {}
        numbered = [number.setdefault(k, len(number)) if k >= 0 else -1 for k in label.tolist()]
        return np.array(numbered, np.int32)
    known, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    order = order[known[order] >= 0]
    rank = np.full(len(known), -1, np.int32)
    rank[order] = np.arange(len(order), dtype=np.int32)
    return np.asarray(rank[inverse], dtype=np.int32)
