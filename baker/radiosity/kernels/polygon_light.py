# mypy: disable-error-code="no-untyped-def"
"""Computes the unoccluded irradiance from triangles of uniform radiance, in closed form.

    E = L / 2 |sum_i angle_i Gamma_i . n|

The triangle is clipped to the half space above the tangent plane of the receiving point. The sum is over the
edges i of the clipped polygon. n is the unit normal at the point, and L the radiance. angle_i is the angle
that edge i subtends at the point. Gamma_i is the unit normal of the plane through the point and the edge. If
a and b are the vectors from the point to the edge's ends,

    angle Gamma = angle / sin(angle) (a x b) / (|a| |b|)

Based on: Lambert, Photometria, 1760; Arvo, Analytic methods for simulated light transport, 1995;
Abramowitz and Stegun, Handbook of mathematical functions, 1964, 4.4.46 (the polynomial).
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.emitters import AREA, CORNER, CORNER_1, CORNER_2, NORMAL, RADIANCE, TWO_SIDED
from baker.kernels.surface import N_POINTS
from baker.trace.jit import inner, larger, pasted, scratch, smaller
from baker.trace.packets import PACKET_WIDTH

_f = np.float32
# Rows of the working memory:
#
#     _ORIGIN, _NORMAL   position and normal of the point (3 each)
#     _ARM               vectors from the point to up to four corners (12)
#     _HEIGHT            heights of the triangle's three corners above the tangent plane (3)
#     _SUM               sum over the edges of angle_i Gamma_i . n
#     _SMALL             E / L of a triangle that is treated as a point, -1 for other triangles
#     _FACING            1 if the triangle emits from the side that faces the point, else 0
_ORIGIN, _NORMAL, _ARM, _HEIGHT, _SUM, _SMALL, _FACING = 0, 3, 6, 18, 21, 22, 23
_ROWS = 24
_work, _corners = scratch((_ROWS * PACKET_WIDTH,), _f), scratch((15,), _f)
# Limit of (longest edge / distance)^2 of a triangle. Below this limit, the triangle is treated as a point at
# its centroid, because rounding errors in float32 would dominate the sum over edges. The relative error of
# this approximation is about 1e-5.
_SMALL_VIEW = np.float32(1.0e-4)


@inner
def angle_over_sine(x, sine):
    """Return angle / sin(angle) from the angle's cosine x in [-1, 1] and sine; relative error below 1e-6.

    The sine is an argument, because near 180 degrees the float32 cosine does not determine it accurately.
    """
    y = abs(x)
    series = _f(1.5707963050) + y * (
        _f(-0.2145988016)
        + y * (
            _f(0.0889789874)
            + y * (
                _f(-0.0501743046)
                + y * (
                    _f(0.0308918810)
                    + y * (_f(-0.0170881256) + y * (_f(0.0066700901) + y * _f(-0.0012624911)))
                )
            )
        )
    )  # fmt: skip
    acute = series / math.sqrt(_f(1.0) + y)
    return acute if x >= _f(0.0) else _f(math.pi) / larger(sine, _f(1.0e-12)) - acute


@inner
def unoccluded_irradiance(origin, normal, group, lanes, row, found):
    """Write the unoccluded irradiance of up to sixteen texels from all emitters.

    origin, normal : (m, 16, 3) float32, metres and unit vectors, world
    group, lanes : first texel and number of texels to compute
    row : (M, 24) float32, see `kernels.emitters.Emitters`; untextured emitters only
    found : (3 * 16,) float32 output, lx, by colour and lane; means over each texel's 16 points
    """
    work = _work()
    for j in range(3 * PACKET_WIDTH):
        found[j] = _f(0.0)
    for k in range(N_POINTS):
        for lane in range(lanes):
            for a in range(3):
                work[(_ORIGIN + a) * PACKET_WIDTH + lane] = origin[group + lane, k, a]
                work[(_NORMAL + a) * PACKET_WIDTH + lane] = normal[group + lane, k, a]
        for m in range(len(row)):
            corners = _load_triangle(work, row, m, lanes)
            if corners:
                _add_edges(work, corners)
                for c in range(3):
                    scale = row[m, RADIANCE + c] / _f(N_POINTS)
                    for lane in range(PACKET_WIDTH):
                        small, turned = (
                            work[_SMALL * PACKET_WIDTH + lane],
                            work[_FACING * PACKET_WIDTH + lane],
                        )
                        light = abs(_f(0.5) * work[_SUM * PACKET_WIDTH + lane])
                        found[c * PACKET_WIDTH + lane] += (
                            scale * turned * (small if small >= _f(0.0) else light)
                        )


@pasted
def _load_corner(work, j, x, y, z):
    """Write the vector from each lane's point to corner j at (x, y, z), and the corner's height.

    work : (24 * 16,) float32, see the row names
    """
    for lane in range(PACKET_WIDTH):
        ax, ay, az = x - work[lane], y - work[PACKET_WIDTH + lane], z - work[2 * PACKET_WIDTH + lane]
        work[(_ARM + 3 * j) * PACKET_WIDTH + lane] = ax
        work[(_ARM + 3 * j + 1) * PACKET_WIDTH + lane] = ay
        work[(_ARM + 3 * j + 2) * PACKET_WIDTH + lane] = az
        height = ax * work[_NORMAL * PACKET_WIDTH + lane] + ay * work[(_NORMAL + 1) * PACKET_WIDTH + lane]
        work[(_HEIGHT + j) * PACKET_WIDTH + lane] = height + az * work[(_NORMAL + 2) * PACKET_WIDTH + lane]


@inner
def _load_triangle(work, row, m, lanes):
    """Write the corners of triangle m, clipped to the half space above each point's tangent plane.

    work : (24 * 16,) float32, see the row names; row : (M, 24) float32, see `kernels.emitters.Emitters`
    Returns the largest number of corners of any lane, 3 or 4; 0 if the triangle lights no lane's point.
    """
    # Load the corners. Each coordinate is passed as a number, and the number of the corner as a constant.
    # Therefore the compiler vectorises the loop over lanes in `_load_corner`.
    _load_corner(work, 0, row[m, CORNER], row[m, CORNER + 1], row[m, CORNER + 2])
    _load_corner(work, 1, row[m, CORNER_1], row[m, CORNER_1 + 1], row[m, CORNER_1 + 2])
    _load_corner(work, 2, row[m, CORNER_2], row[m, CORNER_2 + 1], row[m, CORNER_2 + 2])
    # Compute the square of the longest edge.
    longest = _f(0.0)
    for j in range(3):
        edge = _f(0.0)
        for a in range(3):
            step = row[m, CORNER + 3 * ((j + 1) % 3) + a] - row[m, CORNER + 3 * j + a]
            edge += step * step
        longest = larger(longest, edge)
    nx, ny, nz = row[m, NORMAL], row[m, NORMAL + 1], row[m, NORMAL + 2]
    two_sided, area = row[m, TWO_SIDED] > _f(0.0), row[m, AREA]
    # Compute E / L of small triangles from the centroid, and whether an emitting side faces the point.
    third = _f(1.0 / 3.0)
    for lane in range(PACKET_WIDTH):
        x = (
            work[_ARM * PACKET_WIDTH + lane]
            + work[(_ARM + 3) * PACKET_WIDTH + lane]
            + work[(_ARM + 6) * PACKET_WIDTH + lane]
        )
        y = (
            work[(_ARM + 1) * PACKET_WIDTH + lane]
            + work[(_ARM + 4) * PACKET_WIDTH + lane]
            + work[(_ARM + 7) * PACKET_WIDTH + lane]
        )
        z = (
            work[(_ARM + 2) * PACKET_WIDTH + lane]
            + work[(_ARM + 5) * PACKET_WIDTH + lane]
            + work[(_ARM + 8) * PACKET_WIDTH + lane]
        )
        work[(_ARM + 9) * PACKET_WIDTH + lane] = work[(_ARM + 6) * PACKET_WIDTH + lane]
        work[(_ARM + 10) * PACKET_WIDTH + lane] = work[(_ARM + 7) * PACKET_WIDTH + lane]
        work[(_ARM + 11) * PACKET_WIDTH + lane] = work[(_ARM + 8) * PACKET_WIDTH + lane]
        facing = -third * (x * nx + y * ny + z * nz)
        square = larger(third * third * (x * x + y * y + z * z), _f(1.0e-30))
        low = work[_HEIGHT * PACKET_WIDTH + lane] + work[(_HEIGHT + 1) * PACKET_WIDTH + lane]
        height = larger(low + work[(_HEIGHT + 2) * PACKET_WIDTH + lane], _f(0.0)) * third
        small = longest < _SMALL_VIEW * square
        work[_SMALL * PACKET_WIDTH + lane] = (
            area * height * abs(facing) / (square * square) if small else _f(-1.0)
        )
        work[_FACING * PACKET_WIDTH + lane] = _f(1.0) if two_sided or facing > _f(0.0) else _f(0.0)
    # Clip the triangles that cross a tangent plane.
    corners = 0
    for lane in range(lanes):
        above = 0
        for j in range(3):
            above += 1 if work[(_HEIGHT + j) * PACKET_WIDTH + lane] > _f(0.0) else 0
        if above == 0:
            work[_FACING * PACKET_WIDTH + lane] = _f(0.0)
        if work[_FACING * PACKET_WIDTH + lane] > _f(0.0):
            corners = larger(corners, 3 if above == 3 else 4)
            if above < 3:
                _clip(work, lane)
    return corners


@inner
def _clip(work, lane):
    """Clip a lane's triangle to the half space above the tangent plane: three or four corners remain.

    work : (24 * 16,) float32, see the row names
    """
    corner = _corners()
    n = 0
    for j in range(3):
        after = (j + 1) % 3
        here, there = work[(_HEIGHT + j) * PACKET_WIDTH + lane], work[(_HEIGHT + after) * PACKET_WIDTH + lane]
        if here > _f(0.0):
            for a in range(3):
                corner[3 * n + a] = work[(_ARM + 3 * j + a) * PACKET_WIDTH + lane]
            n += 1
        if (here > _f(0.0)) != (there > _f(0.0)):
            share = here / (here - there)
            for a in range(3):
                first = work[(_ARM + 3 * j + a) * PACKET_WIDTH + lane]
                second = work[(_ARM + 3 * after + a) * PACKET_WIDTH + lane]
                corner[3 * n + a] = first + share * (second - first)
            n += 1
    for j in range(4):
        for a in range(3):
            work[(_ARM + 3 * j + a) * PACKET_WIDTH + lane] = corner[3 * smaller(j, n - 1) + a]


@pasted
def _add_edge(work, first, second):
    """Add the edge between two corners to `_SUM` of every lane; edges of zero length add 0.

    work : (24 * 16,) float32, see the row names
    """
    for lane in range(PACKET_WIDTH):
        ax, bx = (
            work[(_ARM + 3 * first) * PACKET_WIDTH + lane],
            work[(_ARM + 3 * second) * PACKET_WIDTH + lane],
        )
        ay, by = (
            work[(_ARM + 3 * first + 1) * PACKET_WIDTH + lane],
            work[(_ARM + 3 * second + 1) * PACKET_WIDTH + lane],
        )
        az, bz = (
            work[(_ARM + 3 * first + 2) * PACKET_WIDTH + lane],
            work[(_ARM + 3 * second + 2) * PACKET_WIDTH + lane],
        )
        ex, ey, ez = bx - ax, by - ay, bz - az
        cx, cy, cz = ay * ez - az * ey, az * ex - ax * ez, ax * ey - ay * ex
        squares = (ax * ax + ay * ay + az * az) * (bx * bx + by * by + bz * bz)
        inverse = _f(1.0) / math.sqrt(larger(squares, _f(1.0e-30)))
        cosine = smaller(larger((ax * bx + ay * by + az * bz) * inverse, _f(-1.0)), _f(1.0))
        sine = math.sqrt(cx * cx + cy * cy + cz * cz) * inverse
        spread = cx * work[_NORMAL * PACKET_WIDTH + lane] + cy * work[(_NORMAL + 1) * PACKET_WIDTH + lane]
        spread += cz * work[(_NORMAL + 2) * PACKET_WIDTH + lane]
        work[_SUM * PACKET_WIDTH + lane] += spread * inverse * angle_over_sine(cosine, sine)


@inner
def _add_edges(work, corners):
    """Write the sum over the edges of every lane's polygon to `_SUM`.

    work : (24 * 16,) float32, see the row names; corners : 3 or 4
    """
    for lane in range(PACKET_WIDTH):
        work[_SUM * PACKET_WIDTH + lane] = _f(0.0)
    _add_edge(work, 0, 1)
    _add_edge(work, 1, 2)
    if corners == 3:
        _add_edge(work, 2, 0)
    else:
        _add_edge(work, 2, 3)
        _add_edge(work, 3, 0)
