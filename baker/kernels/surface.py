# mypy: disable-error-code="no-untyped-def"
"""Computes the sample points of texels, from which rays start.

Each texel has 16 points. They are uniformly distributed in the part of the texel's square that triangles
cover, and stratified by a scrambled (0,2)-net. On low-poly curved surfaces, points are moved to the smooth
surface that the shading normals imply (Hanika 2021). Otherwise facets would block each other's rays at the
shadow terminator.

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

# Number of sample points of a texel.
N_POINTS = 16
# Factors of the offset of ray origins along the face normal. The offset is
#
#     max(ROUNDING max(x, s), OFFSET min(x, s))
#
# x is the largest absolute coordinate of the point, and s the largest absolute component of the triangle's
# edges 1 and 2. ROUNDING is sixteen times the relative spacing of float32 numbers. Rounding moves an origin
# and a hit by one spacing each, and faces that are meant to be coplanar may be a few spacings apart.
OFFSET, ROUNDING = 1.0e-5, 1.9e-6
# Distance by which points near the border of their triangle are moved towards its centroid, as a multiple of
# the offset. The distance is at most half of the distance to the centroid.
INWARD = 2.0
# Limit of the smallest barycentric coordinate of a point. Below this limit, the point is near the border.
BORDER = 0.01
# Limit of the cosine between a vertex normal and the face normal. Up to this limit, the vertex is on a hard
# edge, not on a smooth surface, and is left out of the shadow-terminator offset (Hanika 2021).
STEEPEST = 0.7
_u = np.uint32
# Rows of the output of `load_flat`: corner 0, edges 1 and 2, signed face normal (3 each), triangle size (1).
_CORNER, _EDGE_1, _EDGE_2, _NORMAL, _SIZE = 0, 1, 2, 3, 4
_flat_row = scratch((5, 3), np.float64)


class Surface(NamedTuple):
    """Arrays of `core.geometry.Geometry` and `core.texels.TexelBuffer` from which sample points are computed.

    A texel entry is the front of a texel, its back on a double-sided surface, or a further side of a texel
    that another surface passes through (`radiosity.sides`).

    Attributes
    ----------
    position, normal : (V, 3) float32
        Positions in metres, and unit shading normals, of lightmap vertices.
    uv : (V, 2) float32
        Lightmap uv.
    triangle : (T, 3) int32
        Lightmap vertices of each triangle.
    face_normal : (T, 3) float32
        Unit face normals.
    size : int
        Width and height of a page, texels.
    pixel : (n,) int64
        (page * size + row) * size + column of each texel entry.
    front : (n,) int32
        Front entry of the texel of each entry.
    back : (n,) bool
        Whether the entry is on the back of a double-sided surface.
    first : (n_front + 1,) int64
        The texel of front entry i contains the triangles `entry[first[i] : first[i + 1]]`.
    entry : (m,) int32
        Triangles.
    entry_area : (m,) float32
        Area of each of these triangles in the texel's square, texels.
    sobol_points : (16, 2) uint32
        Bit-reversed Sobol numbers of the 16 points of a texel.
    min_offset_scale : float32
        Lower limit of x in the term OFFSET min(x, s) of `offset_step`, metres.
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
    """Return the coefficients a to f of the map from a position in a page to barycentrics of triangle t.

        b1 = a x + b y + c        b2 = d x + e y + f        x, y: texels

    uv : (V, 2) float32; triangle : (T, 3) int32; size : int, width and height of a page, texels
    """
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
    """Return the distance of a ray origin from its triangle at (x, y, z), metres; see `OFFSET`.

    size : largest component of the triangle's edges 1 and 2, metres; min_offset_scale : see `Surface`
    """
    far = larger(larger(abs(x), abs(y)), abs(z))
    return larger(ROUNDING * larger(far, size), OFFSET * smaller(larger(far, min_offset_scale), size))


@inner
def place_point(
    position, shading, face, triangle, min_offset_scale, t, b1, b2, flip, origin, normal, n, k
):  # fmt: skip
    """Write the ray origin and the shading normal at barycentrics (b1, b2) of triangle t.

    position, shading : (V, 3) float32, metres, and unit shading normals; face : (T, 3) float32, face normals
    triangle : (T, 3) int32; min_offset_scale : see `Surface`
    flip : whether the point lies on the back
    origin, normal : (N, K, 3) float32 output, items [n, k] are set; metres, and unit
    """
    # Interpolate position and shading normal.
    b1 = smaller(larger(b1, 0.0), 1.0)
    b2 = smaller(larger(b2, 0.0), 1.0 - b1)
    b0 = 1.0 - b1 - b2
    i0, i1, i2 = triangle[t, 0], triangle[t, 1], triangle[t, 2]
    px = b0 * position[i0, 0] + b1 * position[i1, 0] + b2 * position[i2, 0]
    py = b0 * position[i0, 1] + b1 * position[i1, 1] + b2 * position[i2, 1]
    pz = b0 * position[i0, 2] + b1 * position[i1, 2] + b2 * position[i2, 2]
    nx = b0 * shading[i0, 0] + b1 * shading[i1, 0] + b2 * shading[i2, 0]
    ny = b0 * shading[i0, 1] + b1 * shading[i1, 1] + b2 * shading[i2, 1]
    nz = b0 * shading[i0, 2] + b1 * shading[i1, 2] + b2 * shading[i2, 2]
    fx, fy, fz = float(face[t, 0]), float(face[t, 1]), float(face[t, 2])
    sign = -1.0 if flip else 1.0
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    facing = nx * fx + ny * fy + nz * fz
    # If the shading normal is zero or points to the other side, use the face normal. Otherwise, for each
    # vertex whose tangent plane lies above the point, move the point towards that plane, weighted by the
    # barycentric (Hanika 2021).
    lx = ly = lz = 0.0
    if length < 1.0e-6 or facing <= 0.0:
        nx, ny, nz, length = fx, fy, fz, 1.0
    elif not flip and facing < 0.99999 * length:
        for i in range(3):
            vertex = i0 if i == 0 else (i1 if i == 1 else i2)
            weight = b0 if i == 0 else (b1 if i == 1 else b2)
            vx, vy, vz = float(shading[vertex, 0]), float(shading[vertex, 1]), float(shading[vertex, 2])
            below = (
                (px - position[vertex, 0]) * vx
                + (py - position[vertex, 1]) * vy
                + (pz - position[vertex, 2]) * vz
            )
            if below < 0.0 and vx * fx + vy * fy + vz * fz > STEEPEST:
                lx -= weight * below * vx
                ly -= weight * below * vy
                lz -= weight * below * vz
    # Offset along the face normal.
    size = 0.0
    for a in range(3):
        size = larger(
            size,
            larger(
                abs(float(position[i1, a]) - position[i0, a]), abs(float(position[i2, a]) - position[i0, a])
            ),
        )
    step = offset_step(px, py, pz, size, min_offset_scale)
    away = sign * step
    if smaller(smaller(b0, b1), b2) < BORDER:
        # Also move the point along the face. Where a wall meets the border of the face, rounding may
        # otherwise place a point on the border behind the wall.
        mx = (position[i0, 0] + position[i1, 0] + position[i2, 0]) / 3.0 - px
        my = (position[i0, 1] + position[i1, 1] + position[i2, 1]) / 3.0 - py
        mz = (position[i0, 2] + position[i1, 2] + position[i2, 2]) / 3.0 - pz
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
def load_flat(position, shading, face, triangle, t, sign, row):
    """Write the data of triangle t for `place_flat_point`; return whether the triangle is flat.

    A triangle is flat if the shading normals of its vertices equal its face normal.

    position, shading : (V, 3) float32, metres, and unit shading normals; face : (T, 3) float32, face normals
    triangle : (T, 3) int32; sign : 1 for the front, -1 for the back
    row : (5, 3) float64 output, see the row names
    """
    i0, i1, i2 = triangle[t, 0], triangle[t, 1], triangle[t, 2]
    along0 = along1 = along2 = 0.0
    for a in range(3):
        along0 += shading[i0, a] * face[t, a]
        along1 += shading[i1, a] * face[t, a]
        along2 += shading[i2, a] * face[t, a]
        row[_CORNER, a] = position[i0, a]
        row[_EDGE_1, a] = float(position[i1, a]) - position[i0, a]
        row[_EDGE_2, a] = float(position[i2, a]) - position[i0, a]
        row[_NORMAL, a] = sign * face[t, a]
        row[_SIZE, 0] = larger(
            0.0 if a == 0 else row[_SIZE, 0], larger(abs(row[_EDGE_1, a]), abs(row[_EDGE_2, a]))
        )
    return smaller(smaller(along0, along1), along2) > 0.999999


@inner
def place_flat_point(row, min_offset_scale, b1, b2, origin, normal, n, k):
    """Write the ray origin and the normal of a point of a flat triangle, as `place_point` does.

    The point must not be near the border of the triangle.


    row : (5, 3) float64, from `load_flat`; min_offset_scale : see `Surface`
    origin, normal : (N, K, 3) float32 output, items [n, k] are set; metres, and unit
    """
    px = row[_CORNER, 0] + b1 * row[_EDGE_1, 0] + b2 * row[_EDGE_2, 0]
    py = row[_CORNER, 1] + b1 * row[_EDGE_1, 1] + b2 * row[_EDGE_2, 1]
    pz = row[_CORNER, 2] + b1 * row[_EDGE_1, 2] + b2 * row[_EDGE_2, 2]
    step = offset_step(px, py, pz, row[_SIZE, 0], min_offset_scale)
    for a in range(3):
        normal[n, k, a] = row[_NORMAL, a]
    origin[n, k, 0] = px + step * row[_NORMAL, 0]
    origin[n, k, 1] = py + step * row[_NORMAL, 1]
    origin[n, k, 2] = pz + step * row[_NORMAL, 2]


@kernel
def place_points(surface, valid_points, chosen, wanted, origin, normal, hit_triangle, bary):
    """Write ray origins and shading normals of w points of each of m texel entries.

    surface : Surface
    valid_points : (n,) uint16, bit k is set where point k of an entry is valid; an invalid point is replaced
        by a valid point of the same entry, if it has any
    chosen : (m,) int64, entries
    wanted : (m, w) uint8, numbers 0 to 15 of the points of each entry; (1, w): the same for all entries
    origin, normal : (m, w, 3) float32 output, metres and unit vectors, world
    hit_triangle : (m, w) int32 output, triangle on which each point lies; with shape (0, w), `hit_triangle`
        and `bary` are not written
    bary : (m, w, 2) float32 output, barycentrics b1 and b2 of each point on its triangle
    """
    corner, cut, spare, flat_row = new_triangle(), new_polygon(), new_polygon(), _flat_row()
    located = len(hit_triangle) > 0
    # Unpack the tuple once, because each access to an array in it costs an atomic reference count.
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
        # Load the entry's pixel, seeds and covered area, and its triangle if there is only one.
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
            # Compute the point of the unit square.
            k = valid_point(valid_points[i], wanted[0 if same else n, w])
            u = texel_scramble(sobol_points[k, 0], seed_x, full)
            v = texel_scramble(sobol_points[k, 1], seed_y, full)
            x = float(u)
            y = float(v)
            if not whole:
                # Choose a triangle in proportion to its area in the texel, and a point in this area.
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
            # Compute the ray origin on the triangle.
            x += x0
            y += y0
            b1 = a * x + b * y + c
            b2 = d * x + g * y + h
            if flat and smaller(smaller(b1, b2), 1.0 - b1 - b2) >= BORDER:
                place_flat_point(flat_row, min_offset_scale, b1, b2, origin, normal, n, w)
            else:
                place_point(
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
    """Return k if bit k of `bits` is set or no bit is set.

    Otherwise return the number of set bit k % n, where the n set bits are counted from 0.
    """
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
