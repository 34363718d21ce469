"""Kernels that use the slope of a lightmap inside a chart: extrapolation and moves below one texel.

The slope at a texel is the weighted least-squares plane through the covered texels of its own chart in a
5 x 5 window, each placed at the centroid of its covered part.
"""

from __future__ import annotations

import numpy as np
from numba import njit

RADIUS = 2
# A ridge in the normal equations: where the texels lie on one line, the slope across it comes out 0.
RIDGE = 1e-3
# How far a result may leave the range of the window's values, as a share of that range.
HEADROOM = 0.5
# Extrapolation stops growing this many texels outside the chart.
MAX_STEP = 2.0
# A value taken from a few texels must differ by this share to be believed instead of a plane's.
NOISY = 0.03
# A noisy slope counts by 1 - DOUBT / F, F its variance ratio: noise alone gives F = 1 on average.
DOUBT = 3.0


@njit(cache=True, nogil=True)
def fit_plane(value, chart, covered, offset, r, c, plane):  # type: ignore[no-untyped-def]
    """Fit a plane per channel to the texels of (r, c)'s chart around it.

    Parameters
    ----------
    value : (H, W, C) float32
    chart : (H, W) int32
    covered : (H, W) bool, True at (r, c)
    offset : (H, W, 2) float32 or (0, 0, 2)
        Column and row offset of each value's place from its texel centre, texels; empty = all zero.
    plane : (5, C) float64
        Receives: value at the place of (r, c), slope per column, slope per row, smallest and largest value.
    """
    height, width, channels = value.shape
    placed = offset.shape[0] > 0
    own = chart[r, c]
    sw = sx = sy = sxx = sxy = syy = 0.0
    for j in range(channels):
        plane[0, j] = 0.0
        plane[1, j] = 0.0
        plane[2, j] = 0.0
        plane[3, j] = np.inf
        plane[4, j] = -np.inf
    for rr in range(max(r - RADIUS, 0), min(r + RADIUS + 1, height)):
        for cc in range(max(c - RADIUS, 0), min(c + RADIUS + 1, width)):
            if not covered[rr, cc] or chart[rr, cc] != own:
                continue
            x = float(cc - c)
            y = float(rr - r)
            if placed:
                x += float(offset[rr, cc, 0]) - float(offset[r, c, 0])
                y += float(offset[rr, cc, 1]) - float(offset[r, c, 1])
            w = 1.0 / (1.0 + x * x + y * y)
            sw += w
            sx += w * x
            sy += w * y
            sxx += w * x * x
            sxy += w * x * y
            syy += w * y * y
            for j in range(channels):
                v = float(value[rr, cc, j])
                plane[0, j] += w * v
                plane[1, j] += w * x * v
                plane[2, j] += w * y * v
                plane[3, j] = min(plane[3, j], v)
                plane[4, j] = max(plane[4, j], v)
    mx = sx / sw
    my = sy / sw
    cxx = sxx - sx * mx + RIDGE * sw
    cyy = syy - sy * my + RIDGE * sw
    cxy = sxy - sx * my
    det = cxx * cyy - cxy * cxy
    for j in range(channels):
        mean = plane[0, j] / sw
        bx = plane[1, j] - sx * mean
        by = plane[2, j] - sy * mean
        slope_x = (cyy * bx - cxy * by) / det
        slope_y = (cxx * by - cxy * bx) / det
        plane[0, j] = mean - slope_x * mx - slope_y * my
        plane[1, j] = slope_x
        plane[2, j] = slope_y


@njit(cache=True, nogil=True)
def _limit(estimate, low, high):  # type: ignore[no-untyped-def]
    # A value may leave the window's range a little, but light does not turn negative.
    room = HEADROOM * (high - low)
    floor = low - room
    if low >= 0.0 and floor < 0.0:
        floor = 0.0
    return min(max(estimate, floor), high + room)


@njit(cache=True, nogil=True)
def extrapolate_outwards(value, chart, covered, nearest, pixels, grown, first_row, end_row):  # type: ignore[no-untyped-def]
    """Continue each chart by its own slope into the empty texels near it, in place.

    Parameters
    ----------
    value : (H, W, C) float32, changed at grown texels in rows first_row to end_row - 1
    chart : (H, W) int32
    covered : (H, W) bool
    nearest : (H, W) int32, from `nearest_texel` of `covered`
    pixels : int
        How many rings of 8-neighbours a chart grows.
    grown : (H, W) bool, set at the texels that got a value
    """
    width, channels = value.shape[1], value.shape[2]
    plane = np.zeros((5, channels), np.float64)
    offset = np.zeros((0, 0, 2), np.float32)
    for r in range(first_row, end_row):
        for c in range(width):
            q = nearest[r, c]
            if covered[r, c] or q < 0:
                continue
            qr, qc = q // width, q % width
            dr, dc = r - qr, c - qc
            ring = max(abs(dr), abs(dc))
            if ring > pixels:
                continue
            fit_plane(value, chart, covered, offset, qr, qc, plane)
            shrink = min(1.0, MAX_STEP / ring)
            for j in range(channels):
                estimate = plane[0, j] + shrink * (plane[1, j] * dc + plane[2, j] * dr)
                value[r, c, j] = _limit(estimate, plane[3, j], plane[4, j])
            grown[r, c] = True


@njit(cache=True, nogil=True)
def move_to_centre(value, chart, covered, offset, smallest, out, first_row, end_row):  # type: ignore[no-untyped-def]
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
    out : (H, W, C) float32, changed in rows first_row to end_row - 1
    """
    width, channels = value.shape[1], value.shape[2]
    plane = np.zeros((5, channels), np.float64)
    for r in range(first_row, end_row):
        for c in range(width):
            if not covered[r, c]:
                continue
            x = float(offset[r, c, 0])
            y = float(offset[r, c, 1])
            if max(abs(x), abs(y)) < smallest:
                continue
            fit_plane(value, chart, covered, offset, r, c, plane)
            for j in range(channels):
                estimate = float(value[r, c, j]) - plane[1, j] * x - plane[2, j] * y
                out[r, c, j] = _limit(estimate, plane[3, j], plane[4, j])


@njit(cache=True, nogil=True)
def match_lookups(value, chart, covered, offset, smallest, moved, out, first_row, end_row):  # type: ignore[no-untyped-def]
    """Set each partly covered texel so that a bilinear lookup at its centroid finds what was measured there.

    Only where all texels of that lookup are covered and of one chart. What differs from `move_to_centre` by
    some per cent is left to that: a plane through many texels is less noisy. See `_limit`, too.

    Parameters
    ----------
    value, chart, covered, offset, smallest : see `move_to_centre`
    moved : (H, W, C) float32, from `move_to_centre`
    out : (H, W, C) float32, changed in rows first_row to end_row - 1
    """
    height, width, channels = value.shape
    plane = np.zeros((5, channels), np.float64)
    for r in range(first_row, end_row):
        for c in range(width):
            x = abs(float(offset[r, c, 0]))
            y = abs(float(offset[r, c, 1]))
            if not covered[r, c] or max(x, y) < smallest:
                continue
            rr = min(max(r + (1 if offset[r, c, 1] > 0.0 else -1), 0), height - 1)
            cc = min(max(c + (1 if offset[r, c, 0] > 0.0 else -1), 0), width - 1)
            known = True
            for a, b, share in ((r, cc, x), (rr, c, y), (rr, cc, min(x, y))):
                if share >= smallest and not (covered[a, b] and chart[a, b] == chart[r, c]):
                    known = False
            if not known:
                continue
            fit_plane(value, chart, covered, offset, r, c, plane)
            own = (1.0 - x) * (1.0 - y)
            for j in range(channels):
                measured, plain = float(value[r, c, j]), float(moved[r, c, j])
                beside = x * (1.0 - y) * moved[r, cc, j] + (1.0 - x) * y * moved[rr, c, j]
                beside += x * y * moved[rr, cc, j]
                way = _limit((measured - beside) / own, plane[3, j], plane[4, j]) - plain
                excess = max(abs(way) - NOISY * abs(measured), 0.0)
                out[r, c, j] = plain + (excess if way > 0.0 else -excess)


@njit(cache=True, nogil=True)
def border_planes(value, chart, covered, texel, radius, out, begin, end):  # type: ignore[no-untyped-def]
    """Fit a plane per channel around chosen texels of a noisy page, slopes shrunk by how sure they are.

    Parameters
    ----------
    value : (H, W, C) float32
    chart : (H, W) int32
    covered : (H, W) bool
    texel : (n,) int32
        Row * W + column of covered texels.
    radius : int
        Half window; wider than for clean pages, since a slope has to rise above the noise.
    out : (n, 3, C) float32
        Receives value, slope per column and slope per row at entries begin to end - 1.
    """
    height, width, channels = value.shape
    moment = np.zeros((4, channels), np.float64)
    for k in range(begin, end):
        r, c = texel[k] // width, texel[k] % width
        sw = sx = sy = sxx = sxy = syy = 0.0
        n = 0
        moment[:] = 0.0
        for rr in range(max(r - radius, 0), min(r + radius + 1, height)):
            for cc in range(max(c - radius, 0), min(c + radius + 1, width)):
                if not covered[rr, cc] or chart[rr, cc] != chart[r, c]:
                    continue
                x = float(cc - c)
                y = float(rr - r)
                w = 1.0 / (4.0 + x * x + y * y)
                n += 1
                sw += w
                sx += w * x
                sy += w * y
                sxx += w * x * x
                sxy += w * x * y
                syy += w * y * y
                for j in range(channels):
                    v = float(value[rr, cc, j])
                    moment[0, j] += w * v
                    moment[1, j] += w * x * v
                    moment[2, j] += w * y * v
                    moment[3, j] += w * v * v
        mx = sx / sw
        my = sy / sw
        cxx = sxx - sx * mx + RIDGE * sw
        cyy = syy - sy * my + RIDGE * sw
        cxy = sxy - sx * my
        det = cxx * cyy - cxy * cxy
        for j in range(channels):
            mean = moment[0, j] / sw
            bx = moment[1, j] - sx * mean
            by = moment[2, j] - sy * mean
            slope_x = (cyy * bx - cxy * by) / det
            slope_y = (cxx * by - cxy * bx) / det
            # Explained against unexplained spread, per degree of freedom: the F ratio of the slope.
            spread = max(moment[3, j] - mean * moment[0, j], 0.0)
            explained = min(max(slope_x * bx + slope_y * by, 0.0), spread)
            trust = 0.0
            if n > 3 and explained > 0.0:
                left = (spread - explained) / (n - 3)
                trust = max(1.0 - DOUBT * left / (explained / 2.0), 0.0)
            out[k, 0, j] = mean - trust * (slope_x * mx + slope_y * my)
            out[k, 1, j] = trust * slope_x
            out[k, 2, j] = trust * slope_y
