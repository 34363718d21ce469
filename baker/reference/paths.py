"""Many paths at once, eight or sixteen to a packet: a lane whose path has ended takes the next one.

    L = L_e + int f L cos        estimated path by path; Russian roulette ends paths without bias

A path's random numbers belong to (seed, pass, point, sample), its result goes to the point's sum in a fixed
order inside a tile: the same bytes for any number of threads.

Based on: Kajiya, The rendering equation, 1986; Veach, 1997, ch. 9 and 10; Laine, Karras and Aila, Megakernels
considered harmful, 2013 (regeneration of paths).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from baker.kernels.sampling import texel_scramble
from baker.reference.bsdf import METALLIC, N_PARAMETERS, WIDTH
from baker.reference.lamps import RADIANCE, triangle_density
from baker.reference.lamps import TEXTURED as GLOWS
from baker.reference.lamps import TWO_SIDED as LAMP_TWO_SIDED
from baker.reference.randomness import draw, path_state
from baker.reference.step import step
from baker.reference.vertex import (
    BETA,
    BOUNCES,
    DENSITY,
    FRAME,
    GO,
    LIGHT,
    N_ROWS,
    NORMAL,
    PLACE,
    TO,
    aim,
    arrive,
    glow,
    heuristic,
    paint,
    place_off,
    scatter,
    set_frame,
)
from baker.reference.view import EMITTER, FACE, TEXTURED
from baker.trace.packets import GEOM_ID, HIT_U, HIT_V, MAX_WIDTH, NO_HIT, PRIM_ID, TFAR, set_ray, trace

_IDLE, _RAY, _VERTEX = 0, 1, 2
# Roulette begins after this many bounces and lets at most this share live on.
_SURE = 3
_MOST = 0.98


@step
def start_path(path, row, lane, where, toward, normal, at_surface, least):  # type: ignore[no-untyped-def]
    """Begin a path: at a white Lambertian point (light leaving it is E / pi), or as a ray.

    where, toward, normal : (3,) point, shading normal, geometric normal; or ray origin, direction, unused
    """
    for c in range(3):
        path[BETA + c, lane] = 1.0
        path[LIGHT + c, lane] = 0.0
    path[DENSITY, lane] = 0.0
    path[BOUNCES, lane] = 0.0
    if not at_surface:
        for a in range(3):
            path[PLACE + a, lane] = where[a]
            path[GO + a, lane] = toward[a]
        path[BOUNCES, lane] = -1.0
        return
    for a in range(3):
        path[NORMAL + a, lane] = normal[a]
        row[a, lane] = 1.0
    row[METALLIC, lane], row[WIDTH, lane] = 0.0, -1.0
    place_off(path, lane, where[0], where[1], where[2], least)
    set_frame(path, lane, toward[0], toward[1], toward[2])
    path[TO, lane], path[TO + 1, lane], path[TO + 2, lane] = 0.0, 0.0, 1.0


@step
def see_emitter(path, lane, surface, triangle, prim, distance, mode, power, value):  # type: ignore[no-untyped-def]
    """Write to `value` (3,) what the hit triangle sends along the path, weighed against aiming at it.

    Its texture is not looked up yet.
    """
    value[0] = value[1] = value[2] = 0.0
    e = np.int64(surface[prim, EMITTER])
    dx, dy, dz = path[GO, lane], path[GO + 1, lane], path[GO + 2, lane]
    facing = dx * surface[prim, FACE] + dy * surface[prim, FACE + 1] + dz * surface[prim, FACE + 2]
    if facing >= 0.0 and triangle[e, LAMP_TWO_SIDED] == 0.0:
        return
    weight = 1.0
    if path[DENSITY, lane] > 0.0 and mode > 0:
        if mode == 1:
            return
        other = triangle_density(triangle, e, dx * distance, dy * distance, dz * distance)
        weight = heuristic(path[DENSITY, lane], other, power)
    for c in range(3):
        value[c] = path[BETA + c, lane] * triangle[e, RADIANCE + c] * weight


@step
def see_sky(path, lane, sky, mode, power):  # type: ignore[no-untyped-def]
    """Collect the sky's light at the end of a path that leaves the scene."""
    weight = 1.0
    if path[DENSITY, lane] > 0.0 and mode > 0 and sky[3] > 0.0:
        if mode == 1:
            return
        cosine = (
            path[GO, lane] * path[FRAME + 6, lane]
            + path[GO + 1, lane] * path[FRAME + 7, lane]
            + path[GO + 2, lane] * path[FRAME + 8, lane]
        )
        weight = heuristic(path[DENSITY, lane], sky[3] * max(cosine, 0.0) / math.pi, power)
    for c in range(3):
        path[LIGHT + c, lane] += path[BETA + c, lane] * sky[c] * weight


@njit(cache=True, nogil=True, error_model="numpy")
def trace_paths(where, toward, normal, begin, at_surface, surfaces, lamps, shading, caster, net, how, out):  # type: ignore[no-untyped-def]
    """Add the light that paths bring to each of m points, and count path segments and shadow rays.

    where, toward, normal : (m, k, 3) float64; sample s of pass p starts at place (p n + s) modulo k of its
        point: place, shading normal and geometric normal, or ray origin and direction if not `at_surface`
    begin : number of the first point; net : (n, 2) uint32, n samples of a pass as bit-reversed Sobol numbers
    how : (7,) int64: `Estimator` (hemisphere, aim, strata, power), most bounces (-1: unlimited), seed, pass
    out : (m, 3) float64 sums; at a surface of light leaving a white one, E / pi

    Returns
    -------
    tuple of int
        Closest-hit and shadow rays cast.
    """
    width, scene, intersect, occluded = caster.width, caster.scene, caster.intersect, caster.occluded
    valid, floats, words = caster.valid, caster.floats, caster.words
    surface, material, least, lambertian = (
        surfaces.row,
        surfaces.material,
        surfaces.least,
        surfaces.lambertian,
    )
    triangle, point, number = lamps.triangle, lamps.point, lamps.number
    cumulative, sky = lamps.cumulative, lamps.sky
    alpha = len(shading.alpha.slot) > 0
    hemisphere, mode, strata, power = how[0], how[1], how[2], how[3]
    most_bounces, seed, number_of_pass = how[4], how[5], how[6]
    lit = cumulative[len(cumulative) - 1] > 0.0
    path = np.zeros((N_ROWS, MAX_WIDTH))
    row = np.zeros((N_PARAMETERS, MAX_WIDTH))
    value = np.zeros(3)
    values = np.zeros((3, MAX_WIDTH))
    way = np.zeros(6)
    rgba = np.zeros(4)
    stage = np.zeros(MAX_WIDTH, np.int64)
    job = np.zeros(MAX_WIDTH, np.int64)
    state = np.zeros(MAX_WIDTH, np.uint64)
    samples, m, places = len(net), where.shape[0], where.shape[1]
    following = 0
    rays = 0
    shadows = 0
    while True:
        any_ray = False
        any_path = False
        for lane in range(width):
            if stage[lane] == _IDLE and following < m * samples:
                # Neighbouring lanes hold neighbouring points with the same sample.
                i, s = following % m, following // m
                job[lane] = following
                following += 1
                state[lane] = path_state(seed, number_of_pass, begin + i, s)
                k = (number_of_pass * samples + s) % places
                start_path(path, row, lane, where[i, k], toward[i, k], normal[i, k], at_surface, least)
                stage[lane] = _VERTEX if at_surface else _RAY
            any_path = any_path or stage[lane] != _IDLE
            valid[lane] = 0
            if stage[lane] == _RAY:
                set_ray(
                    floats, words, width, lane,
                    path[PLACE, lane], path[PLACE + 1, lane], path[PLACE + 2, lane],
                    path[GO, lane], path[GO + 1, lane], path[GO + 2, lane], np.float32(1.0e30),
                )  # fmt: skip
                valid[lane] = -1
                any_ray = True
                rays += 1
        if not any_path:
            break
        if any_ray:
            trace(intersect, scene, valid, floats)
            for lane in range(width):
                if stage[lane] != _RAY:
                    continue
                stage[lane] = _VERTEX
                if words[GEOM_ID * width + lane] == NO_HIT:
                    see_sky(path, lane, sky, mode, power)
                    stage[lane] = _IDLE
                else:
                    prim = np.int64(words[PRIM_ID * width + lane])
                    u = np.float64(floats[HIT_U * width + lane])
                    v = np.float64(floats[HIT_V * width + lane])
                    if surface[prim, EMITTER] >= 0.0:
                        distance = np.float64(floats[TFAR * width + lane])
                        see_emitter(path, lane, surface, triangle, prim, distance, mode, power, value)
                        if triangle[np.int64(surface[prim, EMITTER]), GLOWS] > 0.0:
                            glow(shading, prim, u, v, value, rgba, False)
                        for c in range(3):
                            path[LIGHT + c, lane] += value[c]
                    path[BOUNCES, lane] += 1.0
                    deep = most_bounces >= 0 and path[BOUNCES, lane] > most_bounces
                    if deep or not arrive(path, row, lane, surface, material, prim, u, v, least, lambertian):
                        stage[lane] = _IDLE
                    elif surface[prim, TEXTURED] > 0.0:
                        paint(row, lane, shading, prim, u, v, material, rgba)
                if stage[lane] == _IDLE:
                    for c in range(3):
                        out[job[lane] % m, c] += path[LIGHT + c, lane]
        if lit:
            any_shadow = False
            for lane in range(width):
                valid[lane] = 0
                if stage[lane] == _VERTEX:
                    choice, u, w = draw(state, lane), draw(state, lane), draw(state, lane)
                    if strata and path[BOUNCES, lane] == 0.0:
                        u, w = stratum(net, job[lane] // m, begin + job[lane] % m, seed, number_of_pass, 0)
                    lamp = aim(
                        path,
                        row,
                        lane,
                        triangle,
                        point,
                        cumulative,
                        sky,
                        mode,
                        power,
                        choice,
                        u,
                        w,
                        value,
                        way,
                    )
                    if 0 <= lamp < len(triangle) and (alpha or triangle[lamp, GLOWS] > 0.0):
                        glow(shading, number[lamp], way[4], way[5], value, rgba, True)
                    if lamp >= 0:
                        set_ray(
                            floats, words, width, lane,
                            path[PLACE, lane], path[PLACE + 1, lane], path[PLACE + 2, lane],
                            way[0], way[1], way[2], np.float32(way[3]),
                        )  # fmt: skip
                        valid[lane] = -1
                        any_shadow = True
                        shadows += 1
                        for c in range(3):
                            values[c, lane] = value[c]
            if any_shadow:
                trace(occluded, scene, valid, floats)
                for lane in range(width):
                    if valid[lane] and floats[TFAR * width + lane] >= np.float32(0.0):
                        for c in range(3):
                            path[LIGHT + c, lane] += values[c, lane]
        for lane in range(width):
            if stage[lane] != _VERTEX:
                continue
            choice, u, w = draw(state, lane), draw(state, lane), draw(state, lane)
            if strata and path[BOUNCES, lane] == 0.0:
                u, w = stratum(net, job[lane] // m, begin + job[lane] % m, seed, number_of_pass, 1)
            alive = scatter(path, row, lane, hemisphere, choice, u, w, value)
            if alive and path[BOUNCES, lane] >= _SURE:
                survive = min(max(path[BETA, lane], path[BETA + 1, lane], path[BETA + 2, lane]), _MOST)
                alive = draw(state, lane) < survive
                for c in range(3):
                    path[BETA + c, lane] /= survive
            stage[lane] = _RAY if alive else _IDLE
            if not alive:
                for c in range(3):
                    out[job[lane] % m, c] += path[LIGHT + c, lane]
    return rays, shadows


@step
def stratum(net, sample, point, seed, number_of_pass, pair):  # type: ignore[no-untyped-def]
    """Return numbers of a scrambled (0,2)-net, scrambled anew for each point, pass and pair."""
    bits = path_state(seed, number_of_pass, point, np.uint64(1) << np.uint64(40 + pair))
    first = np.uint32(bits & np.uint64(0xFFFFFFFF))
    second = np.uint32(bits >> np.uint64(32))
    none = np.uint32(0)
    return (
        np.float64(texel_scramble(net[sample, 0], first, none)),
        np.float64(texel_scramble(net[sample, 1], second, none)),
    )
