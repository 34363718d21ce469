# mypy: disable-error-code="no-untyped-def"
"""Computes centroid, position, normal, area and albedo of texels, from the triangles inside their squares."""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.alpha import opacity_at
from baker.kernels.clip import clip_to_square, new_polygon, new_triangle, polygon_area
from baker.kernels.surface import N_POINTS, inverse_uv, place_point, place_points
from baker.kernels.textures import sample_texture
from baker.trace.jit import inner, kernel, larger, scratch

# Working memory of the kernels.
_vector, _vectors = scratch((1, 1, 3), np.float32), scratch((1, N_POINTS, 3), np.float32)
_triangles, _barycentrics = scratch((1, N_POINTS), np.int32), scratch((1, N_POINTS, 2), np.float32)
_rgba, _every, _chosen = scratch((4,), np.float64), scratch((1, N_POINTS), np.uint8), scratch((1,), np.int64)
_shares = scratch((N_POINTS,), np.float64)


@kernel
def texel_geometry(surface, triangle_scale, begin, end, area, centroid, position, normal):
    """Write area, centroid, position and normal of front texels `begin` to `end` - 1.

    surface : Surface; triangle_scale : (T,) float32, m2 per texel of each triangle
    area : (n,) float32 output, m2 of surface inside the texel
    centroid : (n, 2) float32 output, centroid of the covered part of the texel's square, texels from its
        centre
    position, normal : (n, 3) float32 output, metres and unit vectors, world; at the centroid, on the triangle
        with the largest area in the texel
    """
    corner, cut, spare, point, facing = new_triangle(), new_polygon(), new_polygon(), _vector(), _vector()
    for i in range(begin, end):
        rest = surface.pixel[i] % (surface.size * surface.size)
        x0 = rest % surface.size
        y0 = rest // surface.size
        # Sum area and first moment of the triangles inside the square, and find the triangle of largest area.
        total = metres = cx = cy = 0.0
        main = surface.entry[surface.first[i]]
        most = -1.0
        for e in range(surface.first[i], surface.first[i + 1]):
            t = surface.entry[e]
            inside = float(surface.entry_area[e])
            if inside > most:
                most, main = inside, t
            metres += inside * triangle_scale[t]
            mx = my = 0.5
            if inside < 0.999999:
                for j in range(3):
                    corner[j, 0] = surface.uv[surface.triangle[t, j], 0] * surface.size
                    corner[j, 1] = surface.uv[surface.triangle[t, j], 1] * surface.size
                mx, my = _centroid(cut, clip_to_square(corner, x0, y0, cut, spare))
            weight = larger(inside, 1.0e-12)
            total += weight
            cx += weight * mx
            cy += weight * my
        centroid[i, 0] = cx / total - 0.5
        centroid[i, 1] = cy / total - 0.5
        area[i] = metres
        # Compute position and normal at the centroid, on the triangle of largest area.
        a, b, c, d, g, h = inverse_uv(surface.uv, surface.triangle, surface.size, main)
        x, y = x0 + cx / total, y0 + cy / total
        place_point(
            surface.position,
            surface.normal,
            surface.face_normal,
            surface.triangle,
            surface.min_offset_scale,
            main,
            a * x + b * y + c,
            d * x + g * y + h,
            False,
            point,
            facing,
            0,
            0,
        )
        for axis in range(3):
            position[i, axis] = point[0, 0, axis]
            normal[i, axis] = facing[0, 0, axis]


@inner
def _centroid(polygon, n):
    """Return the centroid of a convex polygon of n corners, or the mean of the corners if it has no area.

    polygon : (MAX_CORNERS, 2) float64; rows from n on are ignored
    """
    total = polygon_area(polygon, n)
    x = y = 0.0
    if n == 0:
        return 0.5, 0.5
    if total <= 1.0e-14:
        for i in range(n):
            x += polygon[i, 0] / n
            y += polygon[i, 1] / n
        return x, y
    for i in range(1, n - 1):
        area = 0.5 * abs(
            (polygon[i, 0] - polygon[0, 0]) * (polygon[i + 1, 1] - polygon[0, 1])
            - (polygon[i + 1, 0] - polygon[0, 0]) * (polygon[i, 1] - polygon[0, 1])
        )
        x += area / total * (polygon[0, 0] + polygon[i, 0] + polygon[i + 1, 0]) / 3.0
        y += area / total * (polygon[0, 1] + polygon[i, 1] + polygon[i + 1, 1]) / 3.0
    return x, y


@inner
def uv_at(uv, triangle, t, b1, b2):
    """Return u, v at barycentrics (b1, b2) of triangle t.

    uv : (V, 2) float32, of each vertex; triangle : (T, 3) int32
    """
    b0 = 1.0 - b1 - b2
    i, j, k = triangle[t, 0], triangle[t, 1], triangle[t, 2]
    return b0 * uv[i, 0] + b1 * uv[j, 0] + b2 * uv[k, 0], b0 * uv[i, 1] + b1 * uv[j, 1] + b2 * uv[k, 1]


@inner
def texel_footprint(surface, image_uv, t):
    """Return the side, in image uv, of a square with 1/16 of a lightmap texel's area on triangle t.

    A texel has 16 sample points, so this is the area of one point.

    surface : Surface; image_uv : (V, 2) float32, of each vertex
    """
    i, j, k = surface.triangle[t, 0], surface.triangle[t, 1], surface.triangle[t, 2]
    lightmap = abs(
        (surface.uv[j, 0] - surface.uv[i, 0]) * (surface.uv[k, 1] - surface.uv[i, 1])
        - (surface.uv[k, 0] - surface.uv[i, 0]) * (surface.uv[j, 1] - surface.uv[i, 1])
    ) * float(surface.size * surface.size)
    image = abs(
        (image_uv[j, 0] - image_uv[i, 0]) * (image_uv[k, 1] - image_uv[i, 1])
        - (image_uv[k, 0] - image_uv[i, 0]) * (image_uv[j, 1] - image_uv[i, 1])
    )
    return math.sqrt(image / larger(lightmap, 1.0e-12) / N_POINTS)


@kernel
def texel_albedo(surface, shading, valid_points, begin, end, albedo, area):
    """Write the mean base colour of front texels `begin` to `end` - 1, weighted by opacity.

    surface : Surface; shading : Shading
    valid_points : (n,) uint16, all bits set, so that all 16 points are used
    albedo : (n, 3) float32 output, linear Rec.709
    area : (n,) float32, m2, multiplied in place by the mean opacity
    """
    origin, normal, hit, bary = _vectors(), _vectors(), _triangles(), _barycentrics()
    rgba, every, chosen, share = _rgba(), _every(), _chosen(), _shares()
    for k in range(N_POINTS):
        every[0, k] = k
        share[k] = 1.0
    coloured = len(shading.colour) > 1
    any_alpha = len(shading.alpha.slot) > 0
    for i in range(begin, end):
        # If the texel has a single material without texture, vertex colours and alpha, copy its factor.
        first = shading.material[surface.entry[surface.first[i]]]
        untextured = not coloured
        for e in range(surface.first[i], surface.first[i + 1]):
            m = shading.material[surface.entry[e]]
            untextured = untextured and m == first and shading.base_texture[m] < 0
            if any_alpha:
                untextured = untextured and shading.alpha.slot[surface.entry[e]] < 0
        if untextured:
            for c in range(3):
                albedo[i, c] = shading.base[first, c]
            continue
        # Otherwise average over the points of the texel.
        chosen[0] = i
        place_points(surface, valid_points, chosen, every, origin, normal, hit, bary)
        for c in range(3):
            albedo[i, c] = 0.0
        if any_alpha:
            total = 0.0
            for k in range(N_POINTS):
                share[k] = opacity_at(shading, hit[0, k], bary[0, k, 0], bary[0, k, 1])
                total += share[k]
            area[i] *= total / N_POINTS
            # If the opacity is 0 at all points, use the unweighted mean.
            for k in range(N_POINTS):
                share[k] = share[k] * N_POINTS / total if total > 0.0 else 1.0
        for k in range(N_POINTS):
            t = hit[0, k]
            m = shading.material[t]
            b1, b2 = bary[0, k, 0], bary[0, k, 1]
            for c in range(3):
                rgba[c] = 1.0
            if shading.base_texture[m] >= 0:
                u, v = uv_at(shading.base_uv, surface.triangle, t, b1, b2)
                width = texel_footprint(surface, shading.base_uv, t)
                sample_texture(shading.pack, shading.base_texture[m], u, v, width, rgba)
            for c in range(3):
                value = shading.base[m, c] * rgba[c] / N_POINTS * share[k]
                if coloured:
                    i0, i1, i2 = surface.triangle[t, 0], surface.triangle[t, 1], surface.triangle[t, 2]
                    value *= (
                        (1.0 - b1 - b2) * shading.colour[i0, c]
                        + b1 * shading.colour[i1, c]
                        + b2 * shading.colour[i2, c]
                    )
                albedo[i, c] += value
