"""Cuts a mesh into flat charts with xatlas. Only this file imports xatlas.

xatlas computes and packs charts in one call. Its packing stretches each chart to whole texels along u and v.
This module discards the positions of that packing. It also removes the stretch: for each chart, it fits
scales along u and v to the edge lengths in space, by least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.weld import connected_vertices, number_by_first

# Limit of a chart's area, as a multiple of the mean triangle area of its part (`uv.parts.cut_parts`). Small
# charts save time: with limits that gave 14, 46 and 123 charts, cutting a mesh of 82,000 triangles took 54 s,
# 3.6 s and 1.2 s.
CHART_FACES = 700


@dataclass(frozen=True)
class ChartJob:
    """P parts of meshes, which xatlas cuts independently of each other.

    Attributes
    ----------
    position : (V, 3) float64, any unit
        Vertices of all parts, welded by position.
    triangle : (T, 3) int32
        Vertex indices of each triangle, relative to the first vertex of its part.
    first_vertex, first_triangle : (P + 1,) int64
        Index of the first vertex and of the first triangle of each part. The last entries are V and T.
    """

    position: NDArray[np.float64]
    triangle: NDArray[np.int32]
    first_vertex: NDArray[np.int64]
    first_triangle: NDArray[np.int64]

    @property
    def n_parts(self) -> int:
        """Return the number of parts."""
        return len(self.first_triangle) - 1


@dataclass(frozen=True)
class FlatCharts:
    """Charts that are flattened but not packed. Different charts may overlap each other.

    Attributes
    ----------
    uv : (T, 3, 2) float64
        Uv of each triangle's corners, in the unit of the positions. The area of each chart equals the area of
        its triangles in space.
    chart : (T,) int32
        Chart of each triangle, from 0; -1 for triangles without a usable chart.
    """

    uv: NDArray[np.float64]
    chart: NDArray[np.int32]


def cut_charts(job: ChartJob, chart_faces: int = CHART_FACES) -> FlatCharts:
    """Cut every part of a job into charts.

    Parameters
    ----------
    job : ChartJob
        The parts.
    chart_faces : int
        Limit of a chart's area, as a multiple of the mean triangle area of its part.

    Returns
    -------
    FlatCharts
        Charts, numbered over the whole job. Triangles that xatlas considers degenerate have chart -1. All
        triangles of a chart that is folded or lacks area in uv have chart -1, too; see `_drop_flat`.
    """
    part = np.repeat(np.arange(job.n_parts), np.diff(job.first_triangle))
    corner = job.position[job.triangle.astype(np.int64) + job.first_vertex[part][:, None]]
    area = 0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    texel, chart = _run_xatlas(job, area, chart_faces)
    found = np.flatnonzero(chart >= 0)
    if len(found):
        sized = _true_to_size(texel[found], corner[found], area[found], chart[found])
        texel[found] = sized
        chart[found] = _drop_flat(sized, area[found], chart[found])
    return FlatCharts(texel, chart)


def _run_xatlas(
    job: ChartJob, area: NDArray[np.float64], chart_faces: int
) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Return the corners (T, 3, 2) of the triangles, in texels of xatlas's page, and their charts (T,) or -1.

    area : (T,) float64, area of each triangle in space, in the squared unit of the positions
    """
    import xatlas

    n = len(job.triangle)
    chart_options = xatlas.ChartOptions()
    chart_options.max_chart_area = float(chart_faces)
    pack_options = xatlas.PackOptions()
    pack_options.texels_per_unit = 1e-3 / float(np.sqrt(max(n, 1)))
    pack_options.padding = 0
    pack_options.bilinear = False
    atlas = xatlas.Atlas()
    added = []
    for k in range(job.n_parts):
        faces = slice(job.first_triangle[k], job.first_triangle[k + 1])
        position = job.position[job.first_vertex[k] : job.first_vertex[k + 1]]
        total = float(area[faces].sum())
        if not total > 0:
            continue
        # Scale the mean triangle to an area of 1, because xatlas has absolute epsilons for lengths and areas.
        scale = float(np.sqrt((faces.stop - faces.start) / total))
        centre = 0.5 * (position.min(axis=0) + position.max(axis=0))
        atlas.add_mesh(
            ((position - centre) * scale).astype(np.float32), job.triangle[faces].astype(np.uint32)
        )
        added.append(k)
    uv, chart = np.zeros((n, 3, 2)), np.full(n, -1, np.int32)
    if not added:
        return uv, chart
    atlas.generate(chart_options, pack_options)
    if atlas.width == 0 or atlas.height == 0:
        return uv, chart
    n_charts = 0
    for m, k in enumerate(added):
        faces = slice(job.first_triangle[k], job.first_triangle[k + 1])
        _, index, packed = atlas.get_mesh(m)
        if len(index) != faces.stop - faces.start:
            continue
        uv[faces] = (packed.astype(np.float64) * (atlas.width, atlas.height))[index.astype(np.int64)]
        chart[faces] = n_charts + connected_vertices(index, len(packed))
        n_charts = int(chart[faces].max()) + 1
    return uv, chart


def _true_to_size(
    texel: NDArray[np.float64],
    corner: NDArray[np.float64],
    area: NDArray[np.float64],
    chart: NDArray[np.int32],
) -> NDArray[np.float64]:
    """Scale each chart along u and v to the edge lengths in space, then uniformly to the area in space.

    sqrt(a) and sqrt(b) are the scales along u and v. a and b are the least-squares solution of a du^2 + b
    dv^2 = length^2 over all edges of a chart. du and dv are the components of an edge in uv.

    texel : (T, 3, 2), uv of the corners; corner : (T, 3, 3), positions of the corners; area : (T,), areas of
    the triangles in space; chart : (T,), charts of the triangles. Returns (T, 3, 2).
    """
    n_charts = int(chart.max()) + 1
    edge_uv = np.roll(texel, -1, axis=1) - texel
    edge = np.roll(corner, -1, axis=1) - corner
    p, q = edge_uv[..., 0] ** 2, edge_uv[..., 1] ** 2
    length2 = np.einsum("tkx,tkx->tk", edge, edge)

    def sums(value: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.bincount(chart, weights=value.sum(axis=1), minlength=n_charts).astype(np.float64)

    pp, pq, qq = sums(p * p), sums(p * q), sums(q * q)
    pl, ql = sums(p * length2), sums(q * length2)
    determinant = pp * qq - pq * pq
    with np.errstate(divide="ignore", invalid="ignore"):
        a = (pl * qq - ql * pq) / determinant
        b = (ql * pp - pl * pq) / determinant
        even = (pl + ql) / (pp + 2 * pq + qq)
    good = np.isfinite(a) & np.isfinite(b) & (a > 0) & (b > 0)
    even = np.where(np.isfinite(even), even, 0.0)
    axis = np.sqrt(np.stack([np.where(good, a, even), np.where(good, b, even)], axis=1))
    uv = texel * axis[chart][:, None, :]
    e1, e2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    flat = np.bincount(
        chart, weights=0.5 * np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]), minlength=n_charts
    )
    real = np.bincount(chart, weights=area, minlength=n_charts)
    factor = np.sqrt(np.divide(real, flat, out=np.zeros(n_charts), where=flat > 0))
    return np.asarray(uv * factor[chart][:, None, None], dtype=np.float64)


def _drop_flat(
    uv: NDArray[np.float64], area: NDArray[np.float64], chart: NDArray[np.int32]
) -> NDArray[np.int32]:
    """Return renumbered charts (T,) int32: -1 for charts that are folded or lack area in uv.

    A chart gets -1 if more than a thousandth of its area is flipped, if faces with more than a thousandth of
    its area in space have almost no area in uv, or if its signed uv area is not finite or less than half of
    its area in space.

    uv : (T, 3, 2), corners; area : (T,), areas of the triangles in space; chart : (T,)
    """
    n_charts = int(chart.max()) + 1
    e1, e2 = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    signed = 0.5 * (e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0])
    total = np.bincount(chart, weights=signed, minlength=n_charts)
    real = np.bincount(chart, weights=area, minlength=n_charts)
    # For each chart, sum the area of faces whose signed area has the opposite sign of the chart's area. Such
    # faces overlap a neighbour.
    back = np.where(signed * np.sign(total)[chart] < 0, np.abs(signed), 0.0)
    fold = np.bincount(chart, weights=back, minlength=n_charts)
    # For each chart, sum the area in space of faces that have almost no area in the plane.
    lost = np.bincount(chart, weights=np.where(np.abs(signed) < 1e-4 * area, area, 0.0), minlength=n_charts)
    bad = (np.abs(total) < 0.5 * real) | (fold > 1e-3 * real) | (lost > 1e-3 * real) | ~np.isfinite(total)
    return number_by_first(np.where(bad[chart], -1, chart))
