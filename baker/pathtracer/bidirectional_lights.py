# mypy: disable-error-code="no-untyped-def"
"""Lamps as both ends of a path see them: where light starts, how it is aimed at, how it is met by chance.

A lamp is chosen as `light_table` says. From a triangle light starts at a uniform point, cosine-weighted; from
a point into all directions; from a spot into its cone; sun and sky shine through a disc as wide as the scene.

Based on: Veach, Robust Monte Carlo methods for light transport simulation, 1997, ch. 10.3; Pharr, Jakob and
Humphreys, Physically based rendering, 3rd ed. 2016, ch. 16 (light that comes from infinity).
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.sampling import tangent_frame, triangle_barycentric
from baker.lights.families.point import range_window
from baker.pathtracer.bidirectional_weights import (
    BACK,
    CHAIN,
    INVERSE,
    LEAVE,
    MOST_FROM_LAMP,
    OPEN,
    ORIGIN,
    meet,
    towards_eye,
)
from baker.pathtracer.bsdf import INV_PI, cosine_sample
from baker.pathtracer.light_table import (
    AREA,
    CHANCE,
    DIRECTION,
    FAR,
    INTENSITY,
    INVERSE_RANGE,
    KIND,
    OUTER,
    POINT_CHANCE,
    POSITION,
    RADIANCE,
    SHORT,
    TWO_SIDED,
    aim_at_point_light,
    aim_at_triangle,
    pick_lamp,
    spot_share,
)
from baker.pathtracer.light_table import NORMAL as LAMP_NORMAL
from baker.pathtracer.scene import EMISSION, FACE
from baker.pathtracer.scene import TWO_SIDED as SURFACE_TWO_SIDED
from baker.pathtracer.vertex import BETA, DENSITY, GO, NORMAL, PLACE, place_off, size_of
from baker.trace.jit import inner

_INV_4_PI = 0.25 / math.pi


@inner
def turned(nx, ny, nz, a, b, c):
    """Return direction (a, b, c) of the frame around the unit normal n, in world space."""
    tx, ty, tz, bx, by, bz = tangent_frame(np.float32(nx), np.float32(ny), np.float32(nz))
    return a * tx + b * bx + c * nx, a * ty + b * by + c * ny, a * tz + b * bz + c * nz


@inner
def spread(point, e):
    """Return the density per steradian of directions that start at point or spot light e."""
    if point[e, KIND] == 1.0:
        return 0.5 * INV_PI / max(1.0 - point[e, OUTER], 1.0e-12)
    return _INV_4_PI


@inner
def start_at_lamp(path, lane, triangle, point, cumulative, sky, sphere, least, choice, u, w, a, b, spot):
    """Begin a path at a lamp, ready for its first ray; choice, u, w, a, b : uniform numbers.

    spot : (2,) output, for a triangle the barycentrics of the start (its texture is not looked up yet)

    Returns
    -------
    int
        The lamp.
    """
    n, p = len(triangle), len(point)
    lamp = pick_lamp(cumulative, choice)
    path[OPEN, lane] = 1.0
    path[CHAIN, lane] = 0.0
    path[ORIGIN, lane] = 0.0
    path[INVERSE, lane] = 0.0
    if lamp < n:
        density = triangle[lamp, CHANCE] / triangle[lamp, AREA]
        sign, sides = 1.0, 1.0
        if triangle[lamp, TWO_SIDED] > 0.0:
            sides = 2.0
            sign = 1.0 if a < 0.5 else -1.0
            a = 2.0 * a if a < 0.5 else 2.0 * a - 1.0
        nx, ny, nz = (
            sign * triangle[lamp, LAMP_NORMAL],
            sign * triangle[lamp, LAMP_NORMAL + 1],
            sign * triangle[lamp, LAMP_NORMAL + 2],
        )
        b1, b2 = triangle_barycentric(np.float32(u), np.float32(w))
        spot[0], spot[1] = b1, b2
        b0 = 1.0 - b1 - b2
        path[NORMAL, lane], path[NORMAL + 1, lane], path[NORMAL + 2, lane] = nx, ny, nz
        place_off(
            path, lane,
            b0 * triangle[lamp, 0] + b1 * triangle[lamp, 3] + b2 * triangle[lamp, 6],
            b0 * triangle[lamp, 1] + b1 * triangle[lamp, 4] + b2 * triangle[lamp, 7],
            b0 * triangle[lamp, 2] + b1 * triangle[lamp, 5] + b2 * triangle[lamp, 8],
            least, size_of(triangle, lamp),
        )  # fmt: skip
        dx, dy, dz = cosine_sample(a, b)
        cosine = dz
        dx, dy, dz = turned(nx, ny, nz, dx, dy, dz)
        path[DENSITY, lane] = max(cosine, 1.0e-12) * INV_PI / sides
        path[LEAVE, lane] = cosine
        # Met by chance instead: the cosine at the lamp turns directions into area.
        path[CHAIN, lane] = 1.0 / density
        scale = math.pi * sides / density
        red, green, blue = (
            triangle[lamp, RADIANCE],
            triangle[lamp, RADIANCE + 1],
            triangle[lamp, RADIANCE + 2],
        )
    elif lamp < n + p:
        e = lamp - n
        red, green, blue = point[e, INTENSITY], point[e, INTENSITY + 1], point[e, INTENSITY + 2]
        if point[e, KIND] == 2.0:
            dx, dy, dz = point[e, DIRECTION], point[e, DIRECTION + 1], point[e, DIRECTION + 2]
            start_on_disc(path, lane, sphere, dx, dy, dz, u, w)
            path[ORIGIN, lane] = 1.0
            scale = 1.0 / (path[DENSITY, lane] * point[e, POINT_CHANCE])
        else:
            path[PLACE, lane] = point[e, POSITION]
            path[PLACE + 1, lane] = point[e, POSITION + 1]
            path[PLACE + 2, lane] = point[e, POSITION + 2]
            least_cosine = point[e, OUTER] if point[e, KIND] == 1.0 else -1.0
            cosine = 1.0 - u * (1.0 - least_cosine)
            r = math.sqrt(max(1.0 - cosine * cosine, 0.0))
            phi = 2.0 * math.pi * w
            dx, dy, dz = turned(
                point[e, DIRECTION], point[e, DIRECTION + 1], point[e, DIRECTION + 2],
                r * math.cos(phi), r * math.sin(phi), cosine,
            )  # fmt: skip
            path[DENSITY, lane] = spread(point, e)
            path[LEAVE, lane] = 1.0
            scale = spot_share(point, e, cosine) / (path[DENSITY, lane] * point[e, POINT_CHANCE])
    else:
        z = 1.0 - 2.0 * a
        r = math.sqrt(max(1.0 - z * z, 0.0))
        dx, dy, dz = r * math.cos(2.0 * math.pi * b), r * math.sin(2.0 * math.pi * b), z
        start_on_disc(path, lane, sphere, dx, dy, dz, u, w)
        path[ORIGIN, lane] = 2.0
        path[CHAIN, lane] = 1.0 / (sky[3] * _INV_4_PI)
        scale = path[CHAIN, lane] / path[DENSITY, lane]
        red, green, blue = sky[0], sky[1], sky[2]
    path[GO, lane], path[GO + 1, lane], path[GO + 2, lane] = dx, dy, dz
    path[BETA, lane], path[BETA + 1, lane], path[BETA + 2, lane] = red * scale, green * scale, blue * scale
    return lamp


@inner
def range_of_lamp(point, lamp, n):
    """Return 1 / range^2 of a lamp that stands behind n triangles; 0 if it has no range."""
    if n <= lamp < n + len(point):
        return point[lamp - n, INVERSE_RANGE]
    return 0.0


@inner
def fade(path, lane, distance, inverse_range):
    """Fade light that has gone `distance` metres from a point light of a range; return if any is left.

    The light's own share is not known before its first hit; its densities do not depend on it.
    """
    share = range_window(distance * distance, inverse_range)
    for c in range(3):
        path[BETA + c, lane] *= share
    return share > 0.0


@inner
def start_on_disc(path, lane, sphere, dx, dy, dz, u, w):
    """Put the start of parallel light of direction d on a disc in front of everything."""
    radius = sphere[3]
    r = radius * math.sqrt(u)
    phi = 2.0 * math.pi * w
    x, y, z = turned(dx, dy, dz, r * math.cos(phi), r * math.sin(phi), -radius)
    path[PLACE, lane], path[PLACE + 1, lane], path[PLACE + 2, lane] = (
        sphere[0] + x,
        sphere[1] + y,
        sphere[2] + z,
    )
    path[DENSITY, lane] = 1.0 / (math.pi * radius * radius)
    path[LEAVE, lane] = 1.0


@inner
def aim_both_ways(path, row, lane, triangle, point, cumulative, sky, sphere, choice, u, w, value, way):
    """Aim at one lamp from an eye subpath's end; see `vertex.aim`, whose arguments and answer these are.

    The light is weighed against all other ways to make the same path.
    """
    n, p = len(triangle), len(point)
    x, y, z = path[PLACE, lane], path[PLACE + 1, lane], path[PLACE + 2, lane]
    lamp = pick_lamp(cumulative, choice)
    reach, density, b1, b2 = FAR, 0.0, 0.0, 0.0
    far = 1.0 / (math.pi * sphere[3] * sphere[3])
    if lamp < n:
        dx, dy, dz, density, b1, b2 = aim_at_triangle(triangle, lamp, u, w, x, y, z)
        if density <= 0.0:
            return -1
        square = dx * dx + dy * dy + dz * dz
        length = math.sqrt(square)
        dx, dy, dz = dx / length, dy / length, dz / length
        reach = length * SHORT
        scale = 1.0 / density
        # Density per area (but for the cosine here) with which light that starts there arrives here.
        onward = lamp_cosine(triangle, lamp, dx, dy, dz) * emission_density(triangle, lamp) / square
        red, green, blue = (
            triangle[lamp, RADIANCE],
            triangle[lamp, RADIANCE + 1],
            triangle[lamp, RADIANCE + 2],
        )
    elif lamp < n + p:
        e = lamp - n
        dx, dy, dz, reach, share = aim_at_point_light(point, e, x, y, z)
        scale = share / point[e, POINT_CHANCE]
        onward = far
        if point[e, KIND] != 2.0:
            onward = spread(point, e) / max((reach / SHORT) ** 2, 1.0e-20)
        red, green, blue = point[e, INTENSITY], point[e, INTENSITY + 1], point[e, INTENSITY + 2]
    else:
        a, b, c = cosine_sample(u, w)
        dx, dy, dz = turned(path[NORMAL, lane], path[NORMAL + 1, lane], path[NORMAL + 2, lane], a, b, c)
        density = sky[3] * c * INV_PI
        scale = 1.0 / density if density > 0.0 else 0.0
        onward = 0.25 / max(c, 1.0e-12) * far
        red, green, blue = sky[0], sky[1], sky[2]
    above = dx * path[NORMAL, lane] + dy * path[NORMAL + 1, lane] + dz * path[NORMAL + 2, lane]
    if scale <= 0.0 or above <= 0.0:
        return -1
    from_eye, from_lamp = meet(
        path, row, lane, path[BACK, lane], path[BACK + 1, lane], path[BACK + 2, lane], dx, dy, dz, value
    )
    less = from_eye / density if density > 0.0 else 0.0
    more = towards_eye(path, lane, onward * above, from_lamp, MOST_FROM_LAMP - 1)
    scale *= above / (1.0 + less + more)
    value[0] *= path[BETA, lane] * red * scale
    value[1] *= path[BETA + 1, lane] * green * scale
    value[2] *= path[BETA + 2, lane] * blue * scale
    way[0], way[1], way[2], way[3], way[4], way[5] = dx, dy, dz, reach, b1, b2
    return lamp if value[0] + value[1] + value[2] > 0.0 else -1


@inner
def lamp_cosine(triangle, e, dx, dy, dz):
    """Return the cosine at emitter e of a ray of unit direction d; below 0 if it meets the dark side."""
    cosine = -(
        dx * triangle[e, LAMP_NORMAL] + dy * triangle[e, LAMP_NORMAL + 1] + dz * triangle[e, LAMP_NORMAL + 2]
    )
    return abs(cosine) if triangle[e, TWO_SIDED] > 0.0 else cosine


@inner
def emission_density(triangle, e):
    """Return the density per steradian and cosine of directions that start on emitter e."""
    return INV_PI * (0.5 if triangle[e, TWO_SIDED] > 0.0 else 1.0)


@inner
def meet_emitter(path, lane, surface, prim, triangle, e, seen, value):
    """Write to `value` (3,) what triangle prim, met by the eye's subpath, sends along the path, weighed.

    Its texture is not looked up yet.

    e : emitter that it is there, -1 if no lamp's subpath starts there
    seen : whether the path comes straight from a camera: nothing else makes such a path
    """
    value[0] = value[1] = value[2] = 0.0
    cosine = -(
        path[GO, lane] * surface[prim, FACE]
        + path[GO + 1, lane] * surface[prim, FACE + 1]
        + path[GO + 2, lane] * surface[prim, FACE + 2]
    )
    cosine = abs(cosine) if surface[prim, SURFACE_TWO_SIDED] > 0.0 else cosine
    if cosine <= 0.0:
        return
    weight = 1.0
    if not seen and e >= 0:
        density = triangle[e, CHANCE] / triangle[e, AREA]
        onward = emission_density(triangle, e) * cosine
        others = path[OPEN, lane] + onward * path[CHAIN + MOST_FROM_LAMP - 1, lane]
        weight = 1.0 / (1.0 + density * path[INVERSE, lane] * others)
    for c in range(3):
        value[c] = path[BETA + c, lane] * surface[prim, EMISSION + c] * weight


@inner
def meet_sky(path, lane, sky, sphere, seen, value):
    """Do the same for the sky, where the path leaves the scene."""
    weight = 1.0
    if not seen and sky[3] > 0.0:
        far = 1.0 / (math.pi * sphere[3] * sphere[3])
        leave = max(path[LEAVE, lane], 0.0)
        aimed = INV_PI * leave * path[OPEN, lane]
        started = _INV_4_PI * far * leave * path[CHAIN + MOST_FROM_LAMP - 1, lane]
        weight = 1.0 / (1.0 + sky[3] * (aimed + started) / path[DENSITY, lane])
    for c in range(3):
        value[c] = path[BETA + c, lane] * sky[c] * weight
