"""Sums over windows of a lightmap page, from which planes are fitted (`baker.finish.slope`).

A window holds the texels of one chart around one of its texels, each placed at the centroid of its covered
part.
"""

from __future__ import annotations

import numpy as np

from baker.trace.jit import kernel, larger, smaller

# Columns of a row of sums: of the weights w, w x, w y, w x x, w x y, w y y, and the number of texels; then
# for each channel those of w v, w x v, w y v, w v v, and the smallest and the largest value v.
W, WX, WY, WXX, WXY, WYY, COUNT = range(7)
WV, WXV, WYV, WVV, LOW, HIGH = range(6)
N_COLUMNS, N_CHANNEL_COLUMNS = 7, 6


@kernel
def window_sums(value, chart, covered, offset, texel, radius, flat, sums):  # type: ignore[no-untyped-def]
    """Sum over the texels of each chosen texel's chart around it, weighted by 1 / (flat + distance^2).

    Parameters
    ----------
    value : (H, W, C) float32
    chart : (H, W) int32
    covered : (H, W) bool
    offset : (H, W, 2) float32 or (0, 0, 2)
        Column and row offset of each value's place from its texel centre, texels; empty = all zero.
    texel : (n,) int64
        Row * W + column of covered texels.
    radius : int
        Half window, texels.
    flat : float
        Large values weigh all alike.
    sums : (n, 7 + 6 C) float64
        Out, see the column names; x and y are counted from the place of the chosen texel.
    """
    height, width, channels = value.shape
    placed = offset.shape[0] > 0
    for k in range(len(texel)):
        r, c = texel[k] // width, texel[k] % width
        own = chart[r, c]
        for j in range(N_COLUMNS + N_CHANNEL_COLUMNS * channels):
            sums[k, j] = 0.0
        for j in range(channels):
            sums[k, N_COLUMNS + N_CHANNEL_COLUMNS * j + LOW] = np.inf
            sums[k, N_COLUMNS + N_CHANNEL_COLUMNS * j + HIGH] = -np.inf
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
                sums[k, W] += w
                sums[k, WX] += w * x
                sums[k, WY] += w * y
                sums[k, WXX] += w * x * x
                sums[k, WXY] += w * x * y
                sums[k, WYY] += w * y * y
                sums[k, COUNT] += 1.0
                for j in range(channels):
                    v = float(value[rr, cc, j])
                    at = N_COLUMNS + N_CHANNEL_COLUMNS * j
                    sums[k, at + WV] += w * v
                    sums[k, at + WXV] += w * x * v
                    sums[k, at + WYV] += w * y * v
                    sums[k, at + WVV] += w * v * v
                    sums[k, at + LOW] = smaller(sums[k, at + LOW], v)
                    sums[k, at + HIGH] = larger(sums[k, at + HIGH], v)
