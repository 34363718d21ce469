# mypy: disable-error-code="no-untyped-def"
"""Computes MIS weights of `bidirectional`, from densities of all techniques relative to the technique used.

Let a path have vertices x_0 (on the light) to x_k-1 (at the eye). Technique s samples s of the vertices from
the light and k - s from the eye. Its density is p_s, and its weight by the balance heuristic is w_s:

    p_s+1 / p_s = pL(x_s) / pE(x_s)        w_s = 1 / (1 + sum over s' != s of p_s' / p_s)

pL and pE are the densities, per area, of a vertex sampled from the light side and from the eye side. The sum
is split at s: the part s' < s is stored with the light subpath, the part s' > s with the eye subpath. Each
part is updated while its subpath grows, so that the cost of a connection does not depend on the subpaths'
lengths.

A light subpath stores one sum, because all techniques with fewer light vertices exist. Techniques with more
light vertices exist only up to `MAX_LIGHT_VERTICES`. Therefore an eye subpath stores one sum for each number
of vertices that a light subpath may still add. The density of a mirror reflection is set to 1, because it
cancels in the ratio. Connections at mirrors have weight 0.

Based on: Veach, Robust Monte Carlo methods for light transport simulation, 1997, ch. 5.3 (shading normals), 8
and 10; van Antwerpen, Unbiased physically based rendering on the GPU, 2011 (recursive sums); Georgiev,
Implementing vertex connection and merging, 2012.
"""

from __future__ import annotations

import math

from baker.pathtracer.bsdf import BASE, INV_PI, WIDTH, bsdf_cosines, cosines_pdf
from baker.pathtracer.camera import FORWARD, PIXELS_ACROSS, PIXELS_DOWN, RIGHT, TAN_HALF_FOV, UP
from baker.pathtracer.vertex import DENSITY, GO, GRAZE, N_ROWS, NORMAL, SHADED
from baker.trace.jit import inner

# Largest number of vertices of a light subpath, including the vertex on the light.
MAX_LIGHT_VERTICES = 8
# Rows of `path` after the rows that `pathtracer.vertex` defines:
#
#     BACK      unit direction to the previous vertex, world (3)
#     INVERSE   1 / density, per area, with which this vertex was sampled
#     OPEN      relative density of the technique that connects the previous vertex to this one: 0 if the
#               previous vertex reflected as a mirror, `n_subpaths` of `trace_both_ways` if it is the camera,
#               the ratio of densities in `reach_vertex` if it is the sky, else 1
#     LEAVE     cosine of the next ray to the geometric normal
#     ORIGIN    before the first hit: 0 if the path started at a finite distance, 1 for parallel light, 2 for
#               the sky. After the first hit: 0
#     CHAIN     MIS sums: sums of relative densities over the techniques that connect at earlier vertices. A
#               light subpath uses the first row, an eye subpath uses MAX_LIGHT_VERTICES rows
BACK, INVERSE, OPEN, LEAVE, ORIGIN, CHAIN = (N_ROWS + offset for offset in (0, 3, 4, 5, 6, 7))
N_ROWS_BOTH = CHAIN + MAX_LIGHT_VERTICES


@inner
def meet(path, row, k, ex, ey, ez, lx, ly, lz, value):
    """Evaluate the BSDF at the vertex in column k, for light from direction l that is reflected to e.

    e and l are unit world directions away from the vertex, e towards the eye and l towards the light.

    path : (N_ROWS_BOTH, n) float64; row : (5, n) float64
    value : (3,) float64, output, f(e, l) |n.l| / |ng.l|, where n is the shading and ng the geometric normal.
        Callers multiply `value` by geometric cosines only, so that light and eye subpaths give the same
        result

    Returns
    -------
    tuple of float
        Density, per steradian, with which an eye subpath samples l; density with which a light subpath
        samples e.
    """
    value[0] = value[1] = value[2] = 0.0
    ge = ex * path[NORMAL, k] + ey * path[NORMAL + 1, k] + ez * path[NORMAL + 2, k]
    gl = lx * path[NORMAL, k] + ly * path[NORMAL + 1, k] + lz * path[NORMAL + 2, k]
    if ge <= 0.0 or gl <= 0.0:
        return 0.0, 0.0
    ne = ex * path[SHADED, k] + ey * path[SHADED + 1, k] + ez * path[SHADED + 2, k]
    nl = lx * path[SHADED, k] + ly * path[SHADED + 1, k] + lz * path[SHADED + 2, k]
    if row[WIDTH, k] < 0.0:
        if nl <= 0.0:
            return 0.0, 0.0
        for c in range(3):
            value[c] = row[BASE + c, k] * INV_PI * nl / gl
        return nl * INV_PI, max(ne, 0.0) * INV_PI
    el = ex * lx + ey * ly + ez * lz
    # If the shading normal does not face the viewer, use the geometric normal, as `vertex.arrive` does. For
    # the density of a light subpath, which arrives from l, the viewer is at l.
    if ne > GRAZE:
        from_eye = bsdf_cosines(row, k, ne, nl, el, value)
    else:
        from_eye = bsdf_cosines(row, k, ge, gl, el, value)
    for c in range(3):
        value[c] /= gl
    if nl > GRAZE:
        return from_eye, cosines_pdf(row, k, nl, ne, el)
    return from_eye, cosines_pdf(row, k, gl, ge, el)


@inner
def leave_vertex(path, lane, density, reverse, smooth, depth):
    """Update the MIS sums of a path (`CHAIN`) at its current vertex, after `GO` has been sampled.

    path : (N_ROWS_BOTH, n) float64
    density : density of `GO`, per steradian; 1 for a mirror reflection
    reverse : density, per steradian, of `BACK` for a subpath from the other end, which arrives along -`GO`; 1
        for a mirror reflection, 0 if no such subpath exists
    smooth : whether `GO` is a mirror reflection
    depth : number of sums: 1 for light subpaths, `MAX_LIGHT_VERTICES` for eye subpaths
    """
    near = 0.0 if smooth else path[OPEN, lane]
    inverse = path[INVERSE, lane]
    if depth == 1:
        path[CHAIN, lane] = inverse * (near + reverse * path[CHAIN, lane])
    else:
        for r in range(depth - 1, 0, -1):
            path[CHAIN + r, lane] = inverse * (near + reverse * path[CHAIN + r - 1, lane])
        path[CHAIN, lane] = 0.0
    path[OPEN, lane] = 0.0 if smooth else 1.0
    path[ORIGIN, lane] = 0.0
    path[DENSITY, lane] = density
    path[LEAVE, lane] = (
        path[GO, lane] * path[NORMAL, lane]
        + path[GO + 1, lane] * path[NORMAL + 1, lane]
        + path[GO + 2, lane] * path[NORMAL + 2, lane]
    )


@inner
def carry(path, lane, factor, depth):
    """Multiply the MIS sums of a path (`CHAIN`) by `factor`.

    The factor converts a density per steradian at the next vertex to a density per area at this vertex.

    path : (N_ROWS_BOTH, n) float64; depth : see `leave_vertex`
    """
    for r in range(depth):
        path[CHAIN + r, lane] *= factor


@inner
def reach_vertex(path, lane, distance, depth):
    """Update `BACK`, `INVERSE` and the MIS sums of a path that has arrived at a new vertex.

    path : (N_ROWS_BOTH, n) float64, with `NORMAL` of the new vertex and `GO` of the ray that arrived
    distance : metres, length of the ray; depth : see `leave_vertex`

    Returns
    -------
    float
        Cosine of the arriving ray to the geometric normal.
    """
    dx, dy, dz = path[GO, lane], path[GO + 1, lane], path[GO + 2, lane]
    path[BACK, lane], path[BACK + 1, lane], path[BACK + 2, lane] = -dx, -dy, -dz
    cosine = -(dx * path[NORMAL, lane] + dy * path[NORMAL + 1, lane] + dz * path[NORMAL + 2, lane])
    cosine = max(cosine, 1.0e-12)
    square = max(distance * distance, 1.0e-30)
    if path[ORIGIN, lane] == 0.0:
        carry(path, lane, path[LEAVE, lane] / square, depth)
        path[INVERSE, lane] = square / (path[DENSITY, lane] * cosine)
    else:
        # The light comes from infinity, so the density per area does not depend on the distance.
        path[INVERSE, lane] = 1.0 / (path[DENSITY, lane] * cosine)
        if path[ORIGIN, lane] == 2.0:
            # Density of sky directions for light samples, cosine / pi, divided by their density for light
            # subpaths, 0.25 / pi.
            path[OPEN, lane] = 4.0 * cosine
    return cosine


@inner
def towards_eye(path, lane, density, reverse, left):
    """Return the sum of p_s' / p_s over s' > s, for an eye subpath that ends in column `lane`.

    path : (N_ROWS_BOTH, n) float64
    density : density, per area, with which the light subpath samples the last vertex of the eye subpath
    reverse : density, per steradian, with which the light subpath then samples `BACK` of that vertex
    left : number of vertices that the light subpath may still add
    """
    if left < 1:
        return 0.0
    return density * path[INVERSE, lane] * (path[OPEN, lane] + reverse * path[CHAIN + left - 1, lane])


@inner
def towards_light(path, k, density, reverse):
    """Return the sum of p_s' / p_s over s' < s, for a light subpath that ends in column k.

    path : (N_ROWS_BOTH, n) float64
    density : density, per area, with which the eye subpath samples the last vertex of the light subpath
    reverse : density, per steradian, with which the eye subpath then samples `BACK` of that vertex
    """
    return density * path[INVERSE, k] * (path[OPEN, k] + reverse * path[CHAIN, k])


@inner
def pixel_density(camera, direction):
    """Return the density, per steradian, of one pixel's camera rays in a direction; 0 behind the camera.

    camera : (15,) float64, from `camera.camera_columns`; direction : (3,) float64, unit, from the camera
    """
    cosine = (
        direction[0] * camera[FORWARD]
        + direction[1] * camera[FORWARD + 1]
        + direction[2] * camera[FORWARD + 2]
    )
    if cosine <= 0.0:
        return 0.0
    side = 2.0 * camera[TAN_HALF_FOV] / camera[PIXELS_DOWN]
    return 1.0 / (side * side * cosine * cosine * cosine)


@inner
def pixel_of(camera, direction):
    """Return the number of the pixel through which a direction passes; -1 if it is outside the picture.

    camera : (15,) float64, from `camera.camera_columns`; direction : (3,) float64, unit, from the camera
    """
    z = (
        direction[0] * camera[FORWARD]
        + direction[1] * camera[FORWARD + 1]
        + direction[2] * camera[FORWARD + 2]
    )
    if z <= 0.0:
        return -1
    x = (
        direction[0] * camera[RIGHT] + direction[1] * camera[RIGHT + 1] + direction[2] * camera[RIGHT + 2]
    ) / z
    y = (direction[0] * camera[UP] + direction[1] * camera[UP + 1] + direction[2] * camera[UP + 2]) / z
    width, height, high = camera[PIXELS_ACROSS], camera[PIXELS_DOWN], camera[TAN_HALF_FOV]
    column = math.floor((x * height / (high * width) + 1.0) * 0.5 * width)
    line = math.floor((1.0 - y / high) * 0.5 * height)
    if column < 0 or column >= width or line < 0 or line >= height:
        return -1
    return int(line) * int(width) + int(column)
