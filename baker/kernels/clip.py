# mypy: disable-error-code="no-untyped-def"
"""Clips triangles to the square of a texel; computes the area of the clipped polygon and points in it.

Based on: Sutherland and Hodgman, Reentrant polygon clipping, 1974.
"""

from __future__ import annotations

import math

import numpy as np

from baker.trace.jit import inner, larger, scratch, smaller

# Number of rows of a polygon array. A triangle clipped by four half-planes has at most seven corners, and
# clipping needs two more rows.
MAX_CORNERS = 9
# Working memory of kernels: a triangle (3, 2) and a clipped polygon (MAX_CORNERS, 2), float64.
new_triangle = scratch((3, 2), np.float64)
new_polygon = scratch((MAX_CORNERS, 2), np.float64)


@inner
def clip_to_square(corner, x0, y0, out, spare):
    """Clip a triangle to the texel [x0, x0 + 1] x [y0, y0 + 1]; return the number of corners in `out`.

    corner : (3, 2) float64, texels
    out : (MAX_CORNERS, 2) float64 output, corners relative to (x0, y0)
    spare : (MAX_CORNERS, 2) float64, working memory
    """
    n = 3
    for i in range(3):
        out[i, 0] = corner[i, 0] - x0
        out[i, 1] = corner[i, 1] - y0
    # Clip by x >= 0, x <= 1, y >= 0, y <= 1 in turn.
    for side in range(4):
        axis = side >> 1
        m = 0
        for i in range(n):
            j = i + 1 if i + 1 < n else 0
            a = out[i, axis] if side & 1 == 0 else 1.0 - out[i, axis]
            b = out[j, axis] if side & 1 == 0 else 1.0 - out[j, axis]
            if a >= 0.0:
                spare[m, 0] = out[i, 0]
                spare[m, 1] = out[i, 1]
                m += 1
            if (a >= 0.0) != (b >= 0.0):
                t = a / (a - b)
                spare[m, 0] = out[i, 0] + t * (out[j, 0] - out[i, 0])
                spare[m, 1] = out[i, 1] + t * (out[j, 1] - out[i, 1])
                m += 1
        n = m
        for i in range(n):
            out[i, 0] = spare[i, 0]
            out[i, 1] = spare[i, 1]
        if n == 0:
            return 0
    return n


@inner
def polygon_area(corner, n):
    """Return the unsigned area of a convex polygon of n corners.

    corner : (MAX_CORNERS, 2) float64; rows from n on are ignored
    """
    twice = 0.0
    for i in range(1, n - 1):
        twice += abs(
            (corner[i, 0] - corner[0, 0]) * (corner[i + 1, 1] - corner[0, 1])
            - (corner[i + 1, 0] - corner[0, 0]) * (corner[i, 1] - corner[0, 1])
        )
    return 0.5 * twice


@inner
def polygon_point(corner, n, u, v):
    """Map (u, v), uniform in the unit square, to a point (x, y), uniform in a convex polygon of n corners.

    corner : (MAX_CORNERS, 2) float64; rows from n on are ignored
    """
    if n < 3:
        x = 0.0
        y = 0.0
        for i in range(n):
            x += corner[i, 0] / n
            y += corner[i, 1] / n
        return x, y
    target = u * polygon_area(corner, n)
    last = n - 2
    for i in range(1, n - 1):
        ax = corner[i, 0] - corner[0, 0]
        ay = corner[i, 1] - corner[0, 1]
        bx = corner[i + 1, 0] - corner[0, 0]
        by = corner[i + 1, 1] - corner[0, 1]
        area = 0.5 * abs(ax * by - bx * ay)
        if target < area or i == last:
            s = math.sqrt(smaller(larger(target / area, 0.0), 1.0)) if area > 0.0 else 0.0
            return corner[0, 0] + s * (ax + v * (bx - ax)), corner[0, 1] + s * (ay + v * (by - ay))
        target -= area
    return corner[0, 0], corner[0, 1]


@inner
def square_touches(corner, x0, y0):
    """Return how a triangle overlaps the texel [x0, x0 + 1] x [y0, y0 + 1].

    corner : (3, 2) float64, texels
    Returns 0 if triangle and texel do not touch, 2 if the triangle covers the whole texel, else 1.
    """
    twice = (corner[1, 0] - corner[0, 0]) * (corner[2, 1] - corner[0, 1]) - (corner[2, 0] - corner[0, 0]) * (
        corner[1, 1] - corner[0, 1]
    )
    inside = twice != 0.0
    for i in range(3):
        j = i + 1 if i < 2 else 0
        # Evaluate the line equation of the edge, positive inside, at the texel's corners.
        nx = -(corner[j, 1] - corner[i, 1])
        ny = corner[j, 0] - corner[i, 0]
        if twice < 0.0:
            nx = -nx
            ny = -ny
        base = nx * (x0 - corner[i, 0]) + ny * (y0 - corner[i, 1])
        if base + larger(nx, 0.0) + larger(ny, 0.0) < 0.0:
            return 0
        # Treat a triangle without area as a line: it touches the texels that it crosses.
        if twice == 0.0 and base + smaller(nx, 0.0) + smaller(ny, 0.0) > 0.0:
            return 0
        if base + smaller(nx, 0.0) + smaller(ny, 0.0) < 0.0:
            inside = False
    return 2 if inside else 1
