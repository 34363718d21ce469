"""Final gather: what a texel's hemisphere rays see, and how far they go.

    E_indirect = pi / n sum M / pi        M: radiosity of the texel that was hit (emitters aside)
    E_sky      = pi / n sum L_sky         over rays that leave the scene
    E_emitted  = sum of MIS-weighted hits of emitters (the other half of `area_light`)
    AO         = share of rays that meet nothing within the distance

Based on: Reichert, A two-pass radiosity method driven by lights and viewer position, 1992;
Christensen, Faster photon map global illumination, 1999.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.kernels.area_light import emitter_hit
from baker.kernels.emitters import RADIANCE, TEXTURED, emitted_radiance
from baker.kernels.hits import front_facing, hit_entry
from baker.kernels.rays import FAR, aim_texel, lane_seeds
from baker.kernels.sampling import texel_scramble
from baker.kernels.surface import N_POINTS
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, HIT_U, HIT_V, NO_HIT, PRIM_ID, TFAR, trace

_f = np.float32
# Columns of `out`: indirect RGB, sky and emitted RGB, AO, sum of squares over 16 batches.
INDIRECT, DIRECT, OPEN, SQUARE = 0, 3, 6, 7
N_COLUMNS = 8


@njit(cache=True, nogil=True)
def gather(origin, normal, table, exitance, lamps, shading, caster, begin, net, shared, sky, limits, out):  # type: ignore[no-untyped-def]
    """Write the gathered light of texels.

    origin, normal : (m, 16, 3) float32, points of entries begin to begin + m
    exitance : (n_entries, 3) float32, lx, light that each texel reflects
    net : (n, 2) uint32; shared : uint32; sky : (3,) float32, cd/m2
    limits : (2,) float64, AO distance in metres and the number of shadow rays for MIS
    out : (n_entries, 8) float32, see the column names
    """
    n_samples = len(net)
    width, scene, intersect = caster.width, caster.scene, caster.intersect
    valid, floats, words = caster.valid, caster.floats, caster.words
    row, lookup, back_entry, size = table.row, table.lookup, table.back_entry, table.size
    lamp, chance, cumulative = lamps.row, lamps.chance, lamps.cumulative
    radiance = np.zeros(4)
    total = np.zeros((width, 7))
    batch = np.zeros((width, N_POINTS))
    seeds = np.zeros((width, 2), np.uint32)
    distance = _f(limits[0])
    # `emitter_hit` weighs against all rays together, the sums below are scaled by pi / n.
    whole = n_samples / np.pi
    for group in range(0, len(origin), width):
        lanes = min(width, len(origin) - group)
        lane_seeds(begin + group, lanes, 25, seeds)
        for lane in range(width):
            valid[lane] = -1 if lane < lanes else 0
        total[:] = 0.0
        batch[:] = 0.0
        for s in range(n_samples):
            k = s * N_POINTS // n_samples
            for lane in range(lanes):
                u = texel_scramble(net[s, 0], seeds[lane, 0], shared)
                v = texel_scramble(net[s, 1], seeds[lane, 1], shared)
                aim_texel(floats, words, width, lane, origin, normal, group + lane, k, u, v, FAR)
            trace(intersect, scene, valid, floats)
            for lane in range(lanes):
                if words[GEOM_ID * width + lane] == NO_HIT:
                    total[lane, OPEN] += 1.0
                    for c in range(3):
                        total[lane, DIRECT + c] += sky[c]
                        batch[lane, k] += sky[c]
                    continue
                far = floats[TFAR * width + lane]
                if far > distance:
                    total[lane, OPEN] += 1.0
                prim = np.int64(words[PRIM_ID * width + lane])
                dx, dy, dz = (
                    floats[DIR_X * width + lane],
                    floats[DIR_Y * width + lane],
                    floats[DIR_Z * width + lane],
                )
                hit_u, hit_v = floats[HIT_U * width + lane], floats[HIT_V * width + lane]
                m = np.int64(row[prim, 12])
                if m >= 0:
                    i = group + lane
                    weight = whole * emitter_hit(
                        row, lamp, chance, cumulative, prim, m, dx, dy, dz,
                        normal[i, k, 0], normal[i, k, 1], normal[i, k, 2], far, limits[1], n_samples,
                    )  # fmt: skip
                    if weight > 0.0:
                        for c in range(3):
                            radiance[c] = lamp[m, RADIANCE + c]
                        if lamp[m, TEXTURED] > _f(0.0):
                            emitted_radiance(shading, prim, hit_u, hit_v, radiance)
                        for c in range(3):
                            total[lane, DIRECT + c] += radiance[c] * weight
                            batch[lane, k] += radiance[c] * weight
                front = front_facing(row, prim, dx, dy, dz)
                entry = hit_entry(row, lookup, back_entry, size, prim, hit_u, hit_v, front)
                if entry >= 0:
                    for c in range(3):
                        value = exitance[entry, c] * _f(0.31830987)
                        total[lane, INDIRECT + c] += value
                        batch[lane, k] += value
        scale = np.pi / n_samples
        for lane in range(lanes):
            i = begin + group + lane
            squares = 0.0
            for k in range(N_POINTS):
                squares += batch[lane, k] * batch[lane, k]
            for c in range(6):
                out[i, c] = total[lane, c] * scale
            out[i, OPEN] = total[lane, OPEN] / n_samples
            out[i, SQUARE] = squares * scale * scale


@njit(cache=True, nogil=True)
def open_share(origin, normal, caster, begin, net, shared, distance, out):  # type: ignore[no-untyped-def]
    """Write the cosine-weighted share of the hemisphere that is open within `distance` metres.

    origin, normal : (m, 16, 3) float32, points of entries begin to begin + m; out : (n_entries,) float32
    """
    n_samples = len(net)
    width, scene, occluded = caster.width, caster.scene, caster.occluded
    valid, floats, words = caster.valid, caster.floats, caster.words
    count = np.zeros(width, np.int64)
    seeds = np.zeros((width, 2), np.uint32)
    for group in range(0, len(origin), width):
        lanes = min(width, len(origin) - group)
        lane_seeds(begin + group, lanes, 25, seeds)
        count[:] = 0
        for lane in range(width):
            valid[lane] = -1 if lane < lanes else 0
        for s in range(n_samples):
            k = s * N_POINTS // n_samples
            for lane in range(lanes):
                u = texel_scramble(net[s, 0], seeds[lane, 0], shared)
                v = texel_scramble(net[s, 1], seeds[lane, 1], shared)
                aim_texel(floats, words, width, lane, origin, normal, group + lane, k, u, v, distance)
            trace(occluded, scene, valid, floats)
            for lane in range(lanes):
                if floats[TFAR * width + lane] >= _f(0.0):
                    count[lane] += 1
        for lane in range(lanes):
            out[begin + group + lane] = count[lane] / n_samples
