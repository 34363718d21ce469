# mypy: disable-error-code="no-untyped-def"
"""Kernels that fit planes to windows of a lightmap page, and extrapolate values along these planes.

The plane at a texel is a weighted least-squares fit to the covered texels of the same chart in a window
around the texel. The position of each value is the centroid of the covered part of its texel.
"""

from __future__ import annotations

import numpy as np

from baker.trace.jit import inner, kernel, larger, scratch, smaller

# Half side of a window, texels.
RADIUS = 2
# Ridge term, which is multiplied by the sum of weights and added to the diagonal of the normal equations,
# texels^2. If all texels lie on one line, the term makes the slope across that line 0.
RIDGE = 1e-3
# Largest amount by which a result may exceed the range of the window's values, as a share of that range.
HEADROOM = 0.5
# Factors in a second limit of that amount. Per texel of distance, this limit is STEEP times the smaller of
# two numbers: the last difference between texels, and CURVED times the difference before the last (see
# `_trend`).
STEEP, CURVED = 2.0, 3.0
# Limit of the share of the variance in the window that the plane explains. Up to this limit, a result may not
# exceed the largest value of the chart.
STRAIGHT = 0.95
# Limit of the distance from the chart, texels. Beyond this limit, extrapolated values are constant.
MAX_STEP = 2.0
# Amount by which the change that `match_lookups` makes is reduced, as a share of the texel's value. The
# change is reduced because a bilinear lookup uses few texels, and is therefore noisier than a plane.
NOISY = 0.03
# A slope on a noisy page is multiplied by max(1 - DOUBT / F, 0), where F is the slope's variance ratio
# (F-test). Noise alone gives F = 1 on average.
DOUBT = 3.0
# Constants in the weight of a texel, texels^2: weight = 1 / (FLAT + distance^2). On noisy pages NOISY_FLAT
# replaces FLAT, which makes the weights more uniform.
FLAT, NOISY_FLAT = 1.0, 4.0

# Columns of the sums over a window of texels with weights w and positions (x, y): sums of w, w x, w y, w x x,
# w x y and w y y, and the number of texels. Then follow, for each channel with values v, the sums of w v, w x
# v, w y v and w v v, and the smallest and the largest v.
W, WX, WY, WXX, WXY, WYY, COUNT = range(7)
WV, WXV, WYV, WVV, LOW, HIGH = range(6)
N_COLUMNS, N_CHANNEL_COLUMNS = 7, 6
# Columns of a plane, for each channel: value at the texel, slope per column and per row, smallest and largest
# value in the window, weighted sum of squares about the mean, and the part of that sum that the plane
# explains.
CENTRE, ACROSS, DOWN, LOWEST, HIGHEST, SPREAD, EXPLAINED = range(7)
N_PLANE = 7
# Columns of a trend: by how much values may exceed the largest and fall below the smallest value of the
# window, see `_trend`.
RISE, FALL = range(2)

MAX_CHANNELS = 16
# Number of planes cached in `extrapolate_outwards`, where neighbouring texels often use the same plane.
_SLOTS = 64

_sums = scratch((N_COLUMNS + N_CHANNEL_COLUMNS * MAX_CHANNELS,), np.float64)
_planes = scratch((1, MAX_CHANNELS, N_PLANE), np.float64)
_kept_planes = scratch((_SLOTS, MAX_CHANNELS, N_PLANE), np.float64)
_kept_sources = scratch((_SLOTS,), np.int64)
_trends = scratch((MAX_CHANNELS, 2), np.float64)
# Value of `offset` for a page whose values all lie at texel centres.
NO_OFFSET = np.zeros((0, 0, 2), np.float32)


@inner
def _sum_window(value, chart, covered, offset, r, c, radius, flat, sums):
    """Sum over the texels around texel (r, c) in its chart, weighted by 1 / (flat + distance^2).

    value : (H, W, C) float32; chart : (H, W) int32; covered : (H, W) bool
    offset : (H, W, 2) float32, column and row offset of each value's position from its texel centre, texels;
        of shape (0, 0, 2) if all offsets are zero
    sums : (N_COLUMNS + N_CHANNEL_COLUMNS C,) float64 output, columns as described at W and WV; x and y are
        relative to the position of texel (r, c)
    """
    height, width, channels = value.shape
    placed = offset.shape[0] > 0
    own = chart[r, c]
    for j in range(N_COLUMNS + N_CHANNEL_COLUMNS * channels):
        sums[j] = 0.0
    for j in range(channels):
        sums[N_COLUMNS + N_CHANNEL_COLUMNS * j + LOW] = np.inf
        sums[N_COLUMNS + N_CHANNEL_COLUMNS * j + HIGH] = -np.inf
    for rr in range(larger(r - radius, 0), smaller(r + radius + 1, height)):
        for cc in range(larger(c - radius, 0), smaller(c + radius + 1, width)):
            if not covered[rr, cc] or chart[rr, cc] != own:
                continue
            x = float(cc - c)
            y = float(rr - r)
            if placed:
                x += float(offset[rr, cc, 0]) - float(offset[r, c, 0])
                y += float(offset[rr, cc, 1]) - float(offset[r, c, 1])
            w = 1.0 / (flat + x * x + y * y)
            sums[W] += w
            sums[WX] += w * x
            sums[WY] += w * y
            sums[WXX] += w * x * x
            sums[WXY] += w * x * y
            sums[WYY] += w * y * y
            sums[COUNT] += 1.0
            for j in range(channels):
                v = float(value[rr, cc, j])
                at = N_COLUMNS + N_CHANNEL_COLUMNS * j
                sums[at + WV] += w * v
                sums[at + WXV] += w * x * v
                sums[at + WYV] += w * y * v
                sums[at + WVV] += w * v * v
                sums[at + LOW] = smaller(sums[at + LOW], v)
                sums[at + HIGH] = larger(sums[at + HIGH], v)


@inner
def fit_plane(value, chart, covered, offset, r, c, radius, flat, sums, planes, slot):
    """Fit a plane for each channel to the texels around texel (r, c) in its chart.

    value, chart, covered, offset : see `_sum_window`
    radius : int, half side of the window, texels; flat : float, see `FLAT`
    sums : (N_COLUMNS + N_CHANNEL_COLUMNS C,) float64, receives the sums over the window
    planes : (slots, C, N_PLANE) float64 output; only planes[slot] is written
    """
    _sum_window(value, chart, covered, offset, r, c, radius, flat, sums)
    weight = sums[W]
    mx, my = sums[WX] / weight, sums[WY] / weight
    cxx = sums[WXX] - sums[WX] * mx + RIDGE * weight
    cyy = sums[WYY] - sums[WY] * my + RIDGE * weight
    cxy = sums[WXY] - sums[WX] * my
    determinant = cxx * cyy - cxy * cxy
    for j in range(value.shape[2]):
        at = N_COLUMNS + N_CHANNEL_COLUMNS * j
        mean = sums[at + WV] / weight
        bx, by = sums[at + WXV] - sums[WX] * mean, sums[at + WYV] - sums[WY] * mean
        across, down = (cyy * bx - cxy * by) / determinant, (cxx * by - cxy * bx) / determinant
        spread = larger(sums[at + WVV] - mean * sums[at + WV], 0.0)
        planes[slot, j, CENTRE] = mean - across * mx - down * my
        planes[slot, j, ACROSS] = across
        planes[slot, j, DOWN] = down
        planes[slot, j, LOWEST] = sums[at + LOW]
        planes[slot, j, HIGHEST] = sums[at + HIGH]
        planes[slot, j, SPREAD] = spread
        planes[slot, j, EXPLAINED] = smaller(larger(across * bx + down * by, 0.0), spread)


@inner
def _step(along, length):
    """Return -1, 0 or 1, whichever is nearest to along / length."""
    return 1 if along > 0.5 * length else (-1 if along < -0.5 * length else 0)


@inner
def _trend(value, chart, covered, r, c, x, y, trend):
    """Write the largest plausible increase and decrease of values from texel (r, c) to (r + y, c + x).

    Both limits are derived from the two differences between the last three texels, which end at (r, c) in
    that direction (see `STEEP`). If the two differences have different signs, as at shadow edges, between
    different faces and in noise, both limits are 0. They are also 0 if the chart does not cover all three
    texels.

    value : (H, W, C) float32; chart : (H, W) int32; covered : (H, W) bool
    trend : (C, 2) float64 output, columns RISE and FALL, both >= 0
    """
    height, width, channels = value.shape
    length = larger(abs(x), abs(y))
    down, across = _step(y, length), _step(x, length)
    r2, c2 = r - 2 * down, c - 2 * across
    known = 0 <= r2 < height and 0 <= c2 < width
    if known:
        own = chart[r, c]
        known = (
            covered[r - down, c - across] and chart[r - down, c - across] == own
            and covered[r2, c2] and chart[r2, c2] == own
        )  # fmt: skip
    for j in range(channels):
        trend[j, RISE] = trend[j, FALL] = 0.0
        if known:
            one = float(value[r - down, c - across, j])
            last, before = float(value[r, c, j]) - one, CURVED * (one - float(value[r2, c2, j]))
            trend[j, RISE] = STEEP * length * larger(smaller(last, before), 0.0)
            trend[j, FALL] = STEEP * length * larger(smaller(-last, -before), 0.0)


@inner
def _limited(planes, slot, j, estimate, trend, highest):
    """Return an estimate for channel j, limited to the range of the window extended by the trend.

    If all values in the window are >= 0, the result is >= 0. The result exceeds `highest` only if the plane
    explains more than `STRAIGHT` of the variance in the window.

    planes : (slots, C, N_PLANE) float64, of which planes[slot] is read; trend : (C, 2) float64
    highest : float, largest value of the chart
    """
    low, high = planes[slot, j, LOWEST], planes[slot, j, HIGHEST]
    room = HEADROOM * (high - low)
    floor = low - smaller(room, trend[j, FALL])
    if low >= 0.0 and floor < 0.0:
        floor = 0.0
    limited = smaller(larger(estimate, floor), high + smaller(room, trend[j, RISE]))
    spread = planes[slot, j, SPREAD]
    explained = planes[slot, j, EXPLAINED] / spread if spread > 0.0 else 0.0
    even = larger(explained - STRAIGHT, 0.0) / (1.0 - STRAIGHT)
    return limited - (1.0 - even) * larger(limited - highest, 0.0)


@inner
def _off_centre(covered, offset, smallest, r, c):
    """Return whether texel (r, c) is covered and its centroid offset is at least `smallest` along one axis.

    covered : (H, W) bool; offset : (H, W, 2) float32, texels; smallest : float, texels
    """
    return covered[r, c] and larger(abs(offset[r, c, 0]), abs(offset[r, c, 1])) >= smallest


@kernel
def move_to_centre(value, chart, covered, offset, smallest, highest, out, first_row, end_row):
    """Extrapolate each texel's value from the centroid of its covered part to the texel centre.

    Parameters
    ----------
    value : (H, W, C) float32
    chart : (H, W) int32
    covered : (H, W) bool
    offset : (H, W, 2) float32
        Centroid minus texel centre (column, row), texels.
    smallest : float
        Smallest offset, texels. Texels whose offset is smaller along both axes are not changed.
    highest : (n_charts, C) float32
        Largest value of each chart.
    out : (H, W, C) float32, changed in rows first_row to end_row - 1
    """
    sums, planes, trend = _sums(), _planes(), _trends()
    for r in range(first_row, end_row):
        for c in range(value.shape[1]):
            if not _off_centre(covered, offset, smallest, r, c):
                continue
            x, y = -float(offset[r, c, 0]), -float(offset[r, c, 1])
            fit_plane(value, chart, covered, offset, r, c, RADIUS, FLAT, sums, planes, 0)
            _trend(value, chart, covered, r, c, x, y, trend)
            for j in range(value.shape[2]):
                estimate = float(value[r, c, j]) + planes[0, j, ACROSS] * x + planes[0, j, DOWN] * y
                bound = float(highest[chart[r, c], j])
                out[r, c, j] = np.float32(_limited(planes, 0, j, estimate, trend, bound))


@kernel
def match_lookups(value, chart, covered, offset, smallest, highest, moved, out, first_row, end_row):
    """Set each partly covered texel so that a bilinear lookup at its centroid returns its mean.

    A texel is changed only if all texels of this lookup are covered and in its chart. The value that matches
    the lookup has more noise than the result of `move_to_centre`, which is computed from a plane through many
    texels. Therefore the difference of both is reduced by NOISY times the texel's mean.

    Parameters
    ----------
    value, chart, covered, offset, smallest, highest : see `move_to_centre`
    moved : (H, W, C) float32, result of `move_to_centre`
    out : (H, W, C) float32, changed in rows first_row to end_row - 1
    """
    height, width, channels = value.shape
    sums, planes, trend = _sums(), _planes(), _trends()
    for r in range(first_row, end_row):
        for c in range(width):
            if not _off_centre(covered, offset, smallest, r, c):
                continue
            ox, oy = float(offset[r, c, 0]), float(offset[r, c, 1])
            x, y = abs(ox), abs(oy)
            # Find the row and column of the other three texels of the lookup, and require the same chart.
            rr = smaller(larger(r + (1 if oy > 0.0 else -1), 0), height - 1)
            cc = smaller(larger(c + (1 if ox > 0.0 else -1), 0), width - 1)
            own = chart[r, c]
            known = x < smallest or (covered[r, cc] and chart[r, cc] == own)
            known = known and (y < smallest or (covered[rr, c] and chart[rr, c] == own))
            both = smaller(x, y) < smallest or (covered[rr, cc] and chart[rr, cc] == own)
            if not known or not both:
                continue
            fit_plane(value, chart, covered, offset, r, c, RADIUS, FLAT, sums, planes, 0)
            _trend(value, chart, covered, r, c, -ox, -oy, trend)
            for j in range(channels):
                # Solve the bilinear lookup for the value at the centre of this texel.
                measured, centred = float(value[r, c, j]), float(moved[r, c, j])
                others = x * (1.0 - y) * float(moved[r, cc, j]) + (1.0 - x) * y * float(moved[rr, c, j])
                others += x * y * float(moved[rr, cc, j])
                estimate = (measured - others) / ((1.0 - x) * (1.0 - y))
                change = _limited(planes, 0, j, estimate, trend, float(highest[own, j])) - centred
                excess = larger(abs(change) - NOISY * abs(measured), 0.0)
                out[r, c, j] = np.float32(centred + (excess if change > 0.0 else -excess))


@kernel
def extrapolate_outwards(value, chart, covered, nearest, offset, highest, pixels, grown, first_row, end_row):
    """Fill the empty texels near each chart with planes fitted at its border, in place.

    Parameters
    ----------
    value : (H, W, C) float32, changed at filled texels in rows first_row to end_row - 1
    chart : (H, W) int32
    covered : (H, W) bool
    nearest : (H, W) int32, from `nearest_texel` of `covered`
    offset : (0, 0, 2) float32, `NO_OFFSET`
    highest : (n_charts, C) float32
        Largest value of each chart.
    pixels : int
        Number of rings of 8-neighbours to fill.
    grown : (H, W) bool, set at the texels that were filled
    """
    width, channels = value.shape[1], value.shape[2]
    sums, trend = _sums(), _trends()
    # Cache planes, because many texels use the same plane. Slot s holds the plane of the texel source[s] - 1.
    planes, source = _kept_planes(), _kept_sources()
    for r in range(first_row, end_row):
        for c in range(width):
            at = np.int64(nearest[r, c])
            if covered[r, c] or at < 0:
                continue
            row, column = at // width, at % width
            down, across = r - row, c - column
            ring = larger(abs(down), abs(across))
            if ring > pixels:
                continue
            slot = at % _SLOTS
            if source[slot] != at + 1:
                fit_plane(value, chart, covered, offset, row, column, RADIUS, FLAT, sums, planes, slot)
                source[slot] = at + 1
            shrink = smaller(1.0, MAX_STEP / ring)
            x, y = across * shrink, down * shrink
            _trend(value, chart, covered, row, column, x, y, trend)
            for j in range(channels):
                estimate = planes[slot, j, CENTRE] + planes[slot, j, ACROSS] * x + planes[slot, j, DOWN] * y
                bound = float(highest[chart[row, column], j])
                value[r, c, j] = np.float32(_limited(planes, slot, j, estimate, trend, bound))
            grown[r, c] = True


@kernel
def noisy_planes(value, chart, covered, offset, texel, radius, out):
    """Fit a plane for each channel around n texels of a noisy page, with slopes reduced by their uncertainty.

    Parameters
    ----------
    value, chart, covered : see `move_to_centre`
    offset : (0, 0, 2) float32, `NO_OFFSET`
    texel : (n,) int64
        Row * W + column of covered texels.
    radius : int
        Half side of the window, texels. The window is larger than for denoised pages, because slopes are
        fitted to noisy values.
    out : (n, 3, C) float32 output
        Value, slope per column and slope per row.
    """
    width = value.shape[1]
    sums, planes = _sums(), _planes()
    for k in range(len(texel)):
        r, c = texel[k] // width, texel[k] % width
        fit_plane(value, chart, covered, offset, r, c, radius, NOISY_FLAT, sums, planes, 0)
        for j in range(value.shape[2]):
            # Reduce the slope by its F ratio: explained variance divided by unexplained variance, each per
            # degree of freedom.
            explained, spread = planes[0, j, EXPLAINED], planes[0, j, SPREAD]
            trust = 0.0
            if sums[COUNT] > 3.0 and explained > 0.0:
                left = (spread - explained) / (sums[COUNT] - 3.0)
                trust = larger(1.0 - DOUBT * left / (explained / 2.0), 0.0)
            across, down = trust * planes[0, j, ACROSS], trust * planes[0, j, DOWN]
            mean = sums[N_COLUMNS + N_CHANNEL_COLUMNS * j + WV] / sums[W]
            centre = mean - (across * sums[WX] + down * sums[WY]) / sums[W]
            out[k, 0, j] = np.float32(centre)
            out[k, 1, j] = np.float32(across)
            out[k, 2, j] = np.float32(down)
