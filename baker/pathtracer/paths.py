# mypy: disable-error-code="no-untyped-def"
"""Many paths at once, eight side by side: those that end leave no gaps, new ones take their places.

    L = L_e + int f L cos        estimated path by path; Russian roulette ends paths without bias

Lambertian vertices are shaded in float32 by vector code (`vertex_simd`), others one by one in float64
(`vertex`); light is summed in float64. A path's random numbers belong to (seed, pass, point, sample), and
what it brings goes to the point's sum in a fixed order inside a tile: the same bytes for any number of
threads.

Based on: Kajiya, The rendering equation, 1986; Veach, 1997, ch. 9 and 10.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.emitters import emitter_at
from baker.pathtracer.bsdf import N_PARAMETERS, WIDTH
from baker.pathtracer.light_table import on_whole_triangle, pick_lamp, triangle_density
from baker.pathtracer.path_blocks import (
    ALBEDO,
    ALIVE,
    B1,
    B2,
    BETA,
    BINS,
    BLOCK,
    BLOCKS,
    BOUNCES,
    CHOICE,
    COSINE,
    COUNT,
    DENSITY,
    KEY,
    LAMP,
    LANES,
    LOBE,
    NORMAL,
    POINT,
    REACH,
    ROULETTE,
    SAMPLE,
    SHADED,
    TO_LAMP,
    TRIANGLE,
    U_LAMP,
    U_WAY,
    VALUE,
    W_LAMP,
    W_WAY,
    close_gaps,
    trace_blocks,
    unsigned,
)
from baker.pathtracer.rng import random_lanes, spread_lanes
from baker.pathtracer.scene import EMISSION, EMITTER, FACE, MATERIAL, SHINES, TEXTURED, TWO_SIDED
from baker.pathtracer.shadow_rays import cast_packet, cast_to_lamps
from baker.pathtracer.vertex import BETA as PATH_BETA
from baker.pathtracer.vertex import DENSITY as PATH_DENSITY
from baker.pathtracer.vertex import (
    FRAME,
    GO,
    MOST,
    N_ROWS,
    PLACE,
    SURE,
    aim,
    arrive,
    glow,
    heuristic,
    paint,
    scatter,
    start_path,
)
from baker.pathtracer.vertex_simd import aim_lanes, arrive_lanes, scatter_lanes, stand_lanes
from baker.trace.jit import inner, kernel, scratch
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, HIT_U, HIT_V, NO_HIT, ORG_X, PRIM_ID, TFAR

_f = np.float32
# Few lamps are counted through, more are searched.
_FEW = 16
_INV_2_32 = 1.0 / 4294967296.0
# Working memory of a tile.
_new_path, _new_row = scratch((N_ROWS, LANES), np.float64), scratch((N_PARAMETERS, LANES), np.float64)
_new_value, _new_way, _new_rgba = (scratch((n,), np.float64) for n in (3, 6, 4))
_new_lamp, _new_filled = scratch((LANES,), np.int64), scratch((BINS,), np.int64)


@inner
def see_emitter(s, base, lane, surface, triangle, node, prim, mode, power, value):
    """Write to `value` (3,) what the hit triangle sends along the path, weighed against aiming at it.

    Its texture is not looked up yet.
    """
    value[0] = value[1] = value[2] = 0.0
    dx, dy, dz = (
        s[base + DIR_X * LANES + lane],
        s[base + DIR_Y * LANES + lane],
        s[base + DIR_Z * LANES + lane],
    )
    facing = dx * surface[prim, FACE] + dy * surface[prim, FACE + 1] + dz * surface[prim, FACE + 2]
    if facing >= 0.0 and surface[prim, TWO_SIDED] == 0.0:
        return
    weight = 1.0
    if s[base + DENSITY * LANES + lane] > _f(0.0) and mode > 0:
        if mode == 1:
            return
        distance, other = np.float64(s[base + TFAR * LANES + lane]), 0.0
        e = emitter_at(
            node, np.int64(surface[prim, EMITTER]),
            s[base + HIT_U * LANES + lane], s[base + HIT_V * LANES + lane],
        )  # fmt: skip
        if e >= 0:
            other = triangle_density(triangle, e, dx * distance, dy * distance, dz * distance)
        weight = heuristic(np.float64(s[base + DENSITY * LANES + lane]), other, power)
    for c in range(3):
        value[c] = s[base + (BETA + c) * LANES + lane] * np.float64(surface[prim, EMISSION + c]) * weight


@inner
def see_sky(s, base, lane, sky, mode, power, value):
    """Do the same for the sky, where a path leaves the scene."""
    value[0] = value[1] = value[2] = 0.0
    weight = 1.0
    density = np.float64(s[base + DENSITY * LANES + lane])
    if density > 0.0 and mode > 0 and sky[3] > 0.0:
        if mode == 1:
            return
        weight = heuristic(density, sky[3] * max(s[base + COSINE * LANES + lane], 0.0) / math.pi, power)
    for c in range(3):
        value[c] = s[base + (BETA + c) * LANES + lane] * sky[c] * weight


@inner
def start_lanes(s, words, base, where, toward, normal, begin, following, samples, first, at_surface):
    """Begin paths: at white Lambertian points (light leaving them is E / pi), or as rays; see `trace_paths`.

    following : number of the first path; first : number of the first sample of all
    """
    base = unsigned(base)
    m, places = len(toward), toward.shape[1]
    for lane in range(LANES):
        if following + lane >= m * samples:
            s[base + ALIVE * LANES + lane] = _f(0.0)
            continue
        # Neighbouring lanes hold neighbouring points with the same sample.
        sample = (following + lane) // m
        i, k = unsigned(following + lane - sample * m), unsigned((first + sample) % places)
        here = i if len(where) == m else 0
        there = k if where.shape[1] == places else 0
        s[base + ALIVE * LANES + lane] = _f(1.0)
        s[base + DENSITY * LANES + lane] = s[base + COSINE * LANES + lane] = _f(0.0)
        s[base + BOUNCES * LANES + lane] = _f(0.0) if at_surface else _f(-1.0)
        s[base + POINT * LANES + lane] = i
        words[base + KEY * LANES + lane], words[base + SAMPLE * LANES + lane] = begin + i, sample
        words[base + COUNT * LANES + lane] = np.uint32(0)
        for a in range(3):
            s[base + (BETA + a) * LANES + lane] = s[base + (ALBEDO + a) * LANES + lane] = _f(1.0)
            s[base + (ORG_X + a) * LANES + lane] = where[here, there, a]
            s[base + (DIR_X + a) * LANES + lane] = s[base + (SHADED + a) * LANES + lane] = toward[i, k, a]
            s[base + (NORMAL + a) * LANES + lane] = normal[i, k, a]


@inner
def fetch_lanes(s, words, base, surface, material):
    """Copy what Lambertian vertices are made of: the triangles' rows and base colours."""
    base = unsigned(base)
    for lane in range(LANES):
        if s[base + ALIVE * LANES + lane] > _f(0.0):
            prim = np.int64(words[base + PRIM_ID * LANES + lane])
            for c in range(TWO_SIDED + 1):
                s[base + (TRIANGLE + c) * LANES + lane] = surface[prim, c]
            m = unsigned(surface[prim, MATERIAL])
            for c in range(3):
                s[base + (ALBEDO + c) * LANES + lane] = material[m, c]


@inner
def choose_lamps(s, words, base, every, cumulative, lamp):
    """Choose a lamp for each lane: its number to `lamp` (8,) int64, its row of `every` to `s`."""
    base = unsigned(base)
    for lane in range(LANES):
        choice, e = np.float64(words[base + CHOICE * LANES + lane]) * _INV_2_32, 0
        if len(cumulative) > _FEW:
            e = pick_lamp(cumulative, choice)
        else:
            # The same without a branch that nobody can foresee.
            for k in range(len(cumulative) - 1):
                e += 1 if cumulative[k] <= choice else 0
        lamp[lane] = e
    for lane in range(LANES):
        e = unsigned(lamp[lane])
        for c in range(20):
            s[base + (LAMP + c) * LANES + lane] = every[e, c]


@inner
def turn_alone(path, row, lane, s, words, base, hemisphere, value):
    """Choose the direction in which one lane's path goes on, or end it."""
    choice = np.float64(words[base + LOBE * LANES + lane]) * _INV_2_32
    u, w = np.float64(s[base + U_WAY * LANES + lane]) - 1.0, np.float64(s[base + W_WAY * LANES + lane]) - 1.0
    alive = scatter(path, row, lane, hemisphere, choice, u, w, value)
    survive = 1.0
    if alive and s[base + BOUNCES * LANES + lane] >= _f(SURE):
        survive = min(max(path[PATH_BETA, lane], path[PATH_BETA + 1, lane], path[PATH_BETA + 2, lane]), MOST)
        alive = s[base + ROULETTE * LANES + lane] - 1.0 < survive
    s[base + ALIVE * LANES + lane] = _f(1.0) if alive else _f(0.0)
    cosine = 0.0
    for a in range(3):
        s[base + (BETA + a) * LANES + lane] = path[PATH_BETA + a, lane] / survive
        s[base + (ORG_X + a) * LANES + lane] = path[PLACE + a, lane]
        s[base + (DIR_X + a) * LANES + lane] = path[GO + a, lane]
        cosine += path[GO + a, lane] * path[FRAME + 6 + a, lane]
    s[base + DENSITY * LANES + lane] = path[PATH_DENSITY, lane]
    s[base + COSINE * LANES + lane] = cosine


@inner
def aim_alone(path, row, lane, s, words, base, triangle, point, cumulative, sky, mode, power, value, way):
    """Aim at one lamp from one lane's vertex; return its number, -1 if it brings nothing."""
    choice = np.float64(words[base + CHOICE * LANES + lane]) * _INV_2_32
    u, w = (
        np.float64(s[base + U_LAMP * LANES + lane]) - 1.0,
        np.float64(s[base + W_LAMP * LANES + lane]) - 1.0,
    )
    lamp = aim(path, row, lane, triangle, point, cumulative, sky, mode, power, choice, u, w, value, way)
    for a in range(3):
        s[base + (VALUE + a) * LANES + lane] = value[a] if lamp >= 0 else 0.0
        s[base + (TO_LAMP + a) * LANES + lane] = way[a]
        s[base + (ORG_X + a) * LANES + lane] = path[PLACE + a, lane]
    s[base + REACH * LANES + lane], s[base + B1 * LANES + lane], s[base + B2 * LANES + lane] = (
        way[3],
        way[4],
        way[5],
    )
    return lamp


@kernel
def trace_paths(where, toward, normal, begin, at_surface, surfaces, lamps, shading, memory, net, how, out):
    """Add the light that paths bring to each of m points, and count path segments and shadow rays.

    where, toward, normal : (m, k, 3) float64; sample s of pass p starts at place (p n + s) modulo k of its
        point: place, shading normal and geometric normal, or ray origin and direction if not `at_surface`;
        one place (1, 1, 3) may be that of all
    begin : number of the first point; net : (n, 2) uint32, n samples of a pass as bit-reversed Sobol numbers
    how : (8,) int64: `Estimator` (hemisphere, aim, strata, power), most bounces (-1: unlimited), seed, pass,
        `seed_salt`
    out : (m, 3) float64 sums; at a surface of light leaving a white one, E / pi

    Returns
    -------
    tuple of int
        Closest-hit and shadow rays cast.
    """
    scene, intersect, occluded, blend = memory.scene, memory.intersect, memory.occluded, memory.blend
    on, s, words, bins = memory.on, memory.s, memory.words, memory.bins
    surface, material, least, lambertian = (
        surfaces.row,
        surfaces.material,
        surfaces.least,
        surfaces.lambertian,
    )
    triangle, point, number, node = lamps.triangle, lamps.point, lamps.number, lamps.node
    cumulative, sky, every = lamps.cumulative, lamps.sky, lamps.every
    # What has to be looked up: alpha or emission of lamps, colours of surfaces.
    glows = len(shading.alpha.slot) > 0 or lamps.glows != 0
    painted = surfaces.painted != 0
    hemisphere, mode, strata, power = how[0], how[1], how[2], how[3]
    most_bounces, number_of_pass, salt = how[4], how[6], how[7]
    lit = cumulative[len(cumulative) - 1] > 0.0
    path, row = _new_path(), _new_row()
    value, way, rgba, lamp, filled = _new_value(), _new_way(), _new_rgba(), _new_lamp(), _new_filled()
    samples, m, places = len(net), toward.shape[0], toward.shape[1]
    total = m * samples
    following = rays = shadows = 0
    # Blocks in use; the one to be shaded next in this round, which begins when all are traced.
    blocks = block = 0
    traced = False
    while True:
        met = block < blocks
        if met:
            base = unsigned(block * BLOCK)
            block += 1
        else:
            if traced:
                blocks = block = close_gaps(s, blocks)
                traced = False
            if following == total or blocks == BLOCKS:
                if blocks == 0:
                    break
                rays += trace_blocks(s, words, blocks, on, intersect, occluded, scene, blend, surface)
                block, traced = 0, True
                continue
            base = unsigned(blocks * BLOCK)
            blocks += 1
            block = blocks
            start_lanes(
                s,
                words,
                base,
                where,
                toward,
                normal,
                begin,
                following,
                samples,
                number_of_pass * samples,
                at_surface,
            )
            following = min(following + LANES, total)
            if not at_surface:
                continue
        plain = hemisphere != 1 and (lambertian != 0 or not met)
        any_vertex = not met
        if met:
            for lane in range(LANES):
                if s[base + ALIVE * LANES + lane] == _f(0.0):
                    continue
                i = np.int64(s[base + POINT * LANES + lane])
                if words[base + GEOM_ID * LANES + lane] == NO_HIT:
                    see_sky(s, base, lane, sky, mode, power, value)
                    for c in range(3):
                        out[i, c] += value[c]
                    s[base + ALIVE * LANES + lane] = _f(0.0)
                    continue
                prim = np.int64(words[base + PRIM_ID * LANES + lane])
                if surface[prim, SHINES] > _f(0.0):
                    see_emitter(s, base, lane, surface, triangle, node, prim, mode, power, value)
                    if surface[prim, SHINES] > _f(1.0):
                        u = np.float64(s[base + HIT_U * LANES + lane])
                        v = np.float64(s[base + HIT_V * LANES + lane])
                        glow(shading, prim, u, v, value, rgba, False)
                    for c in range(3):
                        out[i, c] += value[c]
                s[base + BOUNCES * LANES + lane] += _f(1.0)
                if most_bounces >= 0 and s[base + BOUNCES * LANES + lane] > most_bounces:
                    s[base + ALIVE * LANES + lane] = _f(0.0)
                any_vertex = any_vertex or s[base + ALIVE * LANES + lane] > _f(0.0)
        if not any_vertex:
            continue
        random_lanes(words, base, number_of_pass, salt)
        if strata:
            spread_lanes(words, base, net, number_of_pass, salt)
        if met and plain:
            fetch_lanes(s, words, base, surface, material)
        if met and (painted or not plain):
            for lane in range(LANES):
                if s[base + ALIVE * LANES + lane] == _f(0.0):
                    continue
                prim = np.int64(words[base + PRIM_ID * LANES + lane])
                u, v = np.float64(s[base + HIT_U * LANES + lane]), np.float64(s[base + HIT_V * LANES + lane])
                if not plain:
                    for a in range(3):
                        path[GO + a, lane] = s[base + (DIR_X + a) * LANES + lane]
                    if not arrive(path, row, lane, surface, material, prim, u, v, least, lambertian):
                        s[base + ALIVE * LANES + lane] = _f(0.0)
                        continue
                if surface[prim, TEXTURED] > _f(0.0):
                    if plain:
                        for c in range(3):
                            row[c, lane] = s[base + (ALBEDO + c) * LANES + lane]
                        row[WIDTH, lane] = -1.0
                    paint(row, lane, shading, prim, u, v, material, rgba)
                    for c in range(3):
                        s[base + (ALBEDO + c) * LANES + lane] = row[c, lane]
        if plain:
            if met:
                arrive_lanes(s, base, _f(least))
            else:
                stand_lanes(s, base, _f(least), _f(surfaces.most))
            if lit:
                choose_lamps(s, words, base, every, cumulative, lamp)
                aim_lanes(s, base, mode, power)
        else:
            for lane in range(LANES):
                lamp[lane] = -1
                if s[base + ALIVE * LANES + lane] == _f(0.0):
                    continue
                if not met:
                    i, sample = (
                        np.int64(s[base + POINT * LANES + lane]),
                        np.int64(words[base + SAMPLE * LANES + lane]),
                    )
                    k = (number_of_pass * samples + sample) % places
                    sizes = (least, surfaces.most)
                    start_path(path, row, lane, where[i, k], toward[i, k], normal[i, k], True, sizes)
                for c in range(3):
                    path[PATH_BETA + c, lane] = s[base + (BETA + c) * LANES + lane]
                if lit:
                    lamp[lane] = aim_alone(
                        path, row, lane, s, words, base, triangle, point, cumulative, sky, mode, power, value,
                        way,
                    )  # fmt: skip
        if lit:
            if glows:
                for lane in range(LANES):
                    e = lamp[lane]
                    if s[base + ALIVE * LANES + lane] > _f(0.0) and 0 <= e < len(triangle):
                        for c in range(3):
                            value[c] = s[base + (VALUE + c) * LANES + lane]
                        u, v = (
                            np.float64(s[base + B1 * LANES + lane]),
                            np.float64(s[base + B2 * LANES + lane]),
                        )
                        u, v = on_whole_triangle(triangle, e, u, v)
                        glow(shading, number[e], u, v, value, rgba, True)
                        for c in range(3):
                            s[base + (VALUE + c) * LANES + lane] = value[c]
            shadows += cast_to_lamps(
                s, base, lamp, len(cumulative), bins, filled, occluded, scene, blend, on, out
            )
        if plain:
            scatter_lanes(s, base)
        else:
            for lane in range(LANES):
                if s[base + ALIVE * LANES + lane] > _f(0.0):
                    turn_alone(path, row, lane, s, words, base, hemisphere, value)
    for k in range(BINS):
        if filled[k] > 0:
            cast_packet(bins, filled, k, occluded, scene, blend, on, out)
    return rays, shadows
