"""The surface as kernels see it, and the points in a texel that rays start from.

Each texel has 16 points, uniform in the area that its triangles take of its square, stratified by a
scrambled (0,2)-net. Points on low-poly curved surfaces are lifted to the surface that the shading
normals suggest, so that no ray is lost behind a facet.

Based on: Hanika, Hacking the shadow terminator, Ray Tracing Gems II, 2021; Waechter and Binder, A
fast and robust method for avoiding self-intersection, Ray Tracing Gems, 2019.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from baker.kernels.clip import MAX_CORNERS, clip_to_square, polygon_area, polygon_point
from baker.kernels.sampling import hash_combine, texel_scramble

N_POINTS = 16
# Ray origins leave the surface by this share of the largest coordinate: a few dozen float32 steps.
OFFSET = np.float32(1.0e-5)
_u = np.uint32
_f = np.float32


class Surface(NamedTuple):
    """Arrays of `core.geometry.Geometry` and `core.texels.TexelBuffer` that make points.

    position, normal (V, 3) float32; uv (V, 2) float32; triangle (T, 3) int32; face_normal (T, 3)
    float32; size int; pixel (n,) int64; front (n,) int32, the front entry of each; back (n,) bool;
    first (n_front + 1,) int64; entry (m,) int32; entry_area (m,) float32; net (16, 2) uint32;
    least float32, metres: no offset is computed from a smaller coordinate.
    """

    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    uv: NDArray[np.float32]
    triangle: NDArray[np.int32]
    face_normal: NDArray[np.float32]
    size: int
    pixel: NDArray[np.int64]
    front: NDArray[np.int32]
    back: NDArray[np.bool_]
    first: NDArray[np.int64]
    entry: NDArray[np.int32]
    entry_area: NDArray[np.float32]
    net: NDArray[np.uint32]
    least: np.float32


@njit(cache=True, nogil=True)
def _place(surface, t, x, y, flip, origin, normal):  # type: ignore[no-untyped-def]
    """Write the world point and shading normal of texel-space point (x, y) on triangle t; return b1, b2."""
    size = surface.size
    i0, i1, i2 = surface.triangle[t, 0], surface.triangle[t, 1], surface.triangle[t, 2]
    ax, ay = surface.uv[i0, 0] * size, surface.uv[i0, 1] * size
    bx, by = surface.uv[i1, 0] * size - ax, surface.uv[i1, 1] * size - ay
    cx, cy = surface.uv[i2, 0] * size - ax, surface.uv[i2, 1] * size - ay
    det = bx * cy - by * cx
    b1 = b2 = 1.0 / 3.0
    if abs(det) > 1.0e-12:
        b1 = min(max(((x - ax) * cy - (y - ay) * cx) / det, 0.0), 1.0)
        b2 = min(max((bx * (y - ay) - by * (x - ax)) / det, 0.0), 1.0 - b1)
    b0 = 1.0 - b1 - b2
    px = np.zeros(3)
    nx = np.zeros(3)
    lifted = np.zeros(3)
    for a in range(3):
        px[a] = b0 * surface.position[i0, a] + b1 * surface.position[i1, a] + b2 * surface.position[i2, a]
        nx[a] = b0 * surface.normal[i0, a] + b1 * surface.normal[i1, a] + b2 * surface.normal[i2, a]
    sign = -1.0 if flip else 1.0
    face = surface.face_normal[t]
    length = math.sqrt(nx[0] * nx[0] + nx[1] * nx[1] + nx[2] * nx[2])
    facing = nx[0] * face[0] + nx[1] * face[1] + nx[2] * face[2]
    if length < 1.0e-6 or facing <= 0.0:
        for a in range(3):
            nx[a] = face[a]
        length = 1.0
    elif not flip and facing < 0.99999 * length:
        # Project onto the tangent planes of the three vertices that the point lies below.
        for i in range(3):
            vertex = i0 if i == 0 else (i1 if i == 1 else i2)
            weight = b0 if i == 0 else (b1 if i == 1 else b2)
            below = 0.0
            turned = 0.0
            for a in range(3):
                below += (px[a] - surface.position[vertex, a]) * surface.normal[vertex, a]
                turned += surface.normal[vertex, a] * face[a]
            if below < 0.0 and turned > 0.7:
                for a in range(3):
                    lifted[a] -= weight * below * surface.normal[vertex, a]
    largest = max(abs(px[0]), abs(px[1]), abs(px[2]), surface.least)
    for a in range(3):
        normal[a] = _f(sign * nx[a] / length)
        origin[a] = _f(px[a] + lifted[a] + sign * face[a] * OFFSET * largest)
    return b1, b2


@njit(cache=True, nogil=True)
def place_points(surface, begin, end, origin, normal, hit_triangle, bary):  # type: ignore[no-untyped-def]
    """Write the 16 points of entries begin to end: origin, normal (n, 16, 3) float32, all world space.

    hit_triangle (n, 16) int32 and bary (n, 16, 2) float32 say where on which triangle each lies.
    """
    corner = np.zeros((3, 2))
    cut = np.zeros((MAX_CORNERS, 2))
    spare = np.zeros((MAX_CORNERS, 2))
    size = surface.size
    full = _u(0)
    for i in range(begin, end):
        pixel = surface.pixel[i]
        rest = pixel % (size * size)
        x0 = rest % size
        y0 = rest // size
        seed_x = hash_combine(_u(pixel), _u(11))
        seed_y = hash_combine(_u(pixel), _u(12))
        front = surface.front[i]
        first, last = surface.first[front], surface.first[front + 1]
        total = 0.0
        for e in range(first, last):
            total += surface.entry_area[e]
        whole = last - first == 1 and total > 0.999999
        # The net's first number rises with k here, so that one walk along the triangles serves all points.
        e = first
        t = surface.entry[e]
        done = 0.0
        m = -1
        for k in range(N_POINTS):
            u = texel_scramble(surface.net[k, 0], seed_x, full)
            v = texel_scramble(surface.net[k, 1], seed_y, full)
            if whole:
                x = float(u)
                y = float(v)
            else:
                e = first
                done = 0.0
                while e < last - 1 and u * total >= done + surface.entry_area[e]:
                    done += surface.entry_area[e]
                    e += 1
                t = surface.entry[e]
                for c in range(3):
                    corner[c, 0] = surface.uv[surface.triangle[t, c], 0] * size
                    corner[c, 1] = surface.uv[surface.triangle[t, c], 1] * size
                m = clip_to_square(corner, x0, y0, cut, spare)
                inside = max(float(surface.entry_area[e]), 1.0e-30)
                if m == 0:
                    x, y = 0.5, 0.5
                elif m < 3 or polygon_area(cut, m) <= 0.0:
                    x, y = cut[0, 0], cut[0, 1]
                else:
                    x, y = polygon_point(cut, m, min(max((u * total - done) / inside, 0.0), 1.0), v)
            n = i - begin
            b1, b2 = _place(surface, t, x0 + x, y0 + y, surface.back[i], origin[n, k], normal[n, k])
            hit_triangle[n, k] = t
            bary[n, k, 0] = b1
            bary[n, k, 1] = b2


@njit(cache=True, nogil=True)
def drop_buried(mask, begin, end, origin, normal):  # type: ignore[no-untyped-def]
    """Replace buried points (bit k of `mask` (n,) uint16 is 0) by the texel's other points, in turn.

    Texels without any good point are left alone.
    """
    for i in range(begin, end):
        if mask[i] == np.uint16(0xFFFF) or mask[i] == np.uint16(0):
            continue
        n = i - begin
        source = 0
        for k in range(N_POINTS):
            if (mask[i] >> k) & 1:
                continue
            while not (mask[i] >> source) & 1:
                source = (source + 1) % N_POINTS
            for a in range(3):
                origin[n, k, a] = origin[n, source, a]
                normal[n, k, a] = normal[n, source, a]
            source = (source + 1) % N_POINTS
