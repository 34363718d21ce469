# mypy: disable-error-code="no-untyped-def"
"""Computes irradiance and ambient occlusion of texels for the final gather, from n rays of each texel.

    E_indirect = (pi / n) sum (B / pi)    B: radiosity of the texel at the ray's hit, without emission
    E_sky      = (pi / n) sum L_sky       over rays that leave the scene; L_sky: radiance
    E_emitted  = sum of MIS-weighted hits of emitters for which `area_light` did not use the closed form
    AO         = share of rays without a hit within a distance

The sums are over the n rays of a texel, whose directions are cosine-weighted.

Based on: Reichert, A two-pass radiosity method driven by lights and viewer position, 1992;
Christensen, Faster photon map global illumination, 1999.
"""

from __future__ import annotations

import numpy as np

from baker.kernels.emitters import CLUSTER, RADIANCE, TEXTURED, emitted_radiance, emitter_at
from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_frame, new_seeds
from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import (
    any_stopped,
    gather_turns,
    trace_gather,
    trace_gather_transmittance,
    transmittance,
)
from baker.kernels.triangle_lookup import EMITTER, front_facing, hit_pixel
from baker.radiosity.kernels.area_light import emitter_hit
from baker.radiosity.kernels.side_table import SIDE_ROW, find_side, new_hits, note_hit
from baker.trace.jit import inner, kernel, scratch, smaller
from baker.trace.packets import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    GEOM_ID,
    HIT_U,
    HIT_V,
    NO_HIT,
    PACKET_WIDTH,
    PRIM_ID,
    TFAR,
    trace_lanes,
)  # fmt: skip

_f = np.float32
# Columns of `out`:
#
#     INDIRECT   irradiance from light that texels reflect (3)
#     DIRECT     irradiance from the sky and from emitters (3)
#     OPEN       ambient occlusion
#     SQUARE     sum of x^2 over the 16 points, where x = R + G + B of the irradiance that a point contributes
INDIRECT, DIRECT, OPEN, SQUARE = 0, 3, 6, 7
N_COLUMNS = 8
# Number of rows of `part` and `total`: INDIRECT to OPEN.
_SUMS = 7
# Working memory of the kernels.
_parts, _floats = scratch((_SUMS * PACKET_WIDTH,), np.float32), scratch((PACKET_WIDTH,), np.float32)
_totals, _doubles = scratch((_SUMS * PACKET_WIDTH,), np.float64), scratch((PACKET_WIDTH,), np.float64)
_numbers, _counts = scratch((PACKET_WIDTH,), np.int64), scratch((PACKET_WIDTH,), np.int32)
_rgba = scratch((4,), np.float64)


@kernel
def gather(
    origin, normal, lookup, seen, emitters, shading, buffers, begin, sobol_points, shared, sky, limits,
    analytic, out,
):  # fmt: skip
    """Write irradiance and ambient occlusion of m texels from hemisphere rays; return how many were cast.

    origin, normal : (m, 16, 3) float32, metres and unit vectors, world; points of m texels
    lookup : TriangleLookup; seen : SeenLight, light that texels reflect
    emitters : TileEmitters; shading : Shading or None, from `kernels.emitters.needed_shading`
    buffers : PacketBuffers; begin : number of the first texel, which seeds the random numbers
    sobol_points : (n, 2) uint32, one row per ray; shared : uint32, from `kernels.sampling.shared_bits_mask`
    sky : (3,) float32, radiance, cd/m2
    limits : (2,) float64, AO distance in metres, and number of shadow rays for the MIS weights
    analytic : (m,) uint8, 1 for texels whose light from emitters has a closed form; their rays add only the
        light of emitters in `TileEmitters.apart`
    out : (m, 8) float32 output, columns INDIRECT, DIRECT, OPEN and SQUARE; irradiance in lx
    """
    n_samples = len(sobol_points)
    scene, intersect, width = buffers.scene, buffers.intersect, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row, size, n_pixels = lookup.row, lookup.size, lookup.n_pixels
    emitter_row, chance, cumulative, node = emitters.row, emitters.chance, emitters.cumulative, emitters.node
    apart = emitters.apart
    some_apart = False
    for c in range(len(apart)):
        some_apart = some_apart or apart[c] != 0
    radiance = _rgba()
    # Sum over the rays of one point in float32, and over all points in float64.
    part, missed = _parts(), _floats()
    total, squares = _totals(), _doubles()
    pixel = _numbers()
    exitance, of_side = seen.image, seen.value
    side_point, side_normal, side_height = seen.sides.point, seen.sides.normal, seen.sides.height
    side_member, side_length = seen.sides.member, seen.sides.side
    hits, split = new_hits(), _counts()
    seeds, frame = new_seeds(), new_frame()
    distance = _f(limits[0])
    # The sums are of radiance, and at the end they are multiplied by pi / n. Radiosity divided by pi is
    # radiance. Radiance times `emitter_hit` is irradiance already, so it is multiplied by n / pi.
    inverse_pi = _f(1.0 / np.pi)
    lit = len(exitance) > 0
    whole = n_samples / np.pi
    turns, opened = gather_turns(buffers.blend), _f(1.0)
    cast = 0
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin) - group)
        lane_seeds(begin + group, lanes, 25, seeds)
        for lane in range(PACKET_WIDTH):
            on[lane] = -1 if lane < lanes else 0
            squares[lane] = 0.0
        for j in range(_SUMS * PACKET_WIDTH):
            total[j] = 0.0
        stopped = True
        for step in range(n_samples * turns):
            s, turn = step // turns, step % turns
            # Start a batch of rays with the next point of each texel.
            k = s * N_POINTS // n_samples
            if turn == 0 and (s == 0 or k != (s - 1) * N_POINTS // n_samples):
                load_frames(rays, frame, origin, normal, group, lanes, k)
                for j in range(_SUMS * PACKET_WIDTH):
                    part[j] = _f(0.0)
                for lane in range(PACKET_WIDTH):
                    missed[lane] = _f(0.0)
            # Trace one ray of each texel. In a scene with BLEND surfaces, it is traced twice, see
            # `trace_gather`. If no ray of turn 0 stops at a BLEND surface, turn 1 reuses the hits of turn 0.
            if turn == 0 or stopped:
                cast += lanes
                aim_lanes(rays, words, frame, seeds, sobol_points[s, 0], sobol_points[s, 1], shared, FAR)
                trace_gather(
                    buffers.blend, turn, intersect, scene, width, query, on, rays, words, spare_on, spare
                )
            if turn == 0:
                # Use the rays of turn 0 for AO: BLEND surfaces stop them with probability alpha.
                opened = _f(1.0)
                stopped = any_stopped(buffers.blend, words)
                if not stopped:
                    continue
            trace_gather_transmittance(
                buffers.blend, turn, buffers.occluded, width, on, rays, words, spare_on, spare
            )
            # Count the rays that leave the scene, and the rays without a hit within the AO distance.
            for lane in range(PACKET_WIDTH):
                none = words[GEOM_ID * PACKET_WIDTH + lane] == NO_HIT
                missed[lane] += _f(1.0) if none else _f(0.0)
                free = none or rays[TFAR * PACKET_WIDTH + lane] > distance
                part[OPEN * PACKET_WIDTH + lane] += opened if free else _f(0.0)
            opened = _f(0.0)
            _add_coloured_sky(buffers.blend, words, sky, missed, part)
            # Find the pixel of each hit, and add the light of emitters. A separate loop below reads the
            # radiosity of the pixels, so that cache misses overlap.
            for lane in range(lanes):
                pixel[lane] = -1
                if words[GEOM_ID * PACKET_WIDTH + lane] == NO_HIT:
                    continue
                prim = np.int64(words[PRIM_ID * PACKET_WIDTH + lane])
                dx, dy, dz = (
                    rays[DIR_X * PACKET_WIDTH + lane],
                    rays[DIR_Y * PACKET_WIDTH + lane],
                    rays[DIR_Z * PACKET_WIDTH + lane],
                )
                hit_u, hit_v = rays[HIT_U * PACKET_WIDTH + lane], rays[HIT_V * PACKET_WIDTH + lane]
                i = group + lane
                m = np.int64(row[prim, EMITTER])
                if m < -1 and (analytic[i] == 0 or some_apart):
                    m = emitter_at(node, m, hit_u, hit_v)
                if m >= 0 and (analytic[i] == 0 or apart[np.int64(emitter_row[m, CLUSTER])] != 0):
                    weight = whole * emitter_hit(
                        row, emitter_row, chance, cumulative, prim, m, (dx, dy, dz),
                        (normal[i, k, 0], normal[i, k, 1], normal[i, k, 2]), rays[TFAR * PACKET_WIDTH + lane],
                        limits[1], n_samples,
                    )  # fmt: skip
                    if weight > 0.0:
                        for c in range(3):
                            radiance[c] = emitter_row[m, RADIANCE + c]
                        if shading is not None and emitter_row[m, TEXTURED] > _f(0.0):
                            emitted_radiance(shading, prim, hit_u, hit_v, radiance)
                        for c in range(3):
                            kept = transmittance(buffers.blend, c, lane)
                            part[(DIRECT + c) * PACKET_WIDTH + lane] += _f(radiance[c] * weight) * kept
                front = front_facing(row, prim, dx, dy, dz)
                pixel[lane] = hit_pixel(row, size, n_pixels, prim, hit_u, hit_v, front)
            if lit:
                # Add the light that the texels reflect; store hits on split texels for the next step.
                n_split = 0
                for lane in range(lanes):
                    p = pixel[lane]
                    if p >= 0:
                        if exitance[p, SIDE_ROW] > _f(0.0):
                            prim = np.int64(words[PRIM_ID * PACKET_WIDTH + lane])
                            dx, dy, dz = (
                                rays[DIR_X * PACKET_WIDTH + lane],
                                rays[DIR_Y * PACKET_WIDTH + lane],
                                rays[DIR_Z * PACKET_WIDTH + lane],
                            )
                            note_hit(hits, lane, rays, row, prim, front_facing(row, prim, dx, dy, dz))
                            split[n_split] = lane
                            n_split += 1
                            continue
                        blend = buffers.blend
                        part[lane] += exitance[p, 0] * inverse_pi * transmittance(blend, 0, lane)
                        part[PACKET_WIDTH + lane] += (
                            exitance[p, 1] * inverse_pi * transmittance(blend, 1, lane)
                        )
                        part[2 * PACKET_WIDTH + lane] += (
                            exitance[p, 2] * inverse_pi * transmittance(blend, 2, lane)
                        )
                # Find the side of each hit on a split texel. `find_side` overwrites the packet.
                for j in range(n_split):
                    lane = int(split[j])
                    at = np.int64(exitance[pixel[lane], SIDE_ROW]) - 1
                    found = find_side(
                        side_point, side_normal, side_height, side_member, side_length,
                        at, hits, lane, buffers,
                    )  # fmt: skip
                    if found >= 0:
                        for c in range(3):
                            kept = transmittance(buffers.blend, c, lane)
                            part[c * PACKET_WIDTH + lane] += of_side[found, c] * inverse_pi * kept
                if n_split > 0:
                    for lane in range(PACKET_WIDTH):
                        on[lane] = -1 if lane < lanes else 0
            # End a batch: add the sky to the sums of the batch, and these sums to the totals.
            if turn + 1 == turns and (s + 1) * N_POINTS // n_samples != k:
                for lane in range(PACKET_WIDTH):
                    for c in range(3):
                        part[(DIRECT + c) * PACKET_WIDTH + lane] += missed[lane] * sky[c]
                    now = 0.0
                    for c in range(6):
                        now += part[c * PACKET_WIDTH + lane]
                    squares[lane] += now * now
                    for c in range(_SUMS):
                        total[c * PACKET_WIDTH + lane] += part[c * PACKET_WIDTH + lane]
        # Write the means.
        scale = np.pi / n_samples
        for lane in range(lanes):
            i = group + lane
            for c in range(6):
                out[i, c] = total[c * PACKET_WIDTH + lane] * scale
            out[i, OPEN] = total[OPEN * PACKET_WIDTH + lane] / n_samples
            out[i, SQUARE] = squares[lane] * scale * scale
    return cast


@inner
def _add_coloured_sky(blend, words, sky, missed, part):
    """Add the sky's light along rays through BLEND surfaces, and do not count these rays in `missed`.

    blend : `PacketBuffers.blend`; words : (21 * 16,) uint32, the packet; sky : (3,) float32, cd/m2
    missed : (16,) float32, number of rays without a hit; part : (7 * 16,) float32, sums, see `gather`
    """
    if blend is None:
        return
    for lane in range(PACKET_WIDTH):
        if words[GEOM_ID * PACKET_WIDTH + lane] != NO_HIT:
            continue
        red, green, blue = (
            transmittance(blend, 0, lane), transmittance(blend, 1, lane), transmittance(blend, 2, lane)
        )  # fmt: skip
        if red != _f(1.0) or green != _f(1.0) or blue != _f(1.0):
            missed[lane] -= _f(1.0)
            part[DIRECT * PACKET_WIDTH + lane] += red * sky[0]
            part[(DIRECT + 1) * PACKET_WIDTH + lane] += green * sky[1]
            part[(DIRECT + 2) * PACKET_WIDTH + lane] += blue * sky[2]


@kernel
def estimate_occlusion(origin, normal, buffers, begin, sobol_points, shared, distance, early_out, out):
    """Write the ambient occlusion of m texels (1 is unoccluded); return the number of rays cast.

    origin, normal : (m, 16, 3) float32, metres and unit vectors, world; points of the texels
    buffers : PacketBuffers, without transmittance
    begin : number of the first texel, which seeds the random numbers and is the index in `out`
    sobol_points : (n, 2) uint32, one row per ray; shared : uint32, from `kernels.sampling.shared_bits_mask`
    distance : float32, length of the rays, metres
    early_out : number of rays per texel after which a group of sixteen texels ends early if each of its
        texels had at most one blocked ray; 0: groups never end early
    out : (n_entries,) float32 output; items begin to begin + m - 1 are written
    """
    n_samples = len(sobol_points)
    scene, occluded, width = buffers.scene, buffers.occluded, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    count = _counts()
    seeds, frame = new_seeds(), new_frame()
    cast = 0
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin) - group)
        lane_seeds(begin + group, lanes, 25, seeds)
        for lane in range(PACKET_WIDTH):
            on[lane] = -1 if lane < lanes else 0
            count[lane] = 0
        done = 0
        for s in range(n_samples):
            # Trace one ray of each texel, and count the unblocked rays.
            k = s * N_POINTS // n_samples
            if s == 0 or k != (s - 1) * N_POINTS // n_samples:
                load_frames(rays, frame, origin, normal, group, lanes, k)
            aim_lanes(rays, words, frame, seeds, sobol_points[s, 0], sobol_points[s, 1], shared, distance)
            trace_lanes(occluded, scene, width, query, on, rays, spare_on, spare)
            for lane in range(PACKET_WIDTH):
                count[lane] += np.int32(1) if rays[TFAR * PACKET_WIDTH + lane] >= _f(0.0) else np.int32(0)
            done += 1
            # Stop early if at most one ray of each texel was blocked.
            if done == early_out:
                clear = 0
                for lane in range(lanes):
                    clear += 1 if count[lane] >= early_out - 1 else 0
                if clear == lanes:
                    break
        cast += done * lanes
        for lane in range(lanes):
            out[begin + group + lane] = count[lane] / done
    return cast
