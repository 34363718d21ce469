# mypy: disable-error-code="no-untyped-def"
"""Traces paths bidirectionally: subpaths from lights and from the eye, with all connections between them.

The eye is a camera or a surface point. Each sample traces a subpath from a light and stores its vertices,
then traces a subpath from the eye. Every eye vertex is connected to a sampled light and to all stored
vertices. If the eye is a camera, the vertices of light subpaths are connected to its pinhole as well. The
light of a connection to the pinhole is a *splat*: it is added to the pixel in which the vertex is visible.
`bidirectional_weights` computes MIS weights.

A light subpath has at most `MAX_LIGHT_VERTICES` vertices, and the MIS weights include only techniques within
this limit. Eye subpaths end by Russian roulette.

Based on: Lafortune and Willems, Bi-directional path tracing, 1993; Veach and Guibas, Bidirectional estimators
for light transport, 1994; Dutre, Lafortune and Willems, Monte Carlo light tracing with direct computation of
pixel intensities, 1993.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.emitters import emitter_at
from baker.kernels.transmittance import trace_shadow_packet, trace_transmittance_packet, transmittance
from baker.pathtracer.bidirectional_lights import (
    aim_both_ways,
    fade,
    meet_emitter,
    meet_sky,
    range_of_light,
    start_at_light,
)
from baker.pathtracer.bidirectional_weights import (
    BACK,
    CHAIN,
    MAX_LIGHT_VERTICES,
    N_ROWS_BOTH,
    OPEN,
    leave_vertex,
    meet,
    pixel_density,
    pixel_of,
    reach_vertex,
    towards_eye,
    towards_light,
)
from baker.pathtracer.bsdf import N_PARAMETERS, bsdf_sample
from baker.pathtracer.camera import EYE
from baker.pathtracer.emitters import EMITTER_TEXTURED
from baker.pathtracer.light_table import SHORT, on_whole_triangle
from baker.pathtracer.rng import draw, path_state, stratum
from baker.pathtracer.scene import EMITTER, SHINES, TEXTURED
from baker.pathtracer.vertex import (
    BETA,
    BOUNCES,
    COLLECTED,
    DENSITY,
    FRAME,
    GO,
    GRAZE,
    MOST,
    NORMAL,
    POSITION,
    RAY_B1,
    RAY_B2,
    RAY_LENGTH,
    SHADED,
    SURE,
    TO,
    arrive,
    multiply_emission_texture,
    paint,
    start_path,
)
from baker.trace.jit import inner, kernel, scratch
from baker.trace.packets import GEOM_ID, HIT_U, HIT_V, MAX_WIDTH, NO_HIT, PRIM_ID, TFAR, set_ray, trace

# Stages of a lane: without a subpath; waiting for its ray to be traced; at a vertex.
_IDLE, _RAY, _VERTEX = 0, 1, 2
# Stack arrays of `trace_both_ways`. Stored vertex i of a lane is column i * MAX_WIDTH + lane.
_new_path, _new_kept = (scratch((N_ROWS_BOTH, n * MAX_WIDTH), np.float64) for n in (1, MAX_LIGHT_VERTICES))
_new_row, _new_kept_row = (
    scratch((N_PARAMETERS, n * MAX_WIDTH), np.float64) for n in (1, MAX_LIGHT_VERTICES)
)
_new_numbers, _new_state, _new_flags, _new_first = (
    scratch((MAX_WIDTH,), kind) for kind in (np.int64, np.uint64, np.bool_, np.float64)
)
_new_value, _new_rgba, _new_ray, _new_spot = (scratch((n,), np.float64) for n in (3, 4, 6, 2))
_new_values = scratch((3, MAX_WIDTH), np.float64)


@inner
def start_at_eye(path, row, lane, where, toward, normal, camera, n_subpaths, sizes):
    """Start an eye subpath at a white surface point or, if n_subpaths > 0, at a camera.

    path : (N_ROWS_BOTH, n) float64; row : (5, n) float64
    where, toward, normal, sizes : see `start_path`; camera, n_subpaths : see `trace_both_ways`
    """
    at_surface = n_subpaths == 0.0
    start_path(path, row, lane, where, toward, normal, at_surface, sizes)
    for r in range(BACK, N_ROWS_BOTH):
        path[r, lane] = 0.0
    if at_surface:
        for a in range(3):
            path[SHADED + a, lane] = toward[a]
            path[BACK + a, lane] = toward[a]
    else:
        path[DENSITY, lane] = pixel_density(camera, toward)
        path[OPEN, lane] = n_subpaths


@inner
def scatter_both(path, row, lane, eye, choice, u, w, value, spare):
    """Sample the next direction of a subpath, and update its throughput and MIS sums.

    Returns False if the subpath ends.

    path : (N_ROWS_BOTH, n) float64; row : (5, n) float64; eye : whether the subpath started at the eye
    choice, u, w : random numbers in [0, 1), see `bsdf_sample`; value, spare : (3,) float64, working memory
    """
    lx, ly, lz, density, smooth = bsdf_sample(
        row, lane, path[TO, lane], path[TO + 1, lane], path[TO + 2, lane], choice, u, w, value
    )
    dx = lx * path[FRAME, lane] + ly * path[FRAME + 3, lane] + lz * path[FRAME + 6, lane]
    dy = lx * path[FRAME + 1, lane] + ly * path[FRAME + 4, lane] + lz * path[FRAME + 7, lane]
    dz = lx * path[FRAME + 2, lane] + ly * path[FRAME + 5, lane] + lz * path[FRAME + 8, lane]
    above = dx * path[NORMAL, lane] + dy * path[NORMAL + 1, lane] + dz * path[NORMAL + 2, lane]
    if above <= 0.0 or (density <= 0.0 and not smooth):
        return False
    bx, by, bz = path[BACK, lane], path[BACK + 1, lane], path[BACK + 2, lane]
    if smooth:
        density = reverse = 1.0
        shaded = bx * path[SHADED, lane] + by * path[SHADED + 1, lane] + bz * path[SHADED + 2, lane]
        if shaded <= GRAZE:
            # `vertex.arrive` replaced the shading normal for this view direction by the geometric normal. A
            # subpath from the other end would use another normal, so it cannot sample this reflection.
            if not eye:
                return False
            reverse = 0.0
        if not eye:
            back = bx * path[NORMAL, lane] + by * path[NORMAL + 1, lane] + bz * path[NORMAL + 2, lane]
            for c in range(3):
                value[c] *= above / max(back, 1.0e-12)
    elif eye:
        _, reverse = meet(path, row, lane, bx, by, bz, dx, dy, dz, spare)
    else:
        reverse, _ = meet(path, row, lane, dx, dy, dz, bx, by, bz, value)
        for c in range(3):
            value[c] *= above / density
    path[GO, lane], path[GO + 1, lane], path[GO + 2, lane] = dx, dy, dz
    leave_vertex(path, lane, density, reverse, smooth, MAX_LIGHT_VERTICES if eye else 1)
    most = 0.0
    for c in range(3):
        path[BETA + c, lane] *= value[c]
        most = max(most, path[BETA + c, lane])
    return most > 0.0


@inner
def connect(path, row, lane, kept, kept_row, k, s, value, spare, ray):
    """Connect the end of an eye subpath to the stored vertex in column k; return False if no light arrives.

    path, kept : (N_ROWS_BOTH, n) float64, the eye subpath and the stored vertices
    row, kept_row : (5, n) float64, BSDF parameters of the vertices of `path` and `kept`
    s : number of vertices of the light subpath up to the stored vertex
    value : (3,) float64, output, MIS-weighted light if nothing blocks the connection
    spare : (3,) float64, working memory
    ray : (6,) float64, output: unit direction, length in metres, 2 unused
    """
    dx = kept[POSITION, k] - path[POSITION, lane]
    dy = kept[POSITION + 1, k] - path[POSITION + 1, lane]
    dz = kept[POSITION + 2, k] - path[POSITION + 2, lane]
    square = dx * dx + dy * dy + dz * dz
    if square <= 0.0:
        return False
    length = math.sqrt(square)
    dx, dy, dz = dx / length, dy / length, dz / length
    here = dx * path[NORMAL, lane] + dy * path[NORMAL + 1, lane] + dz * path[NORMAL + 2, lane]
    there = -(dx * kept[NORMAL, k] + dy * kept[NORMAL + 1, k] + dz * kept[NORMAL + 2, k])
    if here <= 0.0 or there <= 0.0:
        return False
    eye_here, light_here = meet(
        path, row, lane, path[BACK, lane], path[BACK + 1, lane], path[BACK + 2, lane], dx, dy, dz, value
    )
    eye_there, light_there = meet(
        kept, kept_row, k, -dx, -dy, -dz, kept[BACK, k], kept[BACK + 1, k], kept[BACK + 2, k], spare
    )
    less = towards_light(kept, k, eye_here * there / square, eye_there)
    more = towards_eye(path, lane, light_there * here / square, light_here, MAX_LIGHT_VERTICES - s)
    scale = here * there / (square * (1.0 + less + more))
    total = 0.0
    for c in range(3):
        value[c] *= path[BETA + c, lane] * kept[BETA + c, k] * spare[c] * scale
        total += value[c]
    ray[0], ray[1], ray[2], ray[RAY_LENGTH] = dx, dy, dz, length * SHORT
    return total > 0.0


@inner
def show(path, row, lane, camera, n_subpaths, value, ray):
    """Connect the end of a light subpath to the camera; return its pixel, or -1 outside the picture.

    path : (N_ROWS_BOTH, n) float64; row : (5, n) float64; camera, n_subpaths : see `trace_both_ways`
    value : (3,) float64, output, MIS-weighted splat if nothing blocks the connection, divided by `n_subpaths`
    ray : (6,) float64, output, from the vertex to the camera, see `connect`
    """
    for a in range(3):
        ray[a] = path[POSITION + a, lane] - camera[EYE + a]
    square = ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]
    if square <= 0.0:
        return -1
    length = math.sqrt(square)
    for a in range(3):
        ray[a] /= length
    pixel = pixel_of(camera, ray)
    cosine = -(
        ray[0] * path[NORMAL, lane] + ray[1] * path[NORMAL + 1, lane] + ray[2] * path[NORMAL + 2, lane]
    )
    if pixel < 0 or cosine <= 0.0:
        return -1
    density = pixel_density(camera, ray) * cosine / square
    ray[0], ray[1], ray[2], ray[RAY_LENGTH] = -ray[0], -ray[1], -ray[2], length * SHORT
    reverse, _ = meet(
        path, row, lane, ray[0], ray[1], ray[2], path[BACK, lane], path[BACK + 1, lane], path[BACK + 2, lane],
        value,
    )  # fmt: skip
    less = towards_light(path, lane, density, reverse) / n_subpaths
    total = 0.0
    for c in range(3):
        value[c] *= path[BETA + c, lane] * density / (n_subpaths * (1.0 + less))
        total += value[c]
    return pixel if total > 0.0 else -1


@kernel
def trace_both_ways(
    where, toward, normal, begin, camera, n_subpaths, surfaces, lights, shading, sphere, buffers,
    sobol_points, settings, out, splat_pixel, splat,
):  # fmt: skip
    """Trace n bidirectional samples for each of m points or pixels, and add their light to `out` and `splat`.

    where, toward, normal, begin, surfaces, lights, shading, sobol_points, settings, out : see `trace_paths`
    buffers : `PacketBuffers`
    camera : (15,) float64, from `camera.camera_columns`; unused if paths start at surface points
    n_subpaths : float, number of pixels of the picture. As each sample of each pixel traces a light subpath,
        it is also the number of light subpaths per sample. 0 if paths start at surface points
    sphere : (4,) float64, `Reference.sphere`
    splat_pixel : (q,) int64, output, number of the pixel of each splat, which may be outside this tile
    splat : (q, 3) float64, output, light of each splat, in the unit of `out`. With a camera, q must be at
        least m n (`MAX_LIGHT_VERTICES` - 1)

    Returns
    -------
    tuple of int
        Numbers of closest-hit rays, shadow rays and splats.
    """
    width, scene, intersect, occluded = buffers.width, buffers.scene, buffers.intersect, buffers.occluded
    valid, floats, words = buffers.valid, buffers.floats, buffers.words
    surface, material, min_offset_scale, lambertian = (
        surfaces.row,
        surfaces.material,
        surfaces.min_offset_scale,
        surfaces.lambertian,
    )
    sizes = (min_offset_scale, surfaces.default_size)
    emitter, triangle = lights.emitter, lights.triangle
    alpha = len(shading.alpha.slot) > 0
    strata, max_bounces = settings.strata, settings.max_bounces
    seed, number_of_pass = settings.seed, settings.number_of_pass
    # Largest number of vertices of a light subpath within the limit of bounces.
    most_kept = MAX_LIGHT_VERTICES
    if max_bounces >= 0:
        most_kept = min(MAX_LIGHT_VERTICES, max_bounces + (2 if n_subpaths > 0.0 else 1))
    lit = lights.cumulative[len(lights.cumulative) - 1] > 0.0
    path, row, kept, kept_row = _new_path(), _new_row(), _new_kept(), _new_kept_row()
    # For each lane, number of vertices of its light subpath, including the vertex on the light.
    count = _new_numbers()
    # For each lane: whether it traces an eye subpath; the largest component of the throughput at the start of
    # its light subpath; 1 / range^2 of the light at which the light subpath starts.
    eye, first, inverse_range = _new_flags(), _new_first(), _new_first()
    value, spare, ray, rgba, spot = _new_value(), _new_value(), _new_ray(), _new_rgba(), _new_spot()
    values, state = _new_values(), _new_state()
    pixel, stage, job = _new_numbers(), _new_numbers(), _new_numbers()
    for lane in range(MAX_WIDTH):
        job[lane] = -1
    samples, m, n_positions = len(sobol_points), where.shape[0], where.shape[1]
    following = rays = shadows = splats = 0
    while True:
        # Start subpaths in idle lanes, and write the rays of all lanes at stage _RAY
        any_ray = any_path = False
        for lane in range(width):
            if stage[lane] == _IDLE and following < m * samples:
                i, s = following % m, following // m
                job[lane] = following
                following += 1
                state[lane] = path_state(seed, number_of_pass, begin + i, s)
                count[lane] = 1
                eye[lane] = True
                if lit and most_kept > 1:
                    choice, u, w = draw(state, lane), draw(state, lane), draw(state, lane)
                    a, b = draw(state, lane), draw(state, lane)
                    light = start_at_light(
                        path, lane, lights, sphere, min_offset_scale, choice, u, w, a, b, spot
                    )
                    if light < len(emitter) and (alpha or emitter[light, EMITTER_TEXTURED] > 0.0):
                        for c in range(3):
                            value[c] = path[BETA + c, lane]
                        u, v = on_whole_triangle(emitter, light, spot[0], spot[1])
                        multiply_emission_texture(shading, triangle[light], u, v, value, rgba, True)
                        for c in range(3):
                            path[BETA + c, lane] = value[c]
                    inverse_range[lane] = range_of_light(lights, light)
                    first[lane] = max(path[BETA, lane], path[BETA + 1, lane], path[BETA + 2, lane])
                    if first[lane] > 0.0:
                        eye[lane] = False
                        stage[lane] = _RAY
                if eye[lane]:
                    k = (number_of_pass * samples + s) % n_positions
                    start_at_eye(
                        path, row, lane, where[i, k], toward[i, k], normal[i, k], camera, n_subpaths, sizes
                    )
                    stage[lane] = _VERTEX if n_subpaths == 0.0 else _RAY
            any_path = any_path or stage[lane] != _IDLE
            valid[lane] = 0
            if stage[lane] == _RAY:
                set_ray(
                    floats, words, width, lane,
                    path[POSITION, lane], path[POSITION + 1, lane], path[POSITION + 2, lane],
                    path[GO, lane], path[GO + 1, lane], path[GO + 2, lane], np.float32(1.0e30),
                )  # fmt: skip
                valid[lane] = -1
                any_ray = True
                rays += 1
        if not any_path:
            break
        # Trace the rays
        if any_ray:
            trace(intersect, scene, valid, floats)
            trace_transmittance_packet(buffers.blend, occluded, width, valid, floats, True)
            for lane in range(width):
                if stage[lane] == _RAY:
                    for c in range(3):
                        path[BETA + c, lane] *= transmittance(buffers.blend, c, lane)
        # Set up vertices at hits, add emission to eye subpaths, and store vertices of light subpaths
        for lane in range(width):
            if stage[lane] != _RAY:
                continue
            alive = words[GEOM_ID * width + lane] != NO_HIT
            seen = n_subpaths > 0.0 and path[BOUNCES, lane] < 0.0
            if alive:
                prim = np.int64(words[PRIM_ID * width + lane])
                u = np.float64(floats[HIT_U * width + lane])
                v = np.float64(floats[HIT_V * width + lane])
                alive = arrive(path, row, lane, surface, material, prim, u, v, min_offset_scale, lambertian)
                if alive and not eye[lane] and count[lane] == 1 and inverse_range[lane] > 0.0:
                    distance = np.float64(floats[TFAR * width + lane])
                    alive = fade(path, lane, distance, inverse_range[lane])
                if alive:
                    reach_vertex(
                        path, lane, np.float64(floats[TFAR * width + lane]),
                        MAX_LIGHT_VERTICES if eye[lane] else 1,
                    )  # fmt: skip
                    if eye[lane] and surface[prim, SHINES] > 0.0:
                        e = emitter_at(
                            lights.node, np.int64(surface[prim, EMITTER]),
                            floats[HIT_U * width + lane], floats[HIT_V * width + lane],
                        )  # fmt: skip
                        meet_emitter(path, lane, surface, prim, emitter, e, seen, value)
                        if surface[prim, SHINES] > 1.0:
                            multiply_emission_texture(shading, prim, u, v, value, rgba, False)
                        for c in range(3):
                            path[COLLECTED + c, lane] += value[c]
                    if surface[prim, TEXTURED] > 0.0:
                        paint(row, lane, shading, prim, u, v, material, rgba)
            elif eye[lane]:
                meet_sky(path, lane, lights.sky, sphere, seen, value)
                for c in range(3):
                    path[COLLECTED + c, lane] += value[c]
            if eye[lane]:
                path[BOUNCES, lane] += 1.0
                alive = alive and not (max_bounces >= 0 and path[BOUNCES, lane] > max_bounces)
            elif alive:
                k = count[lane] * MAX_WIDTH + lane
                count[lane] += 1
                for r in range(CHAIN + 1):
                    kept[r, k] = path[r, lane]
                for r in range(N_PARAMETERS):
                    kept_row[r, k] = row[r, lane]
            stage[lane] = _VERTEX if alive else _IDLE
        # Trace connections. Step 0 connects eye subpaths to sampled lights, and light subpaths to the camera.
        # Step i connects eye subpaths to their stored vertex i
        step = 0
        while step < MAX_LIGHT_VERTICES:
            any_shadow = more = False
            for lane in range(width):
                valid[lane] = 0
                if stage[lane] != _VERTEX:
                    continue
                found = False
                if not eye[lane]:
                    if step == 0 and n_subpaths > 0.0:
                        pixel[lane] = show(path, row, lane, camera, n_subpaths, value, ray)
                        found = pixel[lane] >= 0
                elif step == 0:
                    more = more or count[lane] > 1
                    if lit:
                        choice, u, w = draw(state, lane), draw(state, lane), draw(state, lane)
                        if strata and path[BOUNCES, lane] == 0.0:
                            u, w = stratum(
                                sobol_points, job[lane] // m, begin + job[lane] % m, seed, number_of_pass, 0
                            )
                        light = aim_both_ways(path, row, lane, lights, sphere, choice, u, w, value, ray)
                        if 0 <= light < len(emitter) and (alpha or emitter[light, EMITTER_TEXTURED] > 0.0):
                            u, v = on_whole_triangle(emitter, light, ray[RAY_B1], ray[RAY_B2])
                            multiply_emission_texture(shading, triangle[light], u, v, value, rgba, True)
                        found = light >= 0
                elif step < count[lane]:
                    more = more or step + 1 < count[lane]
                    if max_bounces < 0 or step + path[BOUNCES, lane] <= max_bounces:
                        k = step * MAX_WIDTH + lane
                        found = connect(path, row, lane, kept, kept_row, k, step + 1, value, spare, ray)
                if found:
                    set_ray(
                        floats, words, width, lane,
                        path[POSITION, lane], path[POSITION + 1, lane], path[POSITION + 2, lane],
                        ray[0], ray[1], ray[2], np.float32(ray[RAY_LENGTH]),
                    )  # fmt: skip
                    valid[lane] = -1
                    any_shadow = True
                    shadows += 1
                    for c in range(3):
                        values[c, lane] = value[c]
            if any_shadow:
                trace_shadow_packet(buffers.blend, occluded, scene, width, valid, floats)
                for lane in range(width):
                    if valid[lane] == 0 or floats[TFAR * width + lane] < np.float32(0.0):
                        continue
                    if eye[lane]:
                        for c in range(3):
                            path[COLLECTED + c, lane] += values[c, lane] * transmittance(
                                buffers.blend, c, lane
                            )
                    else:
                        splat_pixel[splats] = pixel[lane]
                        for c in range(3):
                            splat[splats, c] = values[c, lane] * transmittance(buffers.blend, c, lane)
                        splats += 1
            if not more:
                break
            step += 1
        # Sample the next directions, with Russian roulette. Add the light of ended eye subpaths to the sums,
        # and start eye subpaths after ended light subpaths
        for lane in range(width):
            alive = stage[lane] == _VERTEX
            if alive and not eye[lane]:
                alive = count[lane] < most_kept
            if alive:
                choice, u, w = draw(state, lane), draw(state, lane), draw(state, lane)
                if eye[lane] and strata and path[BOUNCES, lane] == 0.0:
                    u, w = stratum(
                        sobol_points, job[lane] // m, begin + job[lane] % m, seed, number_of_pass, 1
                    )
                alive = scatter_both(path, row, lane, eye[lane], choice, u, w, value, spare)
                length = path[BOUNCES, lane] if eye[lane] else np.float64(count[lane] - 1)
                if alive and length >= SURE:
                    survive = max(path[BETA, lane], path[BETA + 1, lane], path[BETA + 2, lane])
                    survive = min(survive if eye[lane] else survive / first[lane], MOST)
                    alive = draw(state, lane) < survive
                    for c in range(3):
                        path[BETA + c, lane] /= survive
                stage[lane] = _RAY if alive else _IDLE
            if alive or job[lane] < 0:
                continue
            if eye[lane]:
                for c in range(3):
                    out[job[lane] % m, c] += path[COLLECTED + c, lane]
                job[lane] = -1
                stage[lane] = _IDLE
            else:
                i, s = job[lane] % m, job[lane] // m
                k = (number_of_pass * samples + s) % n_positions
                start_at_eye(
                    path, row, lane, where[i, k], toward[i, k], normal[i, k], camera, n_subpaths, sizes
                )
                eye[lane] = True
                stage[lane] = _VERTEX if n_subpaths == 0.0 else _RAY
    return rays, shadows, splats
