"""What uses the slope of a lightmap inside a chart: extrapolation and moves below one texel.

The slope at a texel is the weighted least-squares plane through the covered texels of its own chart in a
5 x 5 window, each placed at the centroid of its covered part.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels import page_slope
from baker.kernels.page_charts import chart_maxima
from baker.kernels.page_slope import N_CHANNEL_COLUMNS, N_COLUMNS, window_sums

RADIUS = 2
# A ridge in the normal equations: where the texels lie on one line, the slope across it comes out 0.
RIDGE = 1e-3
# How far a result may leave the range of the window's values, as a share of that range, and in units of the
# steps between the three texels behind it: the last step and, times CURVED, the one before.
HEADROOM = 0.5
STEEP, CURVED = 2.0, 3.0
# A plane must explain this share of the spread in a window before a value may leave the range of its chart.
STRAIGHT = 0.95
# Extrapolation stops growing this many texels outside the chart.
MAX_STEP = 2.0
# A value taken from a few texels must differ by this share to be believed instead of a plane's.
NOISY = 0.03
# A noisy slope counts by 1 - DOUBT / F, F its variance ratio: noise alone gives F = 1 on average.
DOUBT = 3.0
# Softens the weights of the wide windows of noisy pages.
_NOISY_FLAT = 4.0


@dataclass(frozen=True)
class Planes:
    """Planes fitted around n texels, per channel; `RADIUS` texels around them for `fit_planes`.

    Attributes
    ----------
    centre : (n, C) float64, value at the place of the texel
    across, down : (n, C) float64, slope per column and per row
    low, high : (n, C) float64, smallest and largest value in the window
    explained : (n, C) float64, share of the spread in the window that the plane explains
    """

    centre: NDArray[np.float64]
    across: NDArray[np.float64]
    down: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    explained: NDArray[np.float64]

    def at(self, index: NDArray[np.int64]) -> Planes:
        """Return the planes with these numbers."""
        return Planes(*(getattr(self, field.name)[index] for field in fields(self)))

    def limit(
        self, estimate: NDArray[np.float64], trend: Trend, highest: NDArray[np.float32]
    ) -> NDArray[np.float64]:
        """Return (n, C) estimates cut to the window's range, and a little more where there is a trend.

        Light never turns negative, and is brighter than the brightest texel of its chart, `highest` (n, C),
        only where it rises as evenly as a plane.
        """
        room = HEADROOM * (self.high - self.low)
        floor = self.low - np.minimum(room, trend.fall)
        floor[(self.low >= 0.0) & (floor < 0.0)] = 0.0
        limited = np.minimum(np.maximum(estimate, floor), self.high + np.minimum(room, trend.rise))
        even = np.maximum(self.explained - STRAIGHT, 0.0) / (1.0 - STRAIGHT)
        return limited - (1.0 - even) * np.maximum(limited - highest, 0.0)


class Trend(NamedTuple):
    """How much further values may rise and fall outwards of n texels, (n, C) float64, not negative.

    The two steps between a texel and those behind it must go the same way: then the value goes on as it
    came. At the edge of a shadow, between faces that differ and in noise they do not.
    """

    rise: NDArray[np.float64]
    fall: NDArray[np.float64]


class _Sums:
    """The normal equations of planes around n texels; every array is (n, 1) or (n, C) float64."""

    def __init__(
        self,
        value: NDArray[np.float32],
        chart: NDArray[np.int32],
        covered: NDArray[np.bool_],
        offset: NDArray[np.float32],
        texel: NDArray[np.int64],
        radius: int,
        flat: float,
    ) -> None:
        channels = value.shape[2]
        sums = np.zeros((len(texel), N_COLUMNS + N_CHANNEL_COLUMNS * channels))
        window_sums(value, chart, covered, offset, texel, radius, flat, sums)
        self._by_channel = sums[:, N_COLUMNS:].reshape(len(texel), channels, N_CHANNEL_COLUMNS)
        weight, sx, sy, sxx, sxy, syy, self.count = sums[:, :N_COLUMNS].T[..., None]
        self.mx, self.my = sx / weight, sy / weight
        cxx = sxx - sx * self.mx + RIDGE * weight
        cyy = syy - sy * self.my + RIDGE * weight
        cxy = sxy - sx * self.my
        determinant = cxx * cyy - cxy * cxy
        self.mean = self.channel(page_slope.WV) / weight
        self.bx = self.channel(page_slope.WXV) - sx * self.mean
        self.by = self.channel(page_slope.WYV) - sy * self.mean
        self.across = (cyy * self.bx - cxy * self.by) / determinant
        self.down = (cxx * self.by - cxy * self.bx) / determinant

    def channel(self, column: int) -> NDArray[np.float64]:
        """Return (n, C) of a column of `page_slope`."""
        return self._by_channel[:, :, column]

    def spread(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the weighted sum of squares about the mean, and what of it the plane explains, (n, C)."""
        spread = np.maximum(self.channel(page_slope.WVV) - self.mean * self.channel(page_slope.WV), 0.0)
        return spread, np.minimum(np.maximum(self.across * self.bx + self.down * self.by, 0.0), spread)


def fit_planes(
    value: NDArray[np.float32],
    chart: NDArray[np.int32],
    covered: NDArray[np.bool_],
    texel: NDArray[np.int64],
    offset: NDArray[np.float32] | None = None,
) -> Planes:
    """Fit a plane per channel to the texels of each chosen texel's chart around it.

    Parameters
    ----------
    value : (H, W, C) float32
    chart : (H, W) int32
    covered : (H, W) bool
    texel : (n,) int64
        Row * W + column of covered texels.
    offset : (H, W, 2) float32, optional
        Column and row offset of each value's place from its texel centre, texels; default all zero.
    """
    places = np.zeros((0, 0, 2), np.float32) if offset is None else offset
    s = _Sums(value, chart, covered, places, texel, RADIUS, 1.0)
    centre = s.mean - s.across * s.mx - s.down * s.my
    low, high = s.channel(page_slope.LOW), s.channel(page_slope.HIGH)
    spread, explained = s.spread()
    share = np.where(spread > 0.0, explained / np.where(spread > 0.0, spread, 1.0), 0.0)
    return Planes(centre, s.across, s.down, low, high, share)


def noisy_planes(
    value: NDArray[np.float32],
    chart: NDArray[np.int32],
    covered: NDArray[np.bool_],
    texel: NDArray[np.int64],
    radius: int,
) -> NDArray[np.float32]:
    """Fit a plane per channel around chosen texels of a noisy page, slopes shrunk by how sure they are.

    Parameters
    ----------
    value, chart, covered, texel : see `fit_planes`
    radius : int
        Half window; wider than for clean pages, since a slope has to rise above the noise.

    Returns
    -------
    plane : (n, 3, C) float32
        Value, slope per column and slope per row.
    """
    s = _Sums(value, chart, covered, np.zeros((0, 0, 2), np.float32), texel, radius, _NOISY_FLAT)
    # Explained against unexplained spread, per degree of freedom: the F ratio of the slope.
    spread, explained = s.spread()
    sure = (s.count > 3) & (explained > 0.0)
    left = (spread - explained) / np.where(s.count > 3, s.count - 3, 1.0)
    doubt = DOUBT * left / np.where(sure, explained / 2.0, 1.0)
    trust = np.where(sure, np.maximum(1.0 - doubt, 0.0), 0.0)
    centre = s.mean - trust * (s.across * s.mx + s.down * s.my)
    return np.stack([centre, trust * s.across, trust * s.down], axis=1).astype(np.float32)


def outward_trend(
    value: NDArray[np.float32],
    chart: NDArray[np.int32],
    covered: NDArray[np.bool_],
    texel: NDArray[np.int64],
    outward: NDArray[np.float64],
) -> Trend:
    """Return by how much values may leave their surroundings on a way outwards; see `Trend`.

    Parameters
    ----------
    value, chart, covered, texel : see `fit_planes`
    outward : (n, 2) float64
        The way (column, row), texels.
    """
    height, width = chart.shape
    reach = np.abs(outward).max(axis=1)
    step = np.rint(outward / np.maximum(reach, 1e-12)[:, None]).astype(np.int64)
    row, column = np.divmod(texel, width)
    behind = [value[row, column].astype(np.float64)]
    known = np.ones(len(texel), bool)
    for k in (1, 2):
        r, c = row - k * step[:, 1], column - k * step[:, 0]
        known &= (r >= 0) & (r < height) & (c >= 0) & (c < width)
        r, c = np.where(known, r, row), np.where(known, c, column)
        known &= covered[r, c] & (chart[r, c] == chart[row, column])
        behind.append(value[r, c].astype(np.float64))
    last, before = behind[0] - behind[1], CURVED * (behind[1] - behind[2])
    scale = (STEEP * reach * known)[:, None]
    rise, fall = np.minimum(last, before), np.minimum(-last, -before)
    return Trend(scale * np.maximum(rise, 0.0), scale * np.maximum(fall, 0.0))


def highest_of_charts(
    value: NDArray[np.float32], chart: NDArray[np.int32], covered: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return the largest value of each chart's covered texels, (n_charts, C) float32; -inf if it has none."""
    highest = np.full((int(chart.max(initial=-1)) + 1, value.shape[2]), -np.inf, np.float32)
    chart_maxima(value, chart, covered, highest)
    return highest


def extrapolate_outwards(
    value: NDArray[np.float32],
    chart: NDArray[np.int32],
    covered: NDArray[np.bool_],
    nearest: NDArray[np.int32],
    highest: NDArray[np.float32],
    pixels: int,
    grown: NDArray[np.bool_],
    first_row: int,
    end_row: int,
) -> None:
    """Continue each chart by its own slope into the empty texels near it, in place.

    Parameters
    ----------
    value : (H, W, C) float32, changed at grown texels in rows first_row to end_row - 1
    chart : (H, W) int32
    covered : (H, W) bool
    nearest : (H, W) int32, from `nearest_texel` of `covered`
    highest : (n_charts, C) float32, from `highest_of_charts`
    pixels : int
        How many rings of 8-neighbours a chart grows.
    grown : (H, W) bool, set at the texels that got a value
    """
    width = value.shape[1]
    rows = slice(first_row, end_row)
    row, column = np.nonzero(~covered[rows] & (nearest[rows] >= 0))
    row += first_row
    source = nearest[row, column].astype(np.int64)
    down, right = row - source // width, column - source % width
    ring = np.maximum(np.abs(down), np.abs(right))
    near = ring <= pixels
    if not near.any():
        return
    row, column, source = row[near], column[near], source[near]
    # Many texels continue the same one.
    border, owner = np.unique(source, return_inverse=True)
    plane = fit_planes(value, chart, covered, border)
    way = np.stack([right[near], down[near]], axis=1) * np.minimum(1.0, MAX_STEP / ring[near])[:, None]
    plane = plane.at(owner)
    trend = outward_trend(value, chart, covered, source, way)
    estimate = plane.centre + plane.across * way[:, :1] + plane.down * way[:, 1:]
    value[row, column] = plane.limit(estimate, trend, highest[chart.reshape(-1)[source]])
    grown[row, column] = True


def move_to_centre(
    value: NDArray[np.float32],
    chart: NDArray[np.int32],
    covered: NDArray[np.bool_],
    offset: NDArray[np.float32],
    smallest: float,
    highest: NDArray[np.float32],
    out: NDArray[np.float32],
    first_row: int,
    end_row: int,
) -> None:
    """Move each texel's value from the centroid of its covered part to the texel centre.

    Parameters
    ----------
    value : (H, W, C) float32
    chart : (H, W) int32
    covered : (H, W) bool
    offset : (H, W, 2) float32
        Centroid minus texel centre (column, row), texels.
    smallest : float
        Offsets below this are left alone, texels.
    highest : (n_charts, C) float32, from `highest_of_charts`
    out : (H, W, C) float32, changed in rows first_row to end_row - 1
    """
    row, column = _partly_covered(covered, offset, smallest, first_row, end_row)
    if not len(row):
        return
    texel, way = row * value.shape[1] + column, -offset[row, column].astype(np.float64)
    plane = fit_planes(value, chart, covered, texel, offset)
    estimate = value[row, column] + plane.across * way[:, :1] + plane.down * way[:, 1:]
    out[row, column] = plane.limit(
        estimate, outward_trend(value, chart, covered, texel, way), highest[chart[row, column]]
    )


def match_lookups(
    value: NDArray[np.float32],
    chart: NDArray[np.int32],
    covered: NDArray[np.bool_],
    offset: NDArray[np.float32],
    smallest: float,
    highest: NDArray[np.float32],
    moved: NDArray[np.float32],
    out: NDArray[np.float32],
    first_row: int,
    end_row: int,
) -> None:
    """Set each partly covered texel so that a bilinear lookup at its centroid finds what was measured there.

    Only where all texels of that lookup are covered and of one chart. What differs from `move_to_centre` by
    some per cent is left to that: a plane through many texels is less noisy. See `Planes.limit`, too.

    Parameters
    ----------
    value, chart, covered, offset, smallest, highest : see `move_to_centre`
    moved : (H, W, C) float32, from `move_to_centre`
    out : (H, W, C) float32, changed in rows first_row to end_row - 1
    """
    height, width = chart.shape
    row, column = _partly_covered(covered, offset, smallest, first_row, end_row)
    below = np.clip(row + np.where(offset[row, column, 1] > 0.0, 1, -1), 0, height - 1)
    beside = np.clip(column + np.where(offset[row, column, 0] > 0.0, 1, -1), 0, width - 1)
    x, y = np.abs(offset[row, column].astype(np.float64)).T
    known = np.ones(len(row), bool)
    for a, b, share in ((row, beside, x), (below, column, y), (below, beside, np.minimum(x, y))):
        known &= (share < smallest) | (covered[a, b] & (chart[a, b] == chart[row, column]))
    if not known.any():
        return
    row, column, below, beside = row[known], column[known], below[known], beside[known]
    x, y = x[known, None], y[known, None]
    texel = row * width + column
    plane = fit_planes(value, chart, covered, texel, offset)
    trend = outward_trend(value, chart, covered, texel, -offset[row, column].astype(np.float64))
    bound = highest[chart[row, column]]
    measured, plain = value[row, column].astype(np.float64), moved[row, column].astype(np.float64)
    others = x * (1.0 - y) * moved[row, beside] + (1.0 - x) * y * moved[below, column]
    others += x * y * moved[below, beside]
    way = plane.limit((measured - others) / ((1.0 - x) * (1.0 - y)), trend, bound) - plain
    excess = np.maximum(np.abs(way) - NOISY * np.abs(measured), 0.0)
    out[row, column] = plain + np.where(way > 0.0, excess, -excess)


def _partly_covered(
    covered: NDArray[np.bool_], offset: NDArray[np.float32], smallest: float, first_row: int, end_row: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return row and column of the covered texels in some rows whose offset is not too small to matter."""
    rows = slice(first_row, end_row)
    far = np.abs(offset[rows]).max(axis=2) >= np.float64(smallest)
    row, column = np.nonzero(covered[rows] & far)
    return row + first_row, column
