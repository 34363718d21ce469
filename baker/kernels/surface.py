# mypy: disable-error-code="no-untyped-def"
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
from numpy.typing import NDArray

from baker.kernels.clip import clip_to_square, new_polygon, new_triangle, polygon_area, polygon_point
from baker.kernels.sampling import hash_combine, texel_scramble
from baker.trace.jit import inner, kernel, larger, scratch, smaller

N_POINTS = 16
# Ray origins leave the surface by this share of the largest coordinate or of their triangle's size, whichever
# is less; but by at least sixteen float32 steps of either: origins and hits lose one, modellers some.
OFFSET, ROUNDING = 1.0e-5, 1.9e-6
# They also move so many of these steps towards the middle of their triangle (at most half the way).
INWARD = 2.0
# Only points with a barycentric below this lie near the border.
BORDER = 0.01
# Vertices whose normal leans further from the face (cosine) lift nothing: that is no smooth surface.
STEEPEST = 0.7
_u = np.uint32
_flat_row = scratch((5, 3), np.float64)


class Surface(NamedTuple):
    """Arrays of `core.geometry.Geometry` and `core.texels.TexelBuffer` that make points.

    position, normal (V, 3) float32; uv (V, 2) float32; triangle (T, 3) int32; face_normal (T, 3)
    float32; size int; pixel (n,) int64; front (n,) int32, the front entry of each; back (n,) bool;
    first (n_front + 1,) int64; entry (m,) int32; entry_area (m,) float32; sobol_points (16, 2) uint32;
    min_offset_scale float32, metres: no offset is computed from a smaller coordinate (but from smaller
    triangles).
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
    sobol_points: NDArray[np.uint32]
    min_offset_scale: np.float32


@inner
def inverse_uv(uv, triangle, size, t):
    """Return a to f of b1 = a x + b y + c, b2 = d x + e y + f of triangle t for texel-space (x, y)."""
    i0, i1, i2 = triangle[t, 0], triangle[t, 1], triangle[t, 2]
    ax, ay = float(uv[i0, 0]) * size, float(uv[i0, 1]) * size
    bx, by = float(uv[i1, 0]) * size - ax, float(uv[i1, 1]) * size - ay
    cx, cy = float(uv[i2, 0]) * size - ax, float(uv[i2, 1]) * size - ay
    det = bx * cy - by * cx
    if abs(det) <= 1.0e-12:
        return 0.0, 0.0, 1.0 / 3.0, 0.0, 0.0, 1.0 / 3.0
    return (
        cy / det, -cx / det, (ay * cx - ax * cy) / det,
        -by / det, bx / det, (ax * by - ay * bx) / det,
    )  # fmt: skip


@inner
def offset_step(x, y, z, size, min_offset_scale):
    """Return how far a ray origin at (x, y, z) leaves a triangle of this size, metres.

    size : largest edge component of the triangle; min_offset_scale : see `Surface`
    """
    far = larger(larger(abs(x), abs(y)), abs(z))
    return larger(ROUNDING * larger(far, size), OFFSET * smaller(larger(far, min_offset_scale), size))


@inner
def place(p, m, face, triangle, min_offset_scale, t, b1, b2, flip, origin, normal, n, k):
    """Write the ray origin and shading normal at barycentrics of triangle t to origin[n, k] and normal[n, k].

    p, m : (V, 3) positions and shading normals; face : (T, 3) face normals; min_offset_scale : see `Surface`
    """
    b1 = smaller(larger(b1, 0.0), 1.0)
    b2 = smaller(larger(b2, 0.0), 1.0 - b1)
    b0 = 1.0 - b1 - b2
    i0, i1, i2 = triangle[t, 0], triangle[t, 1], triangle[t, 2]
    px = b0 * p[i0, 0] + b1 * p[i1, 0] + b2 * p[i2, 0]
    py = b0 * p[i0, 1] + b1 * p[i1, 1] + b2 * p[i2, 1]
    pz = b0 * p[i0, 2] + b1 * p[i1, 2] + b2 * p[i2, 2]
    nx = b0 * m[i0, 0] + b1 * m[i1, 0] + b2 * m[i2, 0]
    ny = b0 * m[i0, 1] + b1 * m[i1, 1] + b2 * m[i2, 1]
    nz = b0 * m[i0, 2] + b1 * m[i1, 2] + b2 * m[i2, 2]
    fx, fy, fz = float(face[t, 0]), float(face[t, 1]), float(face[t, 2])
    sign = -1.0 if flip else 1.0
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    facing = nx * fx + ny * fy + nz * fz
    lx = ly = lz = 0.0
    if length < 1.0e-6 or facing <= 0.0:
        nx, ny, nz, length = fx, fy, fz, 1.0
    elif not flip and facing < 0.99999 * length:
        # Project onto the tangent planes of the three vertices that the point lies below.
        for i in range(3):
            vertex = i0 if i == 0 else (i1 if i == 1 else i2)
            weight = b0 if i == 0 else (b1 if i == 1 else b2)
            vx, vy, vz = float(m[vertex, 0]), float(m[vertex, 1]), float(m[vertex, 2])
            below = (px - p[vertex, 0]) * vx + (py - p[vertex, 1]) * vy + (pz - p[vertex, 2]) * vz
            if below < 0.0 and vx * fx + vy * fy + vz * fz > STEEPEST:
                lx -= weight * below * vx
                ly -= weight * below * vy
                lz -= weight * below * vz
    size = 0.0
    for a in range(3):
        size = larger(size, larger(abs(float(p[i1, a]) - p[i0, a]), abs(float(p[i2, a]) - p[i0, a])))
    step = offset_step(px, py, pz, size, min_offset_scale)
    away = sign * step
    if smaller(smaller(b0, b1), b2) < BORDER:
        # Also along the face: rounding must not put a point of its border behind the wall that meets it.
        mx = (p[i0, 0] + p[i1, 0] + p[i2, 0]) / 3.0 - px
        my = (p[i0, 1] + p[i1, 1] + p[i2, 1]) / 3.0 - py
        mz = (p[i0, 2] + p[i1, 2] + p[i2, 2]) / 3.0 - pz
        inward = smaller(INWARD * step / larger(math.sqrt(mx * mx + my * my + mz * mz), 1.0e-30), 0.5)
        lx += inward * mx
        ly += inward * my
        lz += inward * mz
    origin[n, k, 0] = px + lx + away * fx
    origin[n, k, 1] = py + ly + away * fy
    origin[n, k, 2] = pz + lz + away * fz
    scale = sign / length
    normal[n, k, 0] = scale * nx
    normal[n, k, 1] = scale * ny
    normal[n, k, 2] = scale * nz


@inner
def load_flat(p, m, face, triangle, t, sign, row):
    """Tell if all of triangle t is shaded with its face normal.

    row : (5, 3) float64, becomes what `place_flat` needs: corner 0, the edges from it, the normal times sign,
        the triangle's size
    """
    i0, i1, i2 = triangle[t, 0], triangle[t, 1], triangle[t, 2]
    along0 = along1 = along2 = 0.0
    for a in range(3):
        along0 += m[i0, a] * face[t, a]
        along1 += m[i1, a] * face[t, a]
        along2 += m[i2, a] * face[t, a]
        row[0, a] = p[i0, a]
        row[1, a] = float(p[i1, a]) - p[i0, a]
        row[2, a] = float(p[i2, a]) - p[i0, a]
        row[3, a] = sign * face[t, a]
        row[4, 0] = larger(0.0 if a == 0 else row[4, 0], larger(abs(row[1, a]), abs(row[2, a])))
    return smaller(smaller(along0, along1), along2) > 0.999999


@inner
def place_flat(row, min_offset_scale, b1, b2, origin, normal, n, k):
    """Do the work of `place` for a point inside a flat triangle, away from its border."""
    px = row[0, 0] + b1 * row[1, 0] + b2 * row[2, 0]
    py = row[0, 1] + b1 * row[1, 1] + b2 * row[2, 1]
    pz = row[0, 2] + b1 * row[1, 2] + b2 * row[2, 2]
    step = offset_step(px, py, pz, row[4, 0], min_offset_scale)
    origin[n, k, 0] = px + step * row[3, 0]
    origin[n, k, 1] = py + step * row[3, 1]
    origin[n, k, 2] = pz + step * row[3, 2]
    normal[n, k, 0] = row[3, 0]
    normal[n, k, 1] = row[3, 1]
    normal[n, k, 2] = row[3, 2]


@kernel
def place_points(surface, mask, chosen, wanted, origin, normal, hit_triangle, bary):
    """Write points of texel entries: origin and normal (m, w, 3) float32, world.

    mask : (n,) uint16, bit k is set where point k of a texel is not buried; a buried point is replaced
    by one that is not, if the texel has any
    chosen : (m,) int64, entries; wanted : (m or 1, w) uint8, which of their 16 points
    hit_triangle (m, w) int32 and bary (m, w, 2) float32 say where on which triangle each lies; with no rows
    they are left alone
    """
    corner, cut, spare, flat_row = new_triangle(), new_polygon(), new_polygon(), _flat_row()
    located = len(hit_triangle) > 0
    # Out of the tuple once: every access to a tuple's array costs an atomic reference count.
    position, shading, face = surface.position, surface.normal, surface.face_normal
    uv, triangle, sobol_points = surface.uv, surface.triangle, surface.sobol_points
    pixels, fronts, back = surface.pixel, surface.front, surface.back
    starts, entry, entry_area = surface.first, surface.entry, surface.entry_area
    size, min_offset_scale = surface.size, surface.min_offset_scale
    full = _u(0)
    same = len(wanted) == 1
    x0 = y0 = t = first = last = 0
    seed_x = seed_y = _u(0)
    total = a = b = c = d = g = h = 0.0
    sign = 1.0
    whole = flat = False
    for n in range(len(chosen)):
        i = chosen[n]
        if n == 0 or i != chosen[n - 1]:
            pixel = pixels[i]
            rest = pixel % (size * size)
            x0 = rest % size
            y0 = rest // size
            seed_x = hash_combine(_u(pixel), _u(11))
            seed_y = hash_combine(_u(pixel), _u(12))
            front = fronts[i]
            first, last = starts[front], starts[front + 1]
            total = 0.0
            for e in range(first, last):
                total += entry_area[e]
            whole = last - first == 1 and total > 0.999999
            t = entry[first]
            a, b, c, d, g, h = inverse_uv(uv, triangle, size, t)
            sign = -1.0 if back[i] else 1.0
            flat = whole and load_flat(position, shading, face, triangle, t, sign, flat_row)
        for w in range(wanted.shape[1]):
            k = valid_point(mask[i], wanted[0 if same else n, w])
            u = texel_scramble(sobol_points[k, 0], seed_x, full)
            v = texel_scramble(sobol_points[k, 1], seed_y, full)
            x = float(u)
            y = float(v)
            if not whole:
                e = first
                done = 0.0
                while e < last - 1 and u * total >= done + entry_area[e]:
                    done += entry_area[e]
                    e += 1
                t = entry[e]
                a, b, c, d, g, h = inverse_uv(uv, triangle, size, t)
                for j in range(3):
                    corner[j, 0] = uv[triangle[t, j], 0] * size
                    corner[j, 1] = uv[triangle[t, j], 1] * size
                m = clip_to_square(corner, x0, y0, cut, spare)
                inside = larger(float(entry_area[e]), 1.0e-30)
                if m == 0:
                    x, y = 0.5, 0.5
                elif m < 3 or polygon_area(cut, m) <= 0.0:
                    x, y = cut[0, 0], cut[0, 1]
                else:
                    x, y = polygon_point(cut, m, smaller(larger((u * total - done) / inside, 0.0), 1.0), v)
            x += x0
            y += y0
            b1 = a * x + b * y + c
            b2 = d * x + g * y + h
            if flat and smaller(smaller(b1, b2), 1.0 - b1 - b2) >= BORDER:
                place_flat(flat_row, min_offset_scale, b1, b2, origin, normal, n, w)
            else:
                place(
                    position,
                    shading,
                    face,
                    triangle,
                    min_offset_scale,
                    t,
                    b1,
                    b2,
                    back[i],
                    origin,
                    normal,
                    n,
                    w,
                )
            if located:
                hit_triangle[n, w] = t
                bary[n, w, 0] = b1
                bary[n, w, 1] = b2


@inner
def valid_point(bits, k):
    """Return point k if its bit is set, else the set bit number k modulo their count, else k."""
    bits = np.int64(bits)
    k = np.int64(k)
    if (bits >> k) & 1 or bits == 0:
        return k
    count = 0
    for j in range(N_POINTS):
        count += (bits >> j) & 1
    rank = k % count
    for j in range(N_POINTS):
        if (bits >> j) & 1:
            if rank == 0:
                return np.int64(j)
            rank -= 1
    return k
