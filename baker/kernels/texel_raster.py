"""Conservative rasterisation of charts: which triangles each texel's square touches.

A texel is an area. Two passes (count, fill) give a list of triangles per texel with the area of
each inside the texel's square; a texel belongs to the chart that covers most of it.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from baker.kernels.clip import MAX_CORNERS, clip_to_square, polygon_area, square_touches


@njit(cache=True, nogil=True, error_model="numpy")
def _corners(uv, triangle, t, size, corner):  # type: ignore[no-untyped-def]
    low_x = low_y = 1.0e30
    high_x = high_y = -1.0e30
    for i in range(3):
        x = uv[triangle[t, i], 0] * size
        y = uv[triangle[t, i], 1] * size
        corner[i, 0] = x
        corner[i, 1] = y
        low_x, high_x = min(low_x, x), max(high_x, x)
        low_y, high_y = min(low_y, y), max(high_y, y)
    # A border exactly on a texel's edge belongs to the texel that is filled, not to its neighbour.
    tiny = 1.0e-4
    first_x = max(math.floor(low_x + tiny), 0)
    first_y = max(math.floor(low_y + tiny), 0)
    last_x = min(max(math.ceil(high_x - tiny) - 1, first_x), size - 1)
    last_y = min(max(math.ceil(high_y - tiny) - 1, first_y), size - 1)
    return min(first_x, size - 1), min(first_y, size - 1), last_x, last_y


@njit(cache=True, nogil=True, error_model="numpy")
def count_overlaps(uv, triangle, page, size, count):  # type: ignore[no-untyped-def]
    """Add to `count` (P * H * W,) int32 how many triangles touch each texel's square."""
    corner = np.zeros((3, 2))
    for t in range(len(triangle)):
        x0, y0, x1, y1 = _corners(uv, triangle, t, size, corner)
        base = np.int64(page[t]) * size * size
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                if square_touches(corner, x, y):
                    count[base + y * size + x] += 1


@njit(cache=True, nogil=True, error_model="numpy")
def fill_overlaps(uv, triangle, page, size, start, entry, area):  # type: ignore[no-untyped-def]
    """Write each texel's triangles and their areas (in texels) behind `start` (P * H * W,) int64.

    `start` is moved to the end of each texel's list. Triangles come in rising order.
    """
    corner = np.zeros((3, 2))
    cut = np.zeros((MAX_CORNERS, 2))
    spare = np.zeros((MAX_CORNERS, 2))
    for t in range(len(triangle)):
        x0, y0, x1, y1 = _corners(uv, triangle, t, size, corner)
        base = np.int64(page[t]) * size * size
        for y in range(y0, y1 + 1):
            for x in range(x0, x1 + 1):
                how = square_touches(corner, x, y)
                if how:
                    inside = 1.0
                    if how == 1:
                        inside = polygon_area(cut, clip_to_square(corner, x, y, cut, spare))
                    at = start[base + y * size + x]
                    entry[at] = t
                    area[at] = inside
                    start[base + y * size + x] = at + 1


@njit(cache=True, nogil=True, error_model="numpy")
def keep_main_chart(first, entry, area, chart, texel_chart, kept):  # type: ignore[no-untyped-def]
    """Choose for each texel the chart with the largest area; mark its entries in `kept`.

    first : (n + 1,) int64, entries of texel i are first[i] to first[i + 1]
    texel_chart : (n,) int32 output; kept : (m,) bool output
    Entries of no area (touching corners) are dropped where the texel has others.
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


@njit(cache=True, nogil=True, error_model="numpy")
def morton_code(x, y):  # type: ignore[no-untyped-def]
    """Interleave the bits of two numbers below 65536 (Morton, 1966)."""
    code = np.uint64(0)
    for bit in range(16):
        code |= (np.uint64(x >> bit) & np.uint64(1)) << np.uint64(2 * bit)
        code |= (np.uint64(y >> bit) & np.uint64(1)) << np.uint64(2 * bit + 1)
    return code


@njit(cache=True, nogil=True, error_model="numpy")
def morton_keys(pixel, size, key):  # type: ignore[no-untyped-def]
    """Write to `key` (n,) uint64 the Morton order of flat pixel numbers (page first)."""
    for i in range(len(pixel)):
        page = pixel[i] // (size * size)
        rest = pixel[i] - page * size * size
        key[i] = (np.uint64(page) << np.uint64(32)) | morton_code(rest % size, rest // size)
