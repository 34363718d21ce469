# mypy: disable-error-code="no-untyped-def"
"""MIS weights of `bidirectional`: densities of all techniques relative to the one that sampled the path.

A path x_0 (light) .. x_k-1 (eye) can be made with s vertices from the light and t = k - s from the eye, with
density p_s (per area):

    p_s+1 / p_s = pL(x_s) / pE(x_s)    w_s = 1 / (1 + sum over s' != s of p_s' / p_s)    (balance heuristic)

pL and pE are the densities of a vertex sampled from the light side and from the eye side. Both sums are
updated while a subpath grows, so that a connection costs the same for subpaths of any length. A light subpath
has one sum, since all techniques with fewer light vertices exist. An eye subpath has one sum for each number
of light vertices that may be added, since that number is bounded. The density of a mirror reflection is set
to 1, since it cancels in the ratio; connections at mirrors have weight 0.

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
# Further rows of a path:
#   BACK     unit direction to the previous vertex
#   INVERSE  1 / density of this vertex, per area
#   OPEN     weight of the technique that connects the previous vertex to this one: 1, but 0 if the previous
#            one reflected as a mirror, the number of light subpaths of a pixel if it is the camera, and
#            the ratio of densities in `reach_vertex` if it is the sky
#   LEAVE    cosine to the geometric normal of the direction in which the path leaves
#   ORIGIN   kind of the light at which it started: 0 finite distance, 1 parallel light, 2 sky; 0 from the
#            second vertex
#   CHAIN    first of the sums over all techniques that end at earlier vertices
BACK, INVERSE, OPEN, LEAVE, ORIGIN, CHAIN = (N_ROWS + offset for offset in (0, 3, 4, 5, 6, 7))
N_ROWS_BOTH = CHAIN + MAX_LIGHT_VERTICES


@inner
def meet(path, row, k, ex, ey, ez, lx, ly, lz, value):
    """Evaluate the vertex in column k for light that comes from l and goes to e (unit, world, outwards).

    path : (N_ROWS_BOTH, n) float64; row : (5, n) float64
    value : (3,) float64, output, f(e, l) |n.l| / |ng.l| with n the shading and ng the geometric normal.
        Callers multiply by geometric cosines only, so the result does not depend on the end the path started
        at.

    Returns
    -------
    tuple of float
        Densities per steradian with which a path from the eye samples l, and one from the light samples e.
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
    # Where the shading normal faces away from the viewer, use the geometric normal, as `arrive` does. For the
    # density from the light, the viewer is the light.
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
    """Update the sums at a vertex that the path leaves in direction `GO`.

    path : (N_ROWS_BOTH, n) float64
    density : per steradian, of that direction; 1 at a mirror
    reverse : density, per steradian, with which a subpath from the other side samples the opposite direction;
        1 at a mirror, 0 if it cannot
    smooth : whether the direction is a mirror reflection
    depth : number of sums, 1 for light subpaths
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
    """Multiply the sums by a factor that converts a density per steradian at the next vertex to one per area
    here.

    path : (N_ROWS_BOTH, n) float64; depth : number of sums
    """
    for r in range(depth):
        path[CHAIN + r, lane] *= factor


@inner
def reach_vertex(path, lane, distance, depth):
    """Update a path at a new vertex: its geometric normal is in `path`, the ray's direction still in `GO`.

    path : (N_ROWS_BOTH, n) float64; distance : metres, of the ray; depth : number of sums

    Returns
    -------
    float
        Cosine of arrival.
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
        # Parallel light: its density per area does not change with the distance.
        path[INVERSE, lane] = 1.0 / (path[DENSITY, lane] * cosine)
        if path[ORIGIN, lane] == 2.0:
            # Density of light samples of the sky, cosine / pi, relative to that of light subpaths, 0.25 / pi.
            path[OPEN, lane] = 4.0 * cosine
    return cosine


@inner
def towards_eye(path, lane, density, reverse, left):
    """Return sum p_s' / p_s over techniques with more light vertices, for an eye subpath that ends in `lane`.

    path : (N_ROWS_BOTH, n) float64
    density : per area, of this vertex, sampled by the light subpath
    reverse : per steradian, of the direction to the previous vertex, sampled by the light subpath
    left : number of vertices that the light subpath may still have
    """
    if left < 1:
        return 0.0
    return density * path[INVERSE, lane] * (path[OPEN, lane] + reverse * path[CHAIN + left - 1, lane])


@inner
def towards_light(path, k, density, reverse):
    """Return sum p_s' / p_s over techniques with fewer light vertices, for a light subpath that ends in
    column k.

    path : (N_ROWS_BOTH, n) float64; density, reverse : as in `towards_eye`, sampled by the eye subpath
    """
    return density * path[INVERSE, k] * (path[OPEN, k] + reverse * path[CHAIN, k])


@inner
def pixel_density(camera, direction):
    """Return the density per steradian of a pixel's own rays; 0 behind the camera.

    camera : (15,) float64, see `camera`; direction : (3,) float64, unit, from the eye
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
    """Return the number of the pixel through which a direction passes, or -1.

    camera : (15,) float64, see `camera`; direction : (3,) float64, unit, from the eye
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
