# mypy: disable-error-code="no-untyped-def"
"""Traces paths in blocks of eight. New paths replace ended paths, so that ray packets stay full.

    L = L_e + integral f L cos

Each path is one estimate of L. Russian roulette ends paths without bias.

Lambertian vertices are shaded in float32, eight at a time (`vertex_simd`). Other vertices are shaded in
float64, one at a time (`vertex`). Light is summed in float64. Results do not depend on the number of threads:
the random numbers of a path depend on (seed, pass, point, sample) only, and the light of a tile's paths is
added in a fixed order. `tests/path_tracer.py` is an independent path tracer for Lambertian surfaces.

In all functions, `s` and `words` are the blocks of `path_blocks`, viewed as float32 and as uint32.

Based on: Kajiya, The rendering equation, 1986; Veach, Robust Monte Carlo methods for light transport
simulation, 1997, ch. 9 and 10.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.emitters import emitter_at
from baker.pathtracer.bsdf import N_PARAMETERS, WIDTH
from baker.pathtracer.light_table import (
    ROW_COLUMNS,
    SKY_CHANCE,
    emitter_density,
    on_whole_triangle,
    pick_light,
)
from baker.pathtracer.path_blocks import (
    ALBEDO,
    ALIVE,
    B1,
    B2,
    BETA,
    BINS,
    BLOCK,
    BLOCK_WIDTH,
    BLOCKS,
    BOUNCES,
    CHOICE,
    COSINE,
    COUNT,
    DENSITY,
    KEY,
    LIGHT_ROW,
    LOBE,
    MAX_DISTANCE,
    NORMAL,
    POINT,
    ROULETTE,
    SAMPLE,
    SHADED,
    TO_LIGHT,
    TRIANGLE,
    U_DIRECTION,
    U_LIGHT,
    VALUE,
    W_DIRECTION,
    W_LIGHT,
    close_gaps,
    trace_blocks,
    unsigned,
)  # fmt: skip
from baker.pathtracer.rng import random_lanes, spread_lanes
from baker.pathtracer.scene import BASE_COLOUR, EMISSION, EMITTER, FACE, MATERIAL, SHINES, TEXTURED, TWO_SIDED
from baker.pathtracer.shadow_rays import cast_packet, cast_to_lights
from baker.pathtracer.vertex import BETA as PATH_BETA
from baker.pathtracer.vertex import DENSITY as PATH_DENSITY
from baker.pathtracer.vertex import (
    FRAME,
    GO,
    MOST,
    N_ROWS,
    POSITION,
    RAY_B1,
    RAY_B2,
    RAY_LENGTH,
    SURE,
    aim,
    arrive,
    heuristic,
    multiply_emission_texture,
    paint,
    scatter,
    start_path,
)
from baker.pathtracer.vertex_simd import (
    aim_at_lights,
    arrive_lanes,
    look_up_falloff,
    scatter_lanes,
    start_vertices,
)
from baker.trace.jit import inner, kernel, scratch
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, HIT_U, HIT_V, NO_HIT, ORG_X, PRIM_ID, TFAR

_f = np.float32
_L = BLOCK_WIDTH
# Limit of the number of lights, including the sky. Up to this limit, a light is chosen by linear search,
# above it by binary search.
_FEW = 16
_INV_2_32 = 1.0 / 4294967296.0
# Stack arrays of `trace_paths`.
_new_path, _new_row = (
    scratch((N_ROWS, BLOCK_WIDTH), np.float64),
    scratch((N_PARAMETERS, BLOCK_WIDTH), np.float64),
)
_new_value, _new_ray, _new_rgba = (scratch((n,), np.float64) for n in (3, 6, 4))
_new_light, _new_filled = scratch((BLOCK_WIDTH,), np.int64), scratch((BINS,), np.int64)


@inner
def see_emitter(s, base, lane, surface, lights, prim, mode, power, value):
    """Write the MIS-weighted light of the emissive triangle `prim`, which the lane's path hit, to `value`.

    The caller multiplies `value` by the emission texture.

    s : blocks, float32; base : index of the block's first number
    surface : (T, 32) float32, see `Surfaces`; lights : `LightTable`; value : (3,) float64, output
    mode, power : `Estimator.aim` and `.power`
    """
    value[0] = value[1] = value[2] = 0.0
    dx, dy, dz = s[base + DIR_X * _L + lane], s[base + DIR_Y * _L + lane], s[base + DIR_Z * _L + lane]
    facing = dx * surface[prim, FACE] + dy * surface[prim, FACE + 1] + dz * surface[prim, FACE + 2]
    if facing >= 0.0 and surface[prim, TWO_SIDED] == 0.0:
        return
    weight = 1.0
    if s[base + DENSITY * _L + lane] > _f(0.0) and mode > 0:
        if mode == 1:
            return
        distance, other = np.float64(s[base + TFAR * _L + lane]), 0.0
        e = emitter_at(
            lights.node, np.int64(surface[prim, EMITTER]),
            s[base + HIT_U * _L + lane], s[base + HIT_V * _L + lane],
        )  # fmt: skip
        if e >= 0:
            other = emitter_density(lights.emitter, e, dx * distance, dy * distance, dz * distance)
        weight = heuristic(np.float64(s[base + DENSITY * _L + lane]), other, power)
    for c in range(3):
        value[c] = s[base + (BETA + c) * _L + lane] * np.float64(surface[prim, EMISSION + c]) * weight


@inner
def see_sky(s, base, lane, sky, mode, power, value):
    """Write the MIS-weighted light of the sky to `value`, for a lane whose path left the scene.

    s : blocks, float32; sky : (4,) float64, see `LightTable`; value : (3,) float64, output
    """
    value[0] = value[1] = value[2] = 0.0
    weight = 1.0
    density = np.float64(s[base + DENSITY * _L + lane])
    if density > 0.0 and mode > 0 and sky[SKY_CHANCE] > 0.0:
        if mode == 1:
            return
        weight = heuristic(density, sky[SKY_CHANCE] * max(s[base + COSINE * _L + lane], 0.0) / math.pi, power)
    for c in range(3):
        value[c] = s[base + (BETA + c) * _L + lane] * sky[c] * weight


@inner
def start_lanes(s, words, base, where, toward, normal, begin, following, samples, first, at_surface):
    """Start the paths of numbers `following` to `following` + 7 in a block.

    Paths start at surface points, or as camera rays.

    s, words : blocks, float32 and uint32; base : index of the block's first number
    where, toward, normal : (m, k, 3) float64; begin, at_surface : see `trace_paths`
    samples : number of samples per point in a pass; first : number of the pass's first sample
    """
    base = unsigned(base)
    m, n_positions = len(toward), toward.shape[1]
    for lane in range(BLOCK_WIDTH):
        if following + lane >= m * samples:
            s[base + ALIVE * _L + lane] = _f(0.0)
            continue
        # Give neighbouring lanes the same sample of neighbouring points.
        sample = (following + lane) // m
        i, k = unsigned(following + lane - sample * m), unsigned((first + sample) % n_positions)
        here = i if len(where) == m else 0
        there = k if where.shape[1] == n_positions else 0
        s[base + ALIVE * _L + lane] = _f(1.0)
        s[base + DENSITY * _L + lane] = s[base + COSINE * _L + lane] = _f(0.0)
        s[base + BOUNCES * _L + lane] = _f(0.0) if at_surface else _f(-1.0)
        s[base + POINT * _L + lane] = i
        words[base + KEY * _L + lane], words[base + SAMPLE * _L + lane] = begin + i, sample
        words[base + COUNT * _L + lane] = np.uint32(0)
        for a in range(3):
            s[base + (BETA + a) * _L + lane] = s[base + (ALBEDO + a) * _L + lane] = _f(1.0)
            s[base + (ORG_X + a) * _L + lane] = where[here, there, a]
            s[base + (DIR_X + a) * _L + lane] = s[base + (SHADED + a) * _L + lane] = toward[i, k, a]
            s[base + (NORMAL + a) * _L + lane] = normal[i, k, a]


@inner
def fetch_lanes(s, words, base, surface, material):
    """Copy the data of the triangles that the lanes' rays hit into the block: rows and base colours.

    s, words : blocks; surface : (T, 32), material : (M, 8) float32, see `Surfaces`
    """
    base = unsigned(base)
    for lane in range(BLOCK_WIDTH):
        if s[base + ALIVE * _L + lane] > _f(0.0):
            prim = np.int64(words[base + PRIM_ID * _L + lane])
            for c in range(TWO_SIDED + 1):
                s[base + (TRIANGLE + c) * _L + lane] = surface[prim, c]
            m = unsigned(surface[prim, MATERIAL])
            for c in range(3):
                s[base + (ALBEDO + c) * _L + lane] = material[m, BASE_COLOUR + c]


@inner
def choose_lights(s, words, base, lights, light):
    """Choose a light for each lane: write its number to `light` (8,) int64 and copy its row into the lane.

    s, words : blocks; lights : `LightTable`
    """
    base, row, cumulative = unsigned(base), lights.row, lights.cumulative
    for lane in range(BLOCK_WIDTH):
        choice, e = np.float64(words[base + CHOICE * _L + lane]) * _INV_2_32, 0
        if len(cumulative) > _FEW:
            e = pick_light(cumulative, choice)
        else:
            # Search linearly, without branches.
            for k in range(len(cumulative) - 1):
                e += 1 if cumulative[k] <= choice else 0
        light[lane] = e
    for lane in range(BLOCK_WIDTH):
        e = unsigned(light[lane])
        for c in range(ROW_COLUMNS):
            s[base + (LIGHT_ROW + c) * _L + lane] = row[e, c]


@inner
def turn_alone(path, row, lane, s, words, base, hemisphere, value):
    """Sample the next direction of one lane's path, or end the path; apply Russian roulette.

    path : (N_ROWS, 8), row : (5, 8) float64; s, words : blocks; value : (3,) float64, working memory
    hemisphere : `Estimator.hemisphere`
    """
    choice = np.float64(words[base + LOBE * _L + lane]) * _INV_2_32
    u = np.float64(s[base + U_DIRECTION * _L + lane]) - 1.0
    w = np.float64(s[base + W_DIRECTION * _L + lane]) - 1.0
    alive = scatter(path, row, lane, hemisphere, choice, u, w, value)
    survive = 1.0
    if alive and s[base + BOUNCES * _L + lane] >= _f(SURE):
        survive = min(max(path[PATH_BETA, lane], path[PATH_BETA + 1, lane], path[PATH_BETA + 2, lane]), MOST)
        alive = s[base + ROULETTE * _L + lane] - 1.0 < survive
    s[base + ALIVE * _L + lane] = _f(1.0) if alive else _f(0.0)
    cosine = 0.0
    for a in range(3):
        s[base + (BETA + a) * _L + lane] = path[PATH_BETA + a, lane] / survive
        s[base + (ORG_X + a) * _L + lane] = path[POSITION + a, lane]
        s[base + (DIR_X + a) * _L + lane] = path[GO + a, lane]
        cosine += path[GO + a, lane] * path[FRAME + 6 + a, lane]
    s[base + DENSITY * _L + lane] = path[PATH_DENSITY, lane]
    s[base + COSINE * _L + lane] = cosine


@inner
def aim_alone(path, row, lane, s, words, base, lights, mode, power, value, ray):
    """Choose a light and sample a ray to it from one lane's vertex, with `vertex.aim`.

    Writes the ray and its contribution to the block. Returns the light's number, or -1 if the contribution is
    0.

    path : (N_ROWS, 8), row : (5, 8) float64; s, words : blocks; lights : `LightTable`
    mode, power : `Estimator.aim` and `.power`
    value : (3,), ray : (6,) float64, outputs, see `vertex.aim`
    """
    choice = np.float64(words[base + CHOICE * _L + lane]) * _INV_2_32
    u, w = (
        np.float64(s[base + U_LIGHT * _L + lane]) - 1.0,
        np.float64(s[base + W_LIGHT * _L + lane]) - 1.0,
    )
    light = aim(path, row, lane, lights, mode, power, choice, u, w, value, ray)
    for a in range(3):
        s[base + (VALUE + a) * _L + lane] = value[a] if light >= 0 else 0.0
        s[base + (TO_LIGHT + a) * _L + lane] = ray[a]
        s[base + (ORG_X + a) * _L + lane] = path[POSITION + a, lane]
    (
        s[base + MAX_DISTANCE * _L + lane],
        s[base + B1 * _L + lane],
        s[base + B2 * _L + lane],
    ) = (
        ray[RAY_LENGTH],
        ray[RAY_B1],
        ray[RAY_B2],
    )
    return light


@kernel
def trace_paths(
    where, toward, normal, begin, at_surface, surfaces, lights, shading, memory, sobol_points, settings, out
):
    """Trace n paths for each of m points, add their light to `out`, and return the numbers of rays.

    where, toward, normal : (m, k, 3) float64, k starts for each point. If `at_surface` is true, a start is a
        position, a shading normal and a geometric normal. Else it is the origin and the direction of a ray,
        and `normal` is unused. Sample s of pass p uses start (p n + s) modulo k. With shape (1, 1, 3),
        `where` is the origin of all rays
    begin : number of the first point; random numbers depend on the number of the point
    surfaces : `Surfaces`; lights : `LightTable`; shading : `Shading`; memory : `PathMemory`
    sobol_points : (n, 2) uint32, bit-reversed Sobol points of the n samples of a pass
    settings : `PathSettings`
    out : (m, 3) float64, sums over the paths of each point; of radiance along the ray or, at a surface point,
        of E / pi, the radiance of a white Lambertian surface

    Returns
    -------
    tuple of int
        Number of closest-hit rays and number of shadow rays.
    """
    scene, intersect, occluded, blend = memory.scene, memory.intersect, memory.occluded, memory.blend
    on, s, words, bins = memory.on, memory.s, memory.words, memory.bins
    surface, material, min_offset_scale, lambertian = (
        surfaces.row,
        surfaces.material,
        surfaces.min_offset_scale,
        surfaces.lambertian,
    )
    emitter, triangle, sky, n_lights = lights.emitter, lights.triangle, lights.sky, len(lights.cumulative)
    # textured: whether emitters need texture or alpha lookups. painted: whether surfaces need lookups of
    # textures or vertex colours.
    textured = len(shading.alpha.slot) > 0 or lights.textured != 0
    painted = surfaces.painted != 0
    hemisphere, mode, strata, power = settings.hemisphere, settings.aim, settings.strata, settings.power
    max_bounces, number_of_pass, salt = settings.max_bounces, settings.number_of_pass, settings.salt
    lit = lights.cumulative[n_lights - 1] > 0.0
    path, row = _new_path(), _new_row()
    value, ray, rgba, light, filled = _new_value(), _new_ray(), _new_rgba(), _new_light(), _new_filled()
    samples, m, n_positions = len(sobol_points), toward.shape[0], toward.shape[1]
    total = m * samples
    following = rays = shadows = 0
    # Number of blocks in use, and index of the next block to shade. Shading starts after all blocks are
    # traced.
    blocks = block = 0
    traced = False
    while True:
        # Take the next traced block. If none is left, trace all blocks or start paths in a new block
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
            following = min(following + BLOCK_WIDTH, total)
            if not at_surface:
                continue
        vectorized = hemisphere != 1 and (lambertian != 0 or not met)
        any_vertex = not met
        if met:
            # Add emission at hits and the sky; end paths at the limit of bounces
            for lane in range(BLOCK_WIDTH):
                if s[base + ALIVE * _L + lane] == _f(0.0):
                    continue
                i = np.int64(s[base + POINT * _L + lane])
                if words[base + GEOM_ID * _L + lane] == NO_HIT:
                    see_sky(s, base, lane, sky, mode, power, value)
                    for c in range(3):
                        out[i, c] += value[c]
                    s[base + ALIVE * _L + lane] = _f(0.0)
                    continue
                prim = np.int64(words[base + PRIM_ID * _L + lane])
                if surface[prim, SHINES] > _f(0.0):
                    see_emitter(s, base, lane, surface, lights, prim, mode, power, value)
                    if surface[prim, SHINES] > _f(1.0):
                        u = np.float64(s[base + HIT_U * _L + lane])
                        v = np.float64(s[base + HIT_V * _L + lane])
                        multiply_emission_texture(shading, prim, u, v, value, rgba, False)
                    for c in range(3):
                        out[i, c] += value[c]
                s[base + BOUNCES * _L + lane] += _f(1.0)
                if max_bounces >= 0 and s[base + BOUNCES * _L + lane] > max_bounces:
                    s[base + ALIVE * _L + lane] = _f(0.0)
                any_vertex = any_vertex or s[base + ALIVE * _L + lane] > _f(0.0)
        if not any_vertex:
            continue
        # Draw random numbers
        random_lanes(words, base, number_of_pass, salt)
        if strata:
            spread_lanes(words, base, sobol_points, number_of_pass, salt)
        # Look up triangles, materials and textures
        if met and vectorized:
            fetch_lanes(s, words, base, surface, material)
        if met and (painted or not vectorized):
            for lane in range(BLOCK_WIDTH):
                if s[base + ALIVE * _L + lane] == _f(0.0):
                    continue
                prim = np.int64(words[base + PRIM_ID * _L + lane])
                u, v = (
                    np.float64(s[base + HIT_U * _L + lane]),
                    np.float64(s[base + HIT_V * _L + lane]),
                )
                if not vectorized:
                    for a in range(3):
                        path[GO + a, lane] = s[base + (DIR_X + a) * _L + lane]
                    if not arrive(
                        path, row, lane, surface, material, prim, u, v, min_offset_scale, lambertian
                    ):
                        s[base + ALIVE * _L + lane] = _f(0.0)
                        continue
                if surface[prim, TEXTURED] > _f(0.0):
                    if vectorized:
                        for c in range(3):
                            row[c, lane] = s[base + (ALBEDO + c) * _L + lane]
                        row[WIDTH, lane] = -1.0
                    paint(row, lane, shading, prim, u, v, material, rgba)
                    for c in range(3):
                        s[base + (ALBEDO + c) * _L + lane] = row[c, lane]
        # Set up vertices, and sample a ray to one light from each
        if vectorized:
            if met:
                arrive_lanes(s, base, _f(min_offset_scale))
            else:
                start_vertices(s, base, _f(min_offset_scale), _f(surfaces.default_size))
            if lit:
                choose_lights(s, words, base, lights, light)
                if len(lights.falloff) > 0:
                    look_up_falloff(s, base, lights, light)
                aim_at_lights(s, base, mode, power)
        else:
            for lane in range(BLOCK_WIDTH):
                light[lane] = -1
                if s[base + ALIVE * _L + lane] == _f(0.0):
                    continue
                if not met:
                    i, sample = (
                        np.int64(s[base + POINT * _L + lane]),
                        np.int64(words[base + SAMPLE * _L + lane]),
                    )
                    k = (number_of_pass * samples + sample) % n_positions
                    sizes = (min_offset_scale, surfaces.default_size)
                    start_path(path, row, lane, where[i, k], toward[i, k], normal[i, k], True, sizes)
                for c in range(3):
                    path[PATH_BETA + c, lane] = s[base + (BETA + c) * _L + lane]
                if lit:
                    light[lane] = aim_alone(
                        path, row, lane, s, words, base, lights, mode, power, value, ray,
                    )  # fmt: skip
        # Multiply by emission textures and alpha, and cast shadow rays
        if lit:
            if textured:
                for lane in range(BLOCK_WIDTH):
                    e = light[lane]
                    if s[base + ALIVE * _L + lane] > _f(0.0) and 0 <= e < len(emitter):
                        for c in range(3):
                            value[c] = s[base + (VALUE + c) * _L + lane]
                        u, v = (
                            np.float64(s[base + B1 * _L + lane]),
                            np.float64(s[base + B2 * _L + lane]),
                        )
                        u, v = on_whole_triangle(emitter, e, u, v)
                        multiply_emission_texture(shading, triangle[e], u, v, value, rgba, True)
                        for c in range(3):
                            s[base + (VALUE + c) * _L + lane] = value[c]
            shadows += cast_to_lights(s, base, light, n_lights, bins, filled, occluded, scene, blend, on, out)
        # Sample the next directions, with Russian roulette
        if vectorized:
            scatter_lanes(s, base)
        else:
            for lane in range(BLOCK_WIDTH):
                if s[base + ALIVE * _L + lane] > _f(0.0):
                    turn_alone(path, row, lane, s, words, base, hemisphere, value)
    # Cast the shadow rays of incomplete packets
    for k in range(BINS):
        if filled[k] > 0:
            cast_packet(bins, filled, k, occluded, scene, blend, on, out)
    return rays, shadows
