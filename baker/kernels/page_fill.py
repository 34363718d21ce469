"""Kernels that carry values over a lightmap page: nearest texel, growth by rings, reflection, extrapolation.

All of them know charts: a value never crosses from one chart into another.
The nearest texel is exact (Euclidean), in linear time.

Based on: Meijster, Roerdink, Hesselink, A General Algorithm for Computing Distance Transforms in Linear
Time, 2000.
"""

from __future__ import annotations

import numpy as np
from numba import njit

# A reflected picture follows its border's slope this far, texels, and never by more than this factor.
SLOPE_REACH = 6.0
MOST = 4.0


@njit(cache=True, nogil=True)
def nearest_texel(mask, out):  # type: ignore[no-untyped-def]
    """Find the nearest texel of `mask` for every texel of the page.

    Parameters
    ----------
    mask : (H, W) bool
    out : (H, W) int32
        Receives row * W + column of the nearest set texel, -1 everywhere if none is set. Among equally
        near ones the choice depends on the mask alone.
    """
    height, width = mask.shape
    # Nearest set row of each column, kept as a row number; -1 = column is empty.
    row_of = np.full((height, width), -1, np.int32)
    for r in range(height):
        for c in range(width):
            if mask[r, c]:
                row_of[r, c] = r
            elif r > 0:
                row_of[r, c] = row_of[r - 1, c]
    for r in range(height - 2, -1, -1):
        for c in range(width):
            below = row_of[r + 1, c]
            if below >= 0 and (row_of[r, c] < 0 or below - r < r - row_of[r, c]):
                row_of[r, c] = below
    # Lower envelope of the columns' parabolas, row by row; all in integers, so exact.
    apex = np.zeros(width, np.int64)
    start = np.zeros(width, np.int64)
    for r in range(height):
        n = 0
        for c in range(width):
            if row_of[r, c] < 0:
                continue
            g = np.int64(row_of[r, c] - r)
            first = np.int64(0)
            while n > 0:
                i = apex[n - 1]
                gi = np.int64(row_of[r, i] - r)
                # Last column at which i is at least as near as c.
                cut = (c * c - i * i + g * g - gi * gi) // (2 * (c - i))
                if cut >= start[n - 1]:
                    first = cut + 1
                    break
                n -= 1
            if n == 0:
                first = np.int64(0)
            if first < width:
                apex[n] = c
                start[n] = first
                n += 1
        for k in range(n):
            end = start[k + 1] if k + 1 < n else width
            index = np.int32(row_of[r, apex[k]] * width + apex[k])
            for c in range(start[k], end):
                out[r, c] = index
        if n == 0:
            for c in range(width):
                out[r, c] = -1


@njit(cache=True, nogil=True)
def grow_rings(value, chart, known):  # type: ignore[no-untyped-def]
    """Fill the unknown texels of each chart ring by ring from its known ones, in place.

    A texel of the next ring takes the mean of its known 8-neighbours of the same chart (edge neighbours
    weigh 1, diagonal ones 1/2). A ring is finished before its values are used, so no order of texels matters.

    Parameters
    ----------
    value : (H, W, C) float32, changed at the texels that get filled
    chart : (H, W) int32, -1 = empty
    known : (H, W) bool, changed: set where a value was filled in
    """
    height, width, channels = value.shape
    n_unknown = 0
    for r in range(height):
        for c in range(width):
            if chart[r, c] >= 0 and not known[r, c]:
                n_unknown += 1
    waiting = np.zeros(n_unknown, np.int64)
    k = 0
    for r in range(height):
        for c in range(width):
            if chart[r, c] >= 0 and not known[r, c]:
                waiting[k] = r * width + c
                k += 1
    # The ring being made; texels whose neighbours are all unknown stay in `waiting`.
    queued = np.zeros((height, width), np.bool_)
    ring = np.zeros(n_unknown, np.int64)
    n_ring = 0
    for k in range(n_unknown):
        r, c = waiting[k] // width, waiting[k] % width
        if _touches_known(chart, known, r, c):
            ring[n_ring] = waiting[k]
            n_ring += 1
            queued[r, c] = True
    following = np.zeros(n_unknown, np.int64)
    total = np.zeros(channels, np.float64)
    while n_ring > 0:
        for k in range(n_ring):
            r, c = ring[k] // width, ring[k] % width
            weight_sum = 0.0
            total[:] = 0.0
            for rr in range(max(r - 1, 0), min(r + 2, height)):
                for cc in range(max(c - 1, 0), min(c + 2, width)):
                    if known[rr, cc] and chart[rr, cc] == chart[r, c]:
                        weight = 1.0 if (rr == r or cc == c) else 0.5
                        weight_sum += weight
                        for j in range(channels):
                            total[j] += weight * value[rr, cc, j]
            for j in range(channels):
                value[r, c, j] = total[j] / weight_sum
        n_following = 0
        for k in range(n_ring):
            known[ring[k] // width, ring[k] % width] = True
        for k in range(n_ring):
            r, c = ring[k] // width, ring[k] % width
            for rr in range(max(r - 1, 0), min(r + 2, height)):
                for cc in range(max(c - 1, 0), min(c + 2, width)):
                    if chart[rr, cc] == chart[r, c] and not known[rr, cc] and not queued[rr, cc]:
                        queued[rr, cc] = True
                        following[n_following] = rr * width + cc
                        n_following += 1
        ring, following = following, ring
        n_ring = n_following


@njit(cache=True, nogil=True)
def _touches_known(chart, known, r, c):  # type: ignore[no-untyped-def]
    height, width = chart.shape
    for rr in range(max(r - 1, 0), min(r + 2, height)):
        for cc in range(max(c - 1, 0), min(c + 2, width)):
            if known[rr, cc] and chart[rr, cc] == chart[r, c]:
                return True
    return False


@njit(cache=True, nogil=True)
def reflect_outwards(value, chart, covered, nearest, slope_row, slope, reach, first_row, end_row):  # type: ignore[no-untyped-def]
    """Continue every chart's picture into the empty texels by reflection at its border, in place.

    An empty texel p with the nearest covered texel q takes the value m as far inside the chart as p lies
    outside, times (plane at p) / (plane at m), where the plane is fitted at q: noise looks the same on both
    sides of the border, and a slope goes on where a plain mirror would put a crease. Where the chart is
    thinner than needed, the way back and forth through it is folded.

    Parameters
    ----------
    value : (H, W, C) float32, changed where not covered, in rows first_row to end_row - 1
    chart : (H, W) int32
    covered : (H, W) bool
    nearest : (H, W) int32, from `nearest_texel` of `covered`
    slope_row : (H, W) int32
        Row of `slope` for each covered texel that is some empty texel's nearest.
    slope : (n, 3, C) float32
        Plane at these texels: value, slope per column, slope per row.
    reach : int
        Largest depth looked at, in texels.
    """
    height, width, channels = value.shape
    for r in range(first_row, end_row):
        for c in range(width):
            q = nearest[r, c]
            if covered[r, c] or q < 0:
                continue
            qr, qc = q // width, q % width
            dr, dc = qr - r, qc - c
            distance = max(abs(dr), abs(dc))
            depth = 0
            own = chart[qr, qc]
            for k in range(1, min(distance, reach) + 1):
                rr = qr + _round_ratio(dr * k, distance)
                cc = qc + _round_ratio(dc * k, distance)
                if rr < 0 or rr >= height or cc < 0 or cc >= width:
                    break
                if not covered[rr, cc] or chart[rr, cc] != own:
                    break
                depth = k
            step = distance
            if depth == 0:
                step = 0
            elif distance > depth:
                step = distance % (2 * depth)
                if step > depth:
                    step = 2 * depth - step
            rr = qr + _round_ratio(dr * step, distance)
            cc = qc + _round_ratio(dc * step, distance)
            # Beyond SLOPE_REACH texels the plane stays what it is there.
            outside = min(1.0, SLOPE_REACH / distance)
            inside = min(1.0, SLOPE_REACH / step) if step > 0 else 1.0
            plane = slope[slope_row[qr, qc]]
            for j in range(channels):
                rise_out = -(plane[1, j] * dc + plane[2, j] * dr) * outside
                rise_in = (plane[1, j] * (cc - qc) + plane[2, j] * (rr - qr)) * inside
                at_mirror = plane[0, j] + rise_in
                factor = 1.0
                if at_mirror > 0.0:
                    factor = min(max((plane[0, j] + rise_out) / at_mirror, 1.0 / MOST), MOST)
                value[r, c, j] = value[rr, cc, j] * factor


@njit(cache=True, nogil=True)
def _round_ratio(a, b):  # type: ignore[no-untyped-def]
    # Nearest integer of a / b, halves upwards; b > 0.
    return (2 * a + b) // (2 * b)
