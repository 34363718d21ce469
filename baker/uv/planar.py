"""Makes planar charts for triangles that xatlas left out, or whose chart overlapped itself.

Connected faces whose normals have the same largest component, with the same sign, are projected to a plane.
If the projection distorts a triangle strongly, the triangle becomes a separate chart. If a projected chart
overlaps itself, each of its triangles becomes a separate chart.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.topology.weld import connected_faces, number_by_first
from baker.uv.check import CHART_TOLERANCE, chart_overlap


def planar_charts(
    position: NDArray[np.float64], triangle: NDArray[np.int32]
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return planar charts of triangles.

    Parameters
    ----------
    position : (V, 3) float64
        Vertices, in any unit, welded by position.
    triangle : (T, 3) int32
        Vertex indices of each triangle.

    Returns
    -------
    uv : (T, 3, 2) float64
        Uv of the triangles' corners, in the unit of `position`.
    chart : (T,) int32
        Chart of each triangle, from 0.
    """
    corner = position[triangle]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    # Join faces that share an edge if, of the six directions +x, -x, +y, -y, +z and -z, the same one is
    # closest to both normals.
    axis = np.abs(cross).argmax(axis=1)
    side = 2 * axis + (np.take_along_axis(cross, axis[:, None], axis=1)[:, 0] < 0)
    chart = connected_faces(triangle, side)
    n = int(chart.max()) + 1 if len(chart) else 0
    normal = np.stack([np.bincount(chart, weights=cross[:, k], minlength=n) for k in range(3)], axis=1)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.where(length > 0, normal / np.where(length > 0, length, 1.0), (0.0, 0.0, 1.0))
    tangent = np.cross(np.where(np.abs(normal[:, :1]) < 0.5, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), normal)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    bitangent = np.cross(normal, tangent)
    uv = np.stack(
        [np.einsum("tkx,tx->tk", corner, tangent[chart]), np.einsum("tkx,tx->tk", corner, bitangent[chart])],
        axis=2,
    )
    # Make a face a separate chart if its normal deviates by more than 75 degrees from the normal of its
    # chart, or if its chart overlaps itself.
    area = np.linalg.norm(cross, axis=1)
    facing = np.einsum("tx,tx->t", cross, normal[chart])
    alone = (
        np.where(facing < 0.25 * area, True, area == 0)
        | chart_overlap(uv, chart).overlaps(CHART_TOLERANCE)[chart]
    )
    uv[alone] = lay_flat(corner[alone])
    label = np.where(alone, n + np.arange(len(triangle)), chart)
    return uv, number_by_first(label)


def lay_flat(corner: NDArray[np.float64]) -> NDArray[np.float64]:
    """Map triangles (T, 3, 3) to congruent uv triangles (T, 3, 2) with the longest edge along u."""
    edge = np.roll(corner, -1, axis=1) - corner
    length = np.linalg.norm(edge, axis=2)
    first = length.argmax(axis=1)
    row = np.arange(len(corner))
    base = length[row, first]
    a, c = corner[row, first], corner[row, (first + 2) % 3]
    along = np.divide(edge[row, first], base[:, None], out=np.zeros_like(a), where=base[:, None] > 0)
    u = np.einsum("tx,tx->t", c - a, along)
    v = np.linalg.norm((c - a) - u[:, None] * along, axis=1)
    uv = np.zeros((len(corner), 3, 2))
    uv[row, (first + 1) % 3, 0] = base
    uv[row, (first + 2) % 3] = np.stack([u, v], axis=1)
    return uv
