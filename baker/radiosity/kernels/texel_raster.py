# mypy: disable-error-code="no-untyped-def"
"""Conservative rasterisation of charts: finds the triangles that touch each texel's square.

A first pass counts the triangles of each texel. A second pass writes the triangles, with their areas inside
the texel's square. Then each texel keeps the triangles of one chart: the chart with the largest area in the
texel.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.kernels.clip import clip_to_square, new_polygon, new_triangle, polygon_area, square_touches
from baker.trace.jit import inner, kernel, larger, smaller


@inner
def _corners(uv, triangle, t, size, corner):
    """Write the corners of triangle t in texels; return the range of its texels.

    Returns the first x, first y, last x and last y, inclusive.

    uv : (V, 2) float32; triangle : (T, 3) int32; size : int, width and height of a page, texels
    corner : (3, 2) float64 output
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
    # Shrink the range, so that a triangle that ends exactly between two texels does not touch the outer
    # texel.
    tiny = 1.0e-4
    first_x = larger(math.floor(low_x + tiny), 0)
    first_y = larger(math.floor(low_y + tiny), 0)
    last_x = smaller(larger(math.ceil(high_x - tiny) - 1, first_x), size - 1)
    last_y = smaller(larger(math.ceil(high_y - tiny) - 1, first_y), size - 1)
    return smaller(first_x, size - 1), smaller(first_y, size - 1), last_x, last_y


@kernel
def list_overlaps(uv, triangle, page, size, at, entry, area):
    """Write the triangles that touch each texel's square, ascending, and their areas in the square.

    uv : (V, 2) float32; triangle : (T, 3) int32; page : (T,) int32
    size : int, width and height of a page, texels
    at : (P * H * W,) int64, index at which the next triangle of each texel is written; increased by one for
        each triangle
    entry : (m,) int32 output, triangles; with shape (0,), only `at` is changed
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
    """Choose for each texel the chart with the largest area, and mark the triangles of this chart.

    first : (n + 1,) int64, texel i touches the triangles `entry[first[i] : first[i + 1]]`
    entry : (m,) int32, triangles; area : (m,) float32, their areas in the texel, texels
    chart : (T,) int32, chart of each triangle
    texel_chart : (n,) int32 output, chart of each texel
    kept : (m,) bool output, set for the items of `entry` that are triangles of the texel's chart
    If no triangle of the chart has area in the texel, one triangle is marked. Otherwise triangles without
    area in the texel are not marked.
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
    """Return (n,) uint64: keys that sort pixels by page, then in Morton order (Morton, 1966).

    pixel : (n,) int64, (page * size + row) * size + column
    """
    number, spread = np.arange(size, dtype=np.uint64), np.zeros(size, np.uint64)
    for bit in range(16):
        spread |= (number >> np.uint64(bit) & np.uint64(1)) << np.uint64(2 * bit)
    page, rest = np.divmod(pixel, size * size)
    row, column = np.divmod(rest, size)
    return page.astype(np.uint64) << np.uint64(32) | spread[row] << np.uint64(1) | spread[column]
