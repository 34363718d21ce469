# mypy: disable-error-code="no-untyped-def"
"""How likely each way to make a path is, beside the way it was made: the weights of `bidirectional`.

A path x_0 (lamp) .. x_k-1 (eye) can be made with s vertices from the lamp and t = k - s from the eye, at
density p_s (per area):

    p_s+1 / p_s = pL(x_s) / pE(x_s)    w_s = 1 / (1 + sum over s' != s of p_s' / p_s)    (balance heuristic)

pL and pE: density of a vertex if it is reached from the lamp's or from the eye's side. Sums towards either
end are carried along while a subpath grows: a connection costs the same however long both are. Towards the
lamp no way is missing. Towards the eye the number of lamp vertices is bounded, thus there is one sum for
each number that may still be added. Mirror reflections take part with density 1, since theirs cancels, and as
ends of a connection they count 0.

Based on: Veach, Robust Monte Carlo methods for light transport simulation, 1997, ch. 5.3 (shading normals), 8
and 10; van Antwerpen, Unbiased physically based rendering on the GPU, 2011 (recursive sums); Georgiev,
Implementing vertex connection and merging, 2012.
"""

from __future__ import annotations

import math

from baker.pathtracer.bsdf import INV_PI, WIDTH, bsdf_cosines, cosines_pdf
from baker.pathtracer.vertex import DENSITY, GO, GRAZE, N_ROWS, NORMAL, SHADED
from baker.trace.jit import inner

# Most vertices of a subpath that starts at a lamp, the one on the lamp among them.
MOST_FROM_LAMP = 8
# Further rows of a path: unit direction back to the vertex before; 1 / density of this vertex per area; share
# of the way in which both subpaths end between this vertex and the one before (1, 0 at mirrors, the number of
# subpaths where ends differ in it); cosine at which the path leaves; what light starts from (0 a place, 1
# parallel light, 2 the sky; 0 behind the first vertex); first of the sums over all ways farther back.
BACK, INVERSE, OPEN, LEAVE, ORIGIN, CHAIN = (N_ROWS + offset for offset in (0, 3, 4, 5, 6, 7))
N_ROWS_BOTH = CHAIN + MOST_FROM_LAMP


@inner
def meet(path, row, k, ex, ey, ez, lx, ly, lz, value):
    """Evaluate the vertex in column k for light that comes from l and goes to e (unit, world, outwards).

    value : (3,) output, f(e, l) |n.l| / |ng.l| with n the shading and ng the geometric normal: what is left
    to multiply by are geometric cosines, and the result is the same whichever end the path began at

    Returns
    -------
    tuple of float
        Densities per steradian with which a path from the eye samples l, and one from the lamp samples e.
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
            value[c] = row[c, k] * INV_PI * nl / gl
        return nl * INV_PI, max(ne, 0.0) * INV_PI
    el = ex * lx + ey * ly + ez * lz
    # A normal that looks away from the viewer is replaced, as `arrive` does for either direction of travel.
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
    """Carry the sums past a vertex that the path leaves towards `GO`.

    density : per steradian, of that direction; 1 at a mirror
    reverse : density with which the other side's subpath samples the way back; 1 at a mirror, 0 if it cannot
    smooth : whether the direction is a mirror's
    depth : sums kept, 1 for subpaths from lamps (nothing is bounded there)
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
    """Multiply the sums by what turns a density per steradian at the next vertex into one per area here."""
    for r in range(depth):
        path[CHAIN + r, lane] *= factor


@inner
def reach_vertex(path, lane, distance, depth):
    """Do what a vertex asks for on arrival; its geometric normal is in `path`, the ray still in `GO`.

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
            # Aiming at the sky follows the cosine (c / pi), starting from it does not (1 / 4 pi).
            path[OPEN, lane] = 4.0 * cosine
    return cosine


@inner
def towards_eye(path, lane, density, reverse, left):
    """Return the sum of p_s' / p_s over more lamp vertices, for an eye subpath that ends in column `lane`.

    density : per area, with which the lamp's subpath would reach this vertex
    reverse : per steradian, with which it would go on to the vertex before
    left : how many vertices a lamp's subpath may still have
    """
    if left < 1:
        return 0.0
    return density * path[INVERSE, lane] * (path[OPEN, lane] + reverse * path[CHAIN + left - 1, lane])


@inner
def towards_lamp(path, k, density, reverse):
    """Return the sum of p_s' / p_s over less lamp vertices, for a lamp's subpath that ends in column k."""
    return density * path[INVERSE, k] * (path[OPEN, k] + reverse * path[CHAIN, k])


@inner
def pixel_density(camera, way):
    """Return the density per steradian of a pixel's own rays in unit direction `way` (3,); 0 from behind."""
    cosine = way[0] * camera[9] + way[1] * camera[10] + way[2] * camera[11]
    if cosine <= 0.0:
        return 0.0
    side = 2.0 * camera[12] / camera[14]
    return 1.0 / (side * side * cosine * cosine * cosine)


@inner
def pixel_of(camera, way):
    """Return the number of the pixel that unit direction `way` (3,) from the eye passes, or -1."""
    z = way[0] * camera[9] + way[1] * camera[10] + way[2] * camera[11]
    if z <= 0.0:
        return -1
    x = (way[0] * camera[3] + way[1] * camera[4] + way[2] * camera[5]) / z
    y = (way[0] * camera[6] + way[1] * camera[7] + way[2] * camera[8]) / z
    width, height, high = camera[13], camera[14], camera[12]
    column = math.floor((x * height / (high * width) + 1.0) * 0.5 * width)
    line = math.floor((1.0 - y / high) * 0.5 * height)
    if column < 0 or column >= width or line < 0 or line >= height:
        return -1
    return int(line) * int(width) + int(column)
