# mypy: disable-error-code="no-untyped-def"
"""Pieces of triangles inside texels, for a judge who shares no code with the baker's own raster.

Triangles are cut to a texel's square one by one (Sutherland and Hodgman, 1974, by way of `clip`).
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.clip import (
    MAX_CORNERS,
    clip_to_square,
    new_polygon,
    new_triangle,
    polygon_area,
    polygon_point,
)
from baker.trace.jit import inner, kernel, larger, smaller


@inner
def _box(corner, size):
    """Return first column, last column, first row, last row of texels that a triangle (3, 2) may touch."""
    low_x = smaller(smaller(corner[0, 0], corner[1, 0]), corner[2, 0])
    high_x = larger(larger(corner[0, 0], corner[1, 0]), corner[2, 0])
    low_y = smaller(smaller(corner[0, 1], corner[1, 1]), corner[2, 1])
    high_y = larger(larger(corner[0, 1], corner[1, 1]), corner[2, 1])
    return (
        max(math.floor(low_x), 0), min(math.floor(high_x), size - 1),
        max(math.floor(low_y), 0), min(math.floor(high_y), size - 1),
    )  # fmt: skip


@kernel
def texel_owners(uv, triangle, page, instance, size, owner, most):
    """Write to `owner` the instance that covers most of each pixel; `most` is that area, in texels."""
    corner, cut, spare = new_triangle(), new_polygon(), new_polygon()
    for t in range(len(triangle)):
        for j in range(3):
            corner[j, 0] = uv[triangle[t, j], 0] * size
            corner[j, 1] = uv[triangle[t, j], 1] * size
        left, right, top, bottom = _box(corner, size)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                pixel = (np.int64(page[t]) * size + y) * size + x
                inside = polygon_area(cut, clip_to_square(corner, x, y, cut, spare))
                if inside > most[pixel]:
                    most[pixel] = inside
                    owner[pixel] = instance[t]


@kernel
def texel_pieces(uv, triangle, page, size, wanted, at, piece, corners, polygon, write, area):
    """Count the pieces of triangles inside wanted texels (no `write`), or store them from `at` on."""
    corner, cut, spare = new_triangle(), new_polygon(), new_polygon()
    for t in range(len(triangle)):
        for j in range(3):
            corner[j, 0] = uv[triangle[t, j], 0] * size
            corner[j, 1] = uv[triangle[t, j], 1] * size
        left, right, top, bottom = _box(corner, size)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                i = wanted[(np.int64(page[t]) * size + y) * size + x]
                if i < 0:
                    continue
                n = clip_to_square(corner, x, y, cut, spare)
                inside = polygon_area(cut, n)
                if inside <= 0.0:
                    continue
                if len(write):
                    k = at[i]
                    piece[k], corners[k], area[k] = t, n, inside
                    for j in range(MAX_CORNERS):
                        polygon[k, j, 0], polygon[k, j, 1] = cut[j, 0], cut[j, 1]
                at[i] += 1


@kernel
def spread_pieces(
    uv, triangle, size, pixel, start, piece, corners, polygon, area, random, found, weight, covered, middle
):
    """Choose places uniform in the area of a texel's pieces: their triangles, weights and area in all.

    middle : (n, 2) float64 output, mean of the places in the texel's square, 0 to 1 (column, row)
    """
    for i in range(len(pixel)):
        first, last = start[i], start[i + 1]
        total = 0.0
        for e in range(first, last):
            total += area[e]
        covered[i] = total
        rest = pixel[i] % (size * size)
        for k in range(random.shape[1]):
            left = random[i, k, 0] * total
            e = first
            while e < last - 1 and left >= area[e]:
                left -= area[e]
                e += 1
            if e >= last:
                continue
            x, y = polygon_point(polygon[e], corners[e], random[i, k, 1], random[i, k, 2])
            middle[i, 0] += x / random.shape[1]
            middle[i, 1] += y / random.shape[1]
            x += rest % size
            y += rest // size
            t = piece[e]
            a, b, c = triangle[t, 0], triangle[t, 1], triangle[t, 2]
            ax, ay = float(uv[a, 0]) * size, float(uv[a, 1]) * size
            bx, by = uv[b, 0] * size - ax, uv[b, 1] * size - ay
            cx, cy = uv[c, 0] * size - ax, uv[c, 1] * size - ay
            det = bx * cy - by * cx
            w1 = w2 = 1.0 / 3.0
            if det != 0.0:
                w1 = min(max(((x - ax) * cy - (y - ay) * cx) / det, 0.0), 1.0)
                w2 = min(max((bx * (y - ay) - by * (x - ax)) / det, 0.0), 1.0 - w1)
            found[i, k] = t
            weight[i, k, 0], weight[i, k, 1], weight[i, k, 2] = 1.0 - w1 - w2, w1, w2
