# mypy: disable-error-code="no-untyped-def"
"""Conservative rasterisation of charts: which triangles each texel's square touches.

A texel is an area. Two passes (count, fill) list the triangles of each texel with their areas inside its
square; a texel belongs to the chart that covers most of it.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.kernels.clip import clip_to_square, new_polygon, new_triangle, polygon_area, square_touches
from baker.trace.jit import inner, kernel, larger, smaller


@inner
def _corners(uv, triangle, t, size, corner):
    """Write the corners of triangle t in texels, and return first x, first y, last x, last y of its texels.

    uv : (V, 2) float32; triangle : (T, 3) int32; corner : (3, 2) float64 output
    """
    low_x = low_y = 1.0e30
    high_x = high_y = -1.0e30
    for i in range(3):
        x = uv[triangle[t, i], 0] * size
        y = uv[triangle[t, i], 1] * size
        corner[i, 0] = x
        corner[i, 1] = y
        low_x, high_x = smaller(low_x, x), larger(high_x, x)
        low_y, high_y = smaller(low_y, y), larger(high_y, y)
    # A border exactly on a texel's edge must not touch the texel on its other side.
    tiny = 1.0e-4
    first_x = larger(math.floor(low_x + tiny), 0)
    first_y = larger(math.floor(low_y + tiny), 0)
    last_x = smaller(larger(math.ceil(high_x - tiny) - 1, first_x), size - 1)
    last_y = smaller(larger(math.ceil(high_y - tiny) - 1, first_y), size - 1)
    return smaller(first_x, size - 1), smaller(first_y, size - 1), last_x, last_y


@kernel
def list_overlaps(uv, triangle, page, size, at, entry, area):
    """Write the triangles that each texel's square touches, and their areas in it, in ascending order.

    uv : (V, 2) float32; triangle : (T, 3) int32; page : (T,) int32; size : int, of a page, texels
    at : (P * H * W,) int64, where the next triangle of each texel is written; advanced by their number
    entry : (m,) int32 output, triangles; (0,): they are only counted
    area : (m,) float32 output, texels
    """
    corner, cut, spare = new_triangle(), new_polygon(), new_polygon()
    for t in range(len(triangle)):
        x0, y0, x1, y1 = _corners(uv, triangle, t, size, corner)
        base = np.int64(page[t]) * size * size
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                how = square_touches(corner, x, y)
                if how == 0:
                    continue
                k = at[base + y * size + x]
                at[base + y * size + x] = k + 1
                if len(entry):
                    inside = 1.0
                    if how == 1:
                        inside = polygon_area(cut, clip_to_square(corner, x, y, cut, spare))
                    entry[k] = t
                    area[k] = inside


@kernel
def keep_main_chart(first, entry, area, chart, texel_chart, kept):
    """Choose for each texel the chart with the largest area, and mark its entries.

    first : (n + 1,) int64, entries of texel i are first[i] to first[i + 1]
    entry : (m,) int32, triangles; area : (m,) float32, texels; chart : (T,) int32, of each triangle
    texel_chart : (n,) int32 output; kept : (m,) bool output, set for the entries of that chart
    Entries without area (touching corners) are dropped where the texel has others.
    """
    for i in range(len(first) - 1):
        best = -1.0
        main = -1
        for a in range(first[i], first[i + 1]):
            total = 0.0
            for b in range(first[i], first[i + 1]):
                if chart[entry[b]] == chart[entry[a]]:
                    total += area[b]
            if total > best:
                best = total
                main = chart[entry[a]]
        texel_chart[i] = main
        any_kept = False
        for a in range(first[i], first[i + 1]):
            if chart[entry[a]] == main and area[a] > 1.0e-7:
                kept[a] = True
                any_kept = True
        if not any_kept:
            for a in range(first[i], first[i + 1]):
                if chart[entry[a]] == main:
                    kept[a] = True
                    break


def morton_keys(pixel: NDArray[np.int64], size: int) -> NDArray[np.uint64]:
    """Return the (n,) uint64 Morton order of flat pixel numbers, page first (Morton, 1966)."""
    number, spread = np.arange(size, dtype=np.uint64), np.zeros(size, np.uint64)
    for bit in range(16):
        spread |= (number >> np.uint64(bit) & np.uint64(1)) << np.uint64(2 * bit)
    page, rest = np.divmod(pixel, size * size)
    row, column = np.divmod(rest, size)
    return page.astype(np.uint64) << np.uint64(32) | spread[row] << np.uint64(1) | spread[column]
