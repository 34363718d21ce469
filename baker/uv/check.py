"""Overlap and area of uv layouts, and the tolerances by which they are valid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Largest distance by which a valid lightmap uv may leave 0..1: exporters round.
RANGE_SLACK = 1e-4
# Largest share of the surface without uv area of a valid lightmap uv.
MOST_LOST = 0.01
# Largest share of samples covered twice in a valid page and in a valid chart: rounded borders may cross.
PAGE_TOLERANCE = 1e-3
CHART_TOLERANCE = 0.01
# Samples closer to an edge than this share of their spacing lie inside neither of its triangles.
EDGE_SLACK = 0.05


@dataclass(frozen=True)
class Overlap:
    """Multiple coverage of a layout, by groups of triangles.

    Attributes
    ----------
    covered, doubled : (G,) int64
        Samples inside each group's triangles, and those already covered by an earlier triangle.
    """

    covered: NDArray[np.int64]
    doubled: NDArray[np.int64]

    def overlaps(self, tolerance: float) -> NDArray[np.bool_]:
        """Return which groups share more than `tolerance` of their samples with earlier triangles, (G,)."""
        return (self.doubled > tolerance * self.covered) & (self.doubled > 2)


def page_overlap(uv: NDArray[np.floating], group: NDArray[np.integer], resolution: int) -> Overlap:
    """Count the samples of one page that are covered twice; 2 x 2 samples per texel up to 4096 texels.

    Parameters
    ----------
    uv : (T, 3, 2) float, page uv
    group : (T,) int
        Group of each triangle, in ascending order; overlap counts for the later group.
    resolution : int
        Page width in texels.

    Returns
    -------
    Overlap
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
    """Count the samples of each chart that are covered twice, on a grid of about 16 samples per triangle.

    Parameters
    ----------
    uv : (T, 3, 2) float64, any unit
    chart : (T,) int32, all at least 0

    Returns
    -------
    Overlap
        A group for each chart.
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
    """Return lower and upper corner, (n, 2) float64 each, of the charts of (T, 3, 2) uv."""
    low, high = np.full((n, 2), np.inf), np.full((n, 2), -np.inf)
    for axis in range(2):
        np.minimum.at(low[:, axis], chart, uv[..., axis].min(axis=1))
        np.maximum.at(high[:, axis], chart, uv[..., axis].max(axis=1))
    return low, high


def uv_area(uv: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the (T,) float64 unsigned areas of (T, 3, 2) uv triangles."""
    wide = np.asarray(uv, dtype=np.float64)
    e1, e2 = wide[:, 1] - wide[:, 0], wide[:, 2] - wide[:, 0]
    return np.asarray(0.5 * np.abs(e1[:, 0] * e2[:, 1] - e1[:, 1] * e2[:, 0]))
