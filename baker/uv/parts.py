"""Cuts a mesh into parts that xatlas cuts well: connected, not too large, with similar normals."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.topology.weld import connected_faces, connected_vertices

# Largest number of triangles of a block, and of a job that bundles several parts. Larger blocks are halved.
JOB_TRIANGLES = 20_000
# Limit of the number of triangles of a connected part. Above this limit, the part is cut into blocks. The
# time of xatlas grows faster than linearly with the size of a part, and xatlas crashed on a part of 328,000
# triangles.
SPLIT_TRIANGLES = 40_000
# xatlas treats neighbours as one plane if their normals differ by less than about 2.5 degrees. xatlas joins
# such neighbours transitively, so that a finely tessellated sphere becomes one "planar" chart. SMOOTH_DOT is
# the cosine of a slightly larger angle, 3.1 degrees. Triangles joined by this rule form a region. A region of
# more than SMOOTH_TRIANGLES triangles is cut if it is not flat, see MIN_FACING.
SMOOTH_DOT = 0.9985
SMOOTH_TRIANGLES = 500
# Smallest cosine between the normals of a flat region and their mean; 0.77 is the cosine of about 40 degrees.
# A region with a smaller cosine is cut until no block has a smaller cosine.
MIN_FACING = 0.77


def cut_parts(position: NDArray[np.float64], triangle: NDArray[np.int32]) -> NDArray[np.int32]:
    """Divide a mesh into connected parts, and cut large or curved parts.

    Parameters
    ----------
    position : (V, 3) float64
        Vertices, in any unit, welded by position.
    triangle : (T, 3) int32
        Vertex indices of each triangle.

    Returns
    -------
    (T,) int32
        Part of each triangle.
    """
    part = connected_vertices(triangle, len(position))
    if len(triangle) <= SMOOTH_TRIANGLES:
        return part
    corner = position[triangle]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(cross, axis=1)
    normal = _unit(cross)
    region = connected_faces(triangle, part, normal, SMOOTH_DOT)
    n_regions = int(region.max()) + 1
    size = np.bincount(region, minlength=n_regions)
    sums = [np.bincount(region, weights=cross[:, k], minlength=n_regions) for k in range(3)]
    mean = np.stack(sums, axis=1).astype(np.float64)
    facing = np.einsum("tx,tx->t", cross, _unit(mean)[region])
    min_facing = np.ones(n_regions)
    np.minimum.at(min_facing, region, np.where(length > 0, facing / np.where(length > 0, length, 1.0), 1.0))
    curled = (min_facing < MIN_FACING) & (size > SMOOTH_TRIANGLES)
    large = np.bincount(part) > SPLIT_TRIANGLES

    block = np.zeros(len(triangle), np.int64)
    n = 1
    centre = corner.mean(axis=1)
    for r in np.flatnonzero(curled):
        n = _cut_blocks(block, n, np.flatnonzero(region == r), centre, normal, cross)
    for k in np.flatnonzero(large):
        n = _cut_blocks(block, n, np.flatnonzero((part == k) & ~curled[region]), centre, None, None)
    if n == 1:
        return part
    # Split blocks into parts connected by edges. Triangles that share only a vertex get separate parts.
    return connected_faces(triangle, part.astype(np.int64) * n + block)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return vectors (..., 3), scaled to unit length; zero vectors stay zero."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.asarray(vector / np.where(length > 0, length, 1.0))


def _cut_blocks(
    block: NDArray[np.int64],
    n: int,
    face: NDArray[np.int64],
    centre: NDArray[np.float64],
    normal: NDArray[np.float64] | None,
    cross: NDArray[np.float64] | None,
) -> int:
    """Halve a set of faces until each block has at most `JOB_TRIANGLES` faces.

    If `normal` is given, also halve blocks until their normals are similar (`MIN_FACING`). The blocks'
    numbers, from `n` on, are written to `block`. Returns the next free number.

    block : (T,) int64, in and out; face : (N,) int64, indices of the faces to cut
    centre, normal, cross : (T, 3) float64, centroids, unit normals, and normals whose length is twice the
    area
    """
    todo = [face]
    while todo:
        rows = todo.pop()
        if len(rows) == 0:
            continue
        if len(rows) > JOB_TRIANGLES:
            axis = int(np.ptp(centre[rows], axis=0).argmax())
            order = rows[np.argsort(centre[rows, axis], kind="stable")]
            todo += [order[len(order) // 2 :], order[: len(order) // 2]]
            continue
        if normal is not None and cross is not None and len(rows) > 1:
            facing = normal[rows] @ _unit(cross[rows].sum(axis=0))
            if facing.min() < MIN_FACING:
                axis = int(np.ptp(normal[rows], axis=0).argmax())
                value = normal[rows, axis]
                upper = value > 0.5 * (value.min() + value.max())
                if upper.any() and not upper.all():
                    todo += [rows[upper], rows[~upper]]
                    continue
        block[rows] = n
        n += 1
    return n
