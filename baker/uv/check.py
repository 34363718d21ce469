"""Computes overlap and area of uv layouts, and defines the tolerances of a valid lightmap uv."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Distance, in uv, by which a valid lightmap uv may exceed the range 0 to 1. It allows for rounding in
# exporters.
RANGE_SLACK = 1e-4
# Limit of the share of a mesh's surface that has no area in uv. Above this limit, the lightmap uv is not
# valid.
MOST_LOST = 0.01
# Share of samples that may be covered twice: of an object in a page (PAGE_TOLERANCE), and of a chart
# (CHART_TOLERANCE). They are not 0, because rounding may make borders cross.
PAGE_TOLERANCE = 1e-3
CHART_TOLERANCE = 0.01
# Limit of the distance of a sample from an edge, in units of the sample spacing. Up to this limit, the sample
# is inside neither of the triangles at the edge.
EDGE_SLACK = 0.05


@dataclass(frozen=True)
class Overlap:
    """Multiple coverage of a uv layout by G groups of triangles.

    Attributes
    ----------
    covered : (G,) int64
        Number of samples inside the triangles of each group.
    doubled : (G,) int64
        Number of those samples that an earlier triangle had covered already.
    """

    covered: NDArray[np.int64]
    doubled: NDArray[np.int64]

    def overlaps(self, tolerance: float) -> NDArray[np.bool_]:
        """Return (G,) bool: whether more than the share `tolerance` of a group's samples is covered twice.

        Up to two samples that are covered twice are ignored.
        """
        return (self.doubled > tolerance * self.covered) & (self.doubled > 2)


def page_overlap(uv: NDArray[np.floating], group: NDArray[np.integer], resolution: int) -> Overlap:
    """Count the samples of one page that triangles cover more than once.

    There are 2 x 2 samples per texel. If the page is more than 4096 texels wide, there is one sample per
    texel.

    Parameters
    ----------
    uv : (T, 3, 2) float
        Page uv of the triangles' corners.
    group : (T,) int
        Group of each triangle, ascending. If triangles of two groups overlap, the overlap is counted for the
        later group.
    resolution : int
        Page width, texels.

    Returns
    -------
    Overlap
        The counts of each group.
    """
    from baker.uv.kernels.uv_overlap import count_overlap

    side = resolution * (2 if resolution <= 4096 else 1)
    n = int(group.max()) + 1 if len(group) else 0
    covered, doubled = np.zeros(n, np.int64), np.zeros(n, np.int64)
    zero, full = np.zeros(n, np.int64), np.full(n, side, np.int64)
    mark = np.zeros(side * side, np.uint8)
    corner = np.ascontiguousarray(uv, dtype=np.float64) * side
    count_overlap(corner, group.astype(np.int64), zero, full, full, EDGE_SLACK, mark, covered, doubled)
    return Overlap(covered, doubled)


def chart_overlap(uv: NDArray[np.float64], chart: NDArray[np.int32]) -> Overlap:
    """Count the samples of each chart that its triangles cover more than once.

    Each chart has a separate grid of samples over its bounding box. The grid has about 16 samples per
    triangle of the chart, and at most about 1024 samples along an axis.

    Parameters
    ----------
    uv : (T, 3, 2) float64, any unit
        Uv of the triangles' corners.
    chart : (T,) int32
        Chart of each triangle, at least 0.

    Returns
    -------
    Overlap
        The counts of each chart.
    """
    from baker.uv.kernels.uv_overlap import count_overlap

    n = int(chart.max()) + 1 if len(chart) else 0
    covered, doubled = np.zeros(n, np.int64), np.zeros(n, np.int64)
    low, high = chart_bounds(uv, chart, n)
    count = np.bincount(chart, minlength=n)
    extent = np.maximum(high - low, 1e-30)
    spacing = np.sqrt(extent[:, 0] * extent[:, 1] / (16.0 * np.maximum(count, 1)))
    spacing = np.maximum(spacing, extent.max(axis=1, initial=0.0) / 1024.0)
    size = np.ceil(extent / spacing[:, None]).astype(np.int64) + 1
    cells = size[:, 0] * size[:, 1]
    base = np.concatenate([[0], np.cumsum(cells)])
    corner = (uv - low[chart][:, None, :]) / spacing[chart][:, None, None]
    mark = np.zeros(int(base[-1]), np.uint8)
    count_overlap(
        corner,
        chart.astype(np.int64),
        base[:-1],
        size[:, 0].copy(),
        size[:, 1].copy(),
        EDGE_SLACK,
        mark,
        covered,
        doubled,
    )
    return Overlap(covered, doubled)


def chart_bounds(
    uv: NDArray[np.float64], chart: NDArray[np.int32], n: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the lower and the upper corner (n, 2) float64 of the bounding box of each of n charts.

    uv : (T, 3, 2) float64, corners of the triangles; chart : (T,) int32, chart of each triangle
    """
    low, high = np.full((n, 2), np.inf), np.full((n, 2), -np.inf)
    for axis in range(2):
        np.minimum.at(low[:, axis], chart, uv[..., axis].min(axis=1))
        np.maximum.at(high[:, axis], chart, uv[..., axis].max(axis=1))
    return low, high


def uv_area(uv: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the unsigned areas (T,) float64 of uv triangles (T, 3, 2)."""
    wide = np.asarray(uv, dtype=np.float64)
    e1, e2 = wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0]
    return np.asarray(0.5 * np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]))
