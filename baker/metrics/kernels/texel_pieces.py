# mypy: disable-error-code="no-untyped-def"
"""Finds the pieces of triangles inside texels, and chooses random points in the pieces.

A piece is the polygon in which a triangle, in uv, overlaps the square of a texel. It is found by clipping
(`baker.kernels.clip`), independent of the rasteriser of the bake.
Based on: Sutherland and Hodgman, Reentrant polygon clipping, 1974.
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
    """Return the first column, last column, first row and last row of the texels that a triangle may touch.

    corner : (3, 2) float64, uv of the triangle's corners in texels
    size : int, width and height of the page in texels
    """
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
    """For each texel, find the instance of the triangle that covers the largest area of the texel.

    N is the number of texels of all pages.

    uv : (V, 2) float32, lightmap uv of the vertices, 0 to 1
    triangle : (T, 3) int32, indices into `uv`
    page, instance : (T,) int32, page and instance of each triangle
    size : int, width and height of a page in texels
    owner : (N,) int32 output, the instance; unchanged if no triangle covers more than `most`
    most : (N,) float32 in and output, largest area that a triangle covers, in texels
    """
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
    """Count the pieces of triangles inside n selected texels; also store them if `write` is not empty.

    N is the number of texels of all pages, and m the number of pieces.

    uv : (V, 2) float32, lightmap uv of the vertices, 0 to 1
    triangle : (T, 3) int32, indices into `uv`
    page : (T,) int32, page of each triangle
    size : int, width and height of a page in texels
    wanted : (N,) int32, number i of each texel among the selected texels, -1 if it is not selected
    at : (n,) int64 in and output. In: index at which the first piece of texel i is stored. Out: that
        index plus the number of pieces of texel i.
    piece, corners : (m,) int64 output, triangle of each piece, and number of corners of its polygon
    polygon : (m, MAX_CORNERS, 2) float64 output, corners of each piece, relative to the texel's square
    write : (0 or 1,) int64, empty to count the pieces only
    area : (m,) float64 output, area of each piece in texels
    """
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
    """Choose k points in the pieces of each of n texels, with uniform density in uv.

    For a texel without pieces, only `covered` is written.

    uv : (V, 2) float32, lightmap uv of the vertices, 0 to 1
    triangle : (T, 3) int32, indices into `uv`
    size : int, width and height of a page in texels
    pixel : (n,) int64, (page * size + row) * size + column
    start : (n + 1,) int64, index of the first piece of each texel; the last entry is the number of pieces
    piece, corners, polygon, area : the pieces, as `texel_pieces` stores them
    random : (n, k, 3) float64, 0 to 1, random numbers: one selects the piece, two the point in it
    found : (n, k) int64 output, triangle of each point
    weight : (n, k, 3) float64 output, barycentric coordinates of each point
    covered : (n,) float64 output, total area of each texel's pieces, in texels
    middle : (n, 2) float64 in and output. The kernel adds the mean position of each texel's points, as
        (column, row) inside the texel's square, 0 to 1.
    """
    for i in range(len(pixel)):
        # Sum the area of the texel's pieces.
        first, last = start[i], start[i + 1]
        total = 0.0
        for e in range(first, last):
            total += area[e]
        covered[i] = total
        rest = pixel[i] % (size * size)
        for k in range(random.shape[1]):
            # Choose a piece in proportion to its area.
            left = random[i, k, 0] * total
            e = first
            while e < last - 1 and left >= area[e]:
                left -= area[e]
                e += 1
            if e >= last:
                continue
            # Choose a point in the piece, uniformly.
            x, y = polygon_point(polygon[e], corners[e], random[i, k, 1], random[i, k, 2])
            middle[i, 0] += x / random.shape[1]
            middle[i, 1] += y / random.shape[1]
            x += rest % size
            y += rest // size
            # Compute the barycentric coordinates of the point.
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
