"""Kernels that fill empty texels of a lightmap page: nearest texel, reflection at chart borders.

`nearest_texel` uses exact Euclidean distances and takes linear time. `reflect_outwards` fills an empty texel
from the chart of its nearest covered texel only.

Based on: Meijster, Roerdink, Hesselink, A General Algorithm for Computing Distance Transforms in Linear
Time, 2000.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.trace.jit import inner, kernel, larger, smaller

# Limit of the distance from the border, texels. Beyond this limit, the fitted plane is continued as a
# constant.
SLOPE_REACH = 6.0
# Largest factor by which the plane increases or decreases a reflected value.
MOST = 4.0


def nearest_texel(mask: NDArray[np.bool_], out: NDArray[np.int32]) -> None:
    """Find the nearest texel of `mask` for every texel of the page.

    Parameters
    ----------
    mask : (H, W) bool
    out : (H, W) int32
        Receives row * W + column of the nearest set texel, or -1 everywhere if none is set. The choice
        between equally near texels depends only on the mask.
    """
    row_of = np.full(mask.shape, -1, np.int32)
    apex, start = np.zeros((2, mask.shape[1]), np.int64)
    _nearest(mask, row_of, apex, start, out)


@kernel
def _nearest(mask, row_of, apex, start, out):  # type: ignore[no-untyped-def]
    """For each texel, write the index row * W + column of the nearest set texel, see `nearest_texel`.

    mask : (H, W) bool; out : (H, W) int32 output
    row_of : (H, W) int32 full of -1, apex and start : (W,) int64, scratch
    """
    height, width = mask.shape
    # Find the nearest set row in the column of each texel; -1 if the column has none.
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
    # In each row, compute the lower envelope of one parabola for each column, in exact integer arithmetic. A
    # parabola is the squared distance to the nearest set texel of its column, as a function of the column.
    # apex[k] is the column of parabola k of the envelope, start[k] the first column at which this parabola is
    # the lowest.
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
                # Compute the last column at which the set texel of column i is at least as near as the set
                # texel of column c.
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


@kernel
def reflect_outwards(value, chart, covered, nearest, plane_row, plane, max_distance, first_row, end_row):  # type: ignore[no-untyped-def]
    """Fill the empty texels around charts by reflection at the charts' borders, in place.

    Let q be the covered texel nearest to an empty texel p. Let m be the mirror texel: the texel of q's chart
    on the other side of q, at the same distance from q as p. Then value(p) = value(m) * plane(p) / plane(m),
    where the plane is fitted at q, and the quotient of the planes is limited to 1 / `MOST` to `MOST`. So the
    noise has the same statistics on both sides of the border, and gradients continue. If the chart is thinner
    than the distance from p to q, m is found by repeated reflection at the chart's two borders.

    Parameters
    ----------
    value : (H, W, C) float32, changed where not covered, in rows first_row to end_row - 1
    chart : (H, W) int32
    covered : (H, W) bool
    nearest : (H, W) int32, from `nearest_texel` of `covered`
    plane_row : (H, W) int32
        For each texel whose index occurs in `nearest`, the index of its plane in `plane`.
    plane : (n, 3, C) float32
        Planes fitted at n border texels: value, slope per column, slope per row.
    max_distance : int
        Largest distance between q and m, in texels.
    first_row, end_row : int
        Rows of the page to fill.
    """
    height, width, channels = value.shape
    for r in range(first_row, end_row):
        for c in range(width):
            q = nearest[r, c]
            if covered[r, c] or q < 0:
                continue
            qr, qc = q // width, q % width
            dr, dc = qr - r, qc - c
            # Measure the depth of the chart behind q, in texels along the direction from p to q.
            distance = larger(abs(dr), abs(dc))
            depth = 0
            own = chart[qr, qc]
            for k in range(1, smaller(distance, max_distance) + 1):
                rr = qr + _round_ratio(dr * k, distance)
                cc = qc + _round_ratio(dc * k, distance)
                if rr < 0 or rr >= height or cc < 0 or cc >= width:
                    break
                if not covered[rr, cc] or chart[rr, cc] != own:
                    break
                depth = k
            # Find m by reflection, repeated if the chart is thinner than the distance.
            step = distance
            if depth == 0:
                step = 0
            elif distance > depth:
                step = distance % (2 * depth)
                if step > depth:
                    step = 2 * depth - step
            rr = qr + _round_ratio(dr * step, distance)
            cc = qc + _round_ratio(dc * step, distance)
            # Multiply the value at m by plane(p) / plane(m).
            outside = smaller(1.0, SLOPE_REACH / distance)
            inside = smaller(1.0, SLOPE_REACH / step) if step > 0 else 1.0
            at = plane_row[qr, qc]
            for j in range(channels):
                rise_out = -(plane[at, 1, j] * dc + plane[at, 2, j] * dr) * outside
                rise_in = (plane[at, 1, j] * (cc - qc) + plane[at, 2, j] * (rr - qr)) * inside
                at_mirror = plane[at, 0, j] + rise_in
                factor = 1.0
                if at_mirror > 0.0:
                    factor = smaller(larger((plane[at, 0, j] + rise_out) / at_mirror, 1.0 / MOST), MOST)
                value[r, c, j] = value[rr, cc, j] * factor


@inner
def _round_ratio(a, b):  # type: ignore[no-untyped-def]
    # Nearest integer of a / b, halves upwards; b > 0.
    return (2 * a + b) // (2 * b)
