"""Emissive triangles as one light: a table of who emits how much, in clusters of neighbours.

    power = pi * area * mean luminance (twice that if two-sided)

Based on: see `kernels.emitters`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.kernels.emitters import (
    AREA,
    CLUSTER,
    CORNER,
    CUMULATIVE,
    NORMAL,
    RADIANCE,
    ROW_LENGTH,
    SHARE,
    TEXTURED,
    TWO_SIDED,
    Emitters,
    emitted_radiance,
)  # fmt: skip
from baker.trace.jit import kernel, scratch

# At most so many clusters are weighed for every tile of texels.
MAX_CLUSTERS = 256
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# Points a side of the grid that averages a textured emission over a triangle.
_GRID = 16
_rgba = scratch((4,), np.float64)


def build_emitters(geometry: Geometry, shading: Any) -> Emitters:
    """Find the triangles that emit and group them.

    Parameters
    ----------
    geometry : Geometry
    shading : Shading
        Materials as kernels see them.
    """
    candidate = np.flatnonzero((shading.emission.max(axis=1) > 0)[geometry.material] & (geometry.area > 0))
    material = geometry.material[candidate]
    luminance = shading.emission[material].astype(np.float64) @ _LUMINANCE
    textured = np.flatnonzero(shading.emission_texture[material] >= 0)
    if len(textured):
        mean = np.zeros(len(textured))
        _mean_luminance(shading, candidate[textured], _LUMINANCE, mean)
        luminance[textured] = mean
    power = np.pi * geometry.area[candidate] * luminance
    two_sided = geometry.double_sided[candidate]
    power = np.where(two_sided, 2.0 * power, power)
    chosen = np.flatnonzero(power > 0)
    triangle, power, two_sided = candidate[chosen], power[chosen], two_sided[chosen]
    order = _spatial_order(geometry, triangle)
    triangle, power, two_sided = triangle[order], power[order], two_sided[order]
    n_clusters = min(len(triangle), MAX_CLUSTERS)
    first = np.linspace(0, len(triangle), n_clusters + 1).round().astype(np.int32)
    cluster = np.repeat(np.arange(n_clusters, dtype=np.int32), np.diff(first))
    cluster_power = np.bincount(cluster, power, n_clusters)
    share = power / cluster_power[cluster]
    cumulative = np.cumsum(share) - np.arange(n_clusters)[cluster]
    corner = geometry.position[geometry.triangle[triangle]]
    centre, radius, axis, spread = _bounds(corner, geometry.face_normal[triangle], two_sided, first)
    row = np.zeros((len(triangle), ROW_LENGTH), np.float32)
    row[:, CORNER : CORNER + 9] = corner.reshape(-1, 9)
    row[:, NORMAL : NORMAL + 3] = geometry.face_normal[triangle]
    row[:, AREA] = geometry.area[triangle]
    row[:, TWO_SIDED] = two_sided
    row[:, SHARE] = share
    row[:, CUMULATIVE] = np.maximum(cumulative, 0)
    row[:, CLUSTER] = cluster
    row[:, RADIANCE : RADIANCE + 3] = shading.emission[geometry.material[triangle]]
    row[:, TEXTURED] = shading.emission_texture[geometry.material[triangle]] >= 0
    return Emitters(
        row, triangle.astype(np.int32), first, centre, radius, cluster_power.astype(np.float32), axis, spread
    )


def _spatial_order(geometry: Geometry, triangle: NDArray[np.int64]) -> NDArray[np.int64]:
    """Order triangles so that neighbours in space and facing follow each other; ties keep their order."""
    if not len(triangle):
        return np.zeros(0, np.int64)
    centre = geometry.position[geometry.triangle[triangle]].mean(axis=1).astype(np.float64)
    low = centre.min(axis=0)
    cell = ((centre - low) / max(float(np.ptp(centre, axis=0).max()), 1e-12) * 1023.0).astype(np.int64)
    key = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            key |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")


def _bounds(
    corner: NDArray[np.float32],
    normal: NDArray[np.float32],
    two_sided: NDArray[np.bool_],
    first: NDArray[np.int32],
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return sphere centre and radius, mean normal and largest angle to it for each cluster."""
    n = len(first) - 1
    centre, axis = np.zeros((n, 3), np.float32), np.zeros((n, 3), np.float32)
    radius, spread = np.zeros(n, np.float32), np.full(n, np.pi, np.float32)
    for c in range(n):
        span = slice(first[c], first[c + 1])
        points = corner[span].reshape(-1, 3)
        centre[c] = 0.5 * (points.min(axis=0) + points.max(axis=0))
        radius[c] = np.linalg.norm(points - centre[c], axis=1).max() * 1.0001
        mean = normal[span].mean(axis=0)
        length = float(np.linalg.norm(mean))
        if length > 0.1 and not two_sided[span].any():
            axis[c] = mean / length
            spread[c] = np.arccos(np.clip((normal[span] @ axis[c]).min(), -1.0, 1.0)) + 1e-3
    return centre, radius, axis, spread


@kernel
def _mean_luminance(shading, chosen, weights, out):  # type: ignore[no-untyped-def]
    """Average the luminance that textured triangles emit over a grid of points."""
    radiance = _rgba()
    for i in range(len(chosen)):
        t = chosen[i]
        total = 0.0
        for a in range(_GRID):
            for b in range(_GRID):
                u, v = (a + 0.5) / _GRID, (b + 0.5) / _GRID
                if u + v > 1.0:
                    u, v = 1.0 - u, 1.0 - v
                emitted_radiance(shading, t, u, v, radiance)
                total += radiance[0] * weights[0] + radiance[1] * weights[1] + radiance[2] * weights[2]
        out[i] = total / (_GRID * _GRID)
