# mypy: disable-error-code="no-untyped-def"
"""Lights in bidirectional path tracing: starts of light subpaths, light samples, hits on emitters and sky.

A light is chosen as in `pathtracer.light_table`. A light subpath starts,

- at an emitter: from a uniformly chosen point, in a cosine-weighted direction;
- at a light with a position: from that position, in a direction uniform over its cone. The cone of a point
  light is the whole sphere;
- for parallel light and the sky: from a uniformly chosen point of a disc in front of the scene. The disc has
  the radius of the scene's bounding sphere (`Reference.sphere`).

Based on: Veach, Robust Monte Carlo methods for light transport simulation, 1997, ch. 10.3; Pharr, Jakob and
Humphreys, Physically based rendering, 3rd ed. 2016, ch. 16 (light from infinity).
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.sampling import tangent_frame, triangle_barycentric
from baker.pathtracer.bidirectional_weights import (
    BACK,
    CHAIN,
    INVERSE,
    LEAVE,
    MAX_LIGHT_VERTICES,
    OPEN,
    ORIGIN,
    meet,
    towards_eye,
)
from baker.pathtracer.bsdf import INV_PI, cosine_sample
from baker.pathtracer.emitters import (
    EMITTER_AREA,
    EMITTER_CHANCE,
    EMITTER_NORMAL,
    EMITTER_RADIANCE,
    EMITTER_TWO_SIDED,
)
from baker.pathtracer.light_table import (
    DELTA_AXIS,
    DELTA_CHANCE,
    DELTA_FORM,
    DELTA_INTENSITY,
    DELTA_INVERSE_RANGE,
    DELTA_MIN_COSINE,
    DELTA_POSITION,
    EVEN,
    FAR,
    PARALLEL,
    SHORT,
    SKY_CHANCE,
    aim_at_delta,
    aim_at_emitter,
    falloff,
    pick_light,
    point_on_emitter,
    range_window,
)
from baker.pathtracer.scene import EMISSION, FACE
from baker.pathtracer.scene import TWO_SIDED as SURFACE_TWO_SIDED
from baker.pathtracer.vertex import (
    BETA,
    DENSITY,
    GO,
    NORMAL,
    POSITION,
    RAY_B1,
    RAY_B2,
    RAY_LENGTH,
    offset_origin,
    size_of,
)
from baker.trace.jit import inner

_INV_4_PI = 0.25 / math.pi


@inner
def to_world(nx, ny, nz, a, b, c):
    """Return the world direction with components (a, b, c) in the tangent frame of the unit normal n."""
    tx, ty, tz, bx, by, bz = tangent_frame(np.float32(nx), np.float32(ny), np.float32(nz))
    return a * tx + b * bx + c * nx, a * ty + b * by + c * ny, a * tz + b * bz + c * nz


@inner
def start_density(delta, e):
    """Return the density, per steradian, of a light subpath's directions from light e, which has a position.

    delta : (P, 20) float64, see `LightTable`; e : row of the light
    """
    if delta[e, DELTA_FORM] == EVEN:
        return _INV_4_PI
    return 0.5 * INV_PI / max(1.0 - delta[e, DELTA_MIN_COSINE], 1.0e-12)


@inner
def start_at_light(path, lane, lights, sphere, min_offset_scale, choice, u, w, a, b, spot):
    """Start a light subpath: write its position, direction, throughput and densities to column `lane`.

    path : (N_ROWS_BOTH, n) float64; lights : `LightTable`; sphere : (4,) float64, `Reference.sphere`
    min_offset_scale : metres, see `Surfaces`
    choice, u, w, a, b : random numbers in [0, 1): for the light, a point (u, w) and a direction (a, b)
    spot : (2,) float64, output, barycentrics of the start on an emitter. The caller multiplies the throughput
        by the emitter's texture there

    Returns
    -------
    int
        Number of the light.
    """
    emitter, delta, sky = lights.emitter, lights.delta, lights.sky
    n, p = len(emitter), len(delta)
    light = pick_light(lights.cumulative, choice)
    path[OPEN, lane] = 1.0
    path[CHAIN, lane] = 0.0
    path[ORIGIN, lane] = 0.0
    path[INVERSE, lane] = 0.0
    if light < n:
        density = emitter[light, EMITTER_CHANCE] / emitter[light, EMITTER_AREA]
        sign, sides = 1.0, 1.0
        if emitter[light, EMITTER_TWO_SIDED] > 0.0:
            sides = 2.0
            sign = 1.0 if a < 0.5 else -1.0
            a = 2.0 * a if a < 0.5 else 2.0 * a - 1.0
        nx, ny, nz = (
            sign * emitter[light, EMITTER_NORMAL],
            sign * emitter[light, EMITTER_NORMAL + 1],
            sign * emitter[light, EMITTER_NORMAL + 2],
        )
        b1, b2 = triangle_barycentric(np.float32(u), np.float32(w))
        spot[0], spot[1] = b1, b2
        b0 = 1.0 - b1 - b2
        path[NORMAL, lane], path[NORMAL + 1, lane], path[NORMAL + 2, lane] = nx, ny, nz
        x, y, z = point_on_emitter(emitter, light, b0, b1, b2)
        offset_origin(path, lane, x, y, z, min_offset_scale, size_of(emitter, light))
        dx, dy, dz = cosine_sample(a, b)
        cosine = dz
        dx, dy, dz = to_world(nx, ny, nz, dx, dy, dz)
        path[DENSITY, lane] = max(cosine, 1.0e-12) * INV_PI / sides
        path[LEAVE, lane] = cosine
        # MIS sum for the technique in which the eye subpath hits the emitter: 1 / density of the start.
        # `reach_vertex` multiplies it by the cosine at the light.
        path[CHAIN, lane] = 1.0 / density
        scale = math.pi * sides / density
        red, green, blue = (
            emitter[light, EMITTER_RADIANCE],
            emitter[light, EMITTER_RADIANCE + 1],
            emitter[light, EMITTER_RADIANCE + 2],
        )
    elif light < n + p:
        e = light - n
        red, green, blue = (
            delta[e, DELTA_INTENSITY],
            delta[e, DELTA_INTENSITY + 1],
            delta[e, DELTA_INTENSITY + 2],
        )
        if delta[e, DELTA_FORM] == PARALLEL:
            dx, dy, dz = delta[e, DELTA_AXIS], delta[e, DELTA_AXIS + 1], delta[e, DELTA_AXIS + 2]
            start_on_disc(path, lane, sphere, dx, dy, dz, u, w)
            path[ORIGIN, lane] = 1.0
            scale = 1.0 / (path[DENSITY, lane] * delta[e, DELTA_CHANCE])
        else:
            path[POSITION, lane] = delta[e, DELTA_POSITION]
            path[POSITION + 1, lane] = delta[e, DELTA_POSITION + 1]
            path[POSITION + 2, lane] = delta[e, DELTA_POSITION + 2]
            min_cosine = -1.0 if delta[e, DELTA_FORM] == EVEN else delta[e, DELTA_MIN_COSINE]
            cosine = 1.0 - u * (1.0 - min_cosine)
            r = math.sqrt(max(1.0 - cosine * cosine, 0.0))
            phi = 2.0 * math.pi * w
            dx, dy, dz = to_world(
                delta[e, DELTA_AXIS], delta[e, DELTA_AXIS + 1], delta[e, DELTA_AXIS + 2],
                r * math.cos(phi), r * math.sin(phi), cosine,
            )  # fmt: skip
            path[DENSITY, lane] = start_density(delta, e)
            path[LEAVE, lane] = 1.0
            scale = falloff(lights, e, cosine, dx, dy, dz) / (path[DENSITY, lane] * delta[e, DELTA_CHANCE])
    else:
        z = 1.0 - 2.0 * a
        r = math.sqrt(max(1.0 - z * z, 0.0))
        dx, dy, dz = r * math.cos(2.0 * math.pi * b), r * math.sin(2.0 * math.pi * b), z
        start_on_disc(path, lane, sphere, dx, dy, dz, u, w)
        path[ORIGIN, lane] = 2.0
        path[CHAIN, lane] = 1.0 / (sky[SKY_CHANCE] * _INV_4_PI)
        scale = path[CHAIN, lane] / path[DENSITY, lane]
        red, green, blue = sky[0], sky[1], sky[2]
    path[GO, lane], path[GO + 1, lane], path[GO + 2, lane] = dx, dy, dz
    path[BETA, lane], path[BETA + 1, lane], path[BETA + 2, lane] = red * scale, green * scale, blue * scale
    return light


@inner
def range_of_light(lights, light):
    """Return 1 / range^2, in 1/m2, of light number `light`; 0 if the light has no range.

    lights : `LightTable`
    """
    n = len(lights.emitter)
    if n <= light < n + len(lights.delta):
        return lights.delta[light - n, DELTA_INVERSE_RANGE]
    return 0.0


@inner
def fade(path, lane, distance, inverse_range):
    """Multiply the throughput of a light subpath by the light's `range_window` at its first hit.

    The sampling densities do not change. Returns False if the throughput becomes 0.

    path : (N_ROWS_BOTH, n) float64; distance : metres from the light
    inverse_range : 1 / range^2, 1/m2
    """
    share = range_window(distance * distance, inverse_range)
    for c in range(3):
        path[BETA + c, lane] *= share
    return share > 0.0


@inner
def start_on_disc(path, lane, sphere, dx, dy, dz, u, w):
    """Write the start of a light subpath of direction d: a uniform point on a disc in front of the scene.

    The disc is perpendicular to d and touches the scene's bounding sphere.

    path : (N_ROWS_BOTH, n) float64; sphere : (4,) float64, `Reference.sphere`
    u, w : random numbers in [0, 1)
    """
    radius = sphere[3]
    r = radius * math.sqrt(u)
    phi = 2.0 * math.pi * w
    x, y, z = to_world(dx, dy, dz, r * math.cos(phi), r * math.sin(phi), -radius)
    path[POSITION, lane], path[POSITION + 1, lane], path[POSITION + 2, lane] = (
        sphere[0] + x,
        sphere[1] + y,
        sphere[2] + z,
    )
    path[DENSITY, lane] = 1.0 / (math.pi * radius * radius)
    path[LEAVE, lane] = 1.0


@inner
def aim_both_ways(path, row, lane, lights, sphere, choice, u, w, value, ray):
    """Sample a light from the end of an eye subpath; like `vertex.aim`, with MIS weights of all techniques.

    path : (N_ROWS_BOTH, n) float64; row : (5, n) float64; sphere : (4,) float64, `Reference.sphere`
    choice, u, w : random numbers in [0, 1); value : (3,), ray : (6,) float64, outputs, see `vertex.aim`
    """
    emitter, delta, sky = lights.emitter, lights.delta, lights.sky
    n, p = len(emitter), len(delta)
    x, y, z = path[POSITION, lane], path[POSITION + 1, lane], path[POSITION + 2, lane]
    light = pick_light(lights.cumulative, choice)
    max_distance, density, b1, b2 = FAR, 0.0, 0.0, 0.0
    far = 1.0 / (math.pi * sphere[3] * sphere[3])
    if light < n:
        dx, dy, dz, density, b1, b2 = aim_at_emitter(emitter, light, u, w, x, y, z)
        if density <= 0.0:
            return -1
        square = dx * dx + dy * dy + dz * dz
        length = math.sqrt(square)
        dx, dy, dz = dx / length, dy / length, dz / length
        max_distance = length * SHORT
        scale = 1.0 / density
        # Density, per area, with which a subpath from the light samples this vertex; the cosine at this
        # vertex is multiplied in below.
        onward = emitter_cosine(emitter, light, dx, dy, dz) * emission_density(emitter, light) / square
        red, green, blue = (
            emitter[light, EMITTER_RADIANCE],
            emitter[light, EMITTER_RADIANCE + 1],
            emitter[light, EMITTER_RADIANCE + 2],
        )
    elif light < n + p:
        e = light - n
        dx, dy, dz, max_distance, share = aim_at_delta(lights, e, x, y, z)
        scale = share / delta[e, DELTA_CHANCE]
        onward = far
        if delta[e, DELTA_FORM] != PARALLEL:
            onward = start_density(delta, e) / max((max_distance / SHORT) ** 2, 1.0e-20)
        red, green, blue = (
            delta[e, DELTA_INTENSITY],
            delta[e, DELTA_INTENSITY + 1],
            delta[e, DELTA_INTENSITY + 2],
        )
    else:
        a, b, c = cosine_sample(u, w)
        dx, dy, dz = to_world(path[NORMAL, lane], path[NORMAL + 1, lane], path[NORMAL + 2, lane], a, b, c)
        density = sky[SKY_CHANCE] * c * INV_PI
        scale = 1.0 / density if density > 0.0 else 0.0
        onward = 0.25 / max(c, 1.0e-12) * far
        red, green, blue = sky[0], sky[1], sky[2]
    above = dx * path[NORMAL, lane] + dy * path[NORMAL + 1, lane] + dz * path[NORMAL + 2, lane]
    if scale <= 0.0 or above <= 0.0:
        return -1
    from_eye, from_light = meet(
        path, row, lane, path[BACK, lane], path[BACK + 1, lane], path[BACK + 2, lane], dx, dy, dz, value
    )
    less = from_eye / density if density > 0.0 else 0.0
    more = towards_eye(path, lane, onward * above, from_light, MAX_LIGHT_VERTICES - 1)
    scale *= above / (1.0 + less + more)
    value[0] *= path[BETA, lane] * red * scale
    value[1] *= path[BETA + 1, lane] * green * scale
    value[2] *= path[BETA + 2, lane] * blue * scale
    ray[0], ray[1], ray[2] = dx, dy, dz
    ray[RAY_LENGTH], ray[RAY_B1], ray[RAY_B2] = max_distance, b1, b2
    return light if value[0] + value[1] + value[2] > 0.0 else -1


@inner
def emitter_cosine(emitter, e, dx, dy, dz):
    """Return the cosine at emitter e of a ray that arrives in unit direction d; negative on a dark side.

    emitter : (E, 24) float64, see `pathtracer.emitters`
    """
    cosine = -(
        dx * emitter[e, EMITTER_NORMAL]
        + dy * emitter[e, EMITTER_NORMAL + 1]
        + dz * emitter[e, EMITTER_NORMAL + 2]
    )
    return abs(cosine) if emitter[e, EMITTER_TWO_SIDED] > 0.0 else cosine


@inner
def emission_density(emitter, e):
    """Return the density, per projected solid angle, of a light subpath's directions from emitter e.

    emitter : (E, 24) float64, see `pathtracer.emitters`
    """
    return INV_PI * (0.5 if emitter[e, EMITTER_TWO_SIDED] > 0.0 else 1.0)


@inner
def meet_emitter(path, lane, surface, prim, emitter, e, seen, value):
    """Write the MIS-weighted light of triangle `prim`, which an eye subpath hit, to `value` (3,) float64.

    The caller multiplies `value` by the emission texture.

    path : (N_ROWS_BOTH, n) float64; surface : (T, 32) float32, see `Surfaces`
    emitter : (E, 24) float64, see `pathtracer.emitters`
    e : number of the emitter that was hit, -1 if no light subpath starts there
    seen : whether the ray comes from the camera directly. No other technique samples such paths, so the
        weight is 1
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
        density = emitter[e, EMITTER_CHANCE] / emitter[e, EMITTER_AREA]
        onward = emission_density(emitter, e) * cosine
        others = path[OPEN, lane] + onward * path[CHAIN + MAX_LIGHT_VERTICES - 1, lane]
        weight = 1.0 / (1.0 + density * path[INVERSE, lane] * others)
    for c in range(3):
        value[c] = path[BETA + c, lane] * surface[prim, EMISSION + c] * weight


@inner
def meet_sky(path, lane, sky, sphere, seen, value):
    """Write the MIS-weighted light of the sky to `value`, for an eye subpath that left the scene.

    path : (N_ROWS_BOTH, n) float64; sky : (4,) float64, see `LightTable`
    sphere : (4,) float64, `Reference.sphere`; seen : see `meet_emitter`; value : (3,) float64, output
    """
    weight = 1.0
    if not seen and sky[SKY_CHANCE] > 0.0:
        far = 1.0 / (math.pi * sphere[3] * sphere[3])
        leave = max(path[LEAVE, lane], 0.0)
        aimed = INV_PI * leave * path[OPEN, lane]
        started = _INV_4_PI * far * leave * path[CHAIN + MAX_LIGHT_VERTICES - 1, lane]
        weight = 1.0 / (1.0 + sky[SKY_CHANCE] * (aimed + started) / path[DENSITY, lane])
    for c in range(3):
        value[c] = path[BETA + c, lane] * sky[c] * weight
