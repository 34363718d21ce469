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
from baker.kernels.emitters import RADIANCE, TEXTURED, bounding_sphere, cluster_chances, emitted_radiance
from baker.kernels.hits import front_facing, hit_entry
from baker.kernels.rays import FAR, aim_texel, lane_seeds
from baker.kernels.sampling import texel_scramble
from baker.kernels.surface import N_POINTS, drop_buried, place_points
from baker.trace.packets import (
    DIR_X, DIR_Y, DIR_Z, GEOM_ID, HIT_U, HIT_V, NO_HIT, PRIM_ID, TFAR, new_packet, trace,
)  # fmt: skip

_f = np.float32
# Columns of `out`: indirect RGB, sky and emitted RGB, AO, mean squares of the two sums over batches.
INDIRECT, DIRECT, OPEN, SQUARE = 0, 3, 6, 7
N_COLUMNS = 8


@njit(cache=True, nogil=True)
def gather(surface, mask, table, exitance, emitters, shading, tracer, begin, end, net, shared, sky, limits, out):  # type: ignore[no-untyped-def]
    """Write the gathered light of front entries begin to end.

    exitance : (n_entries, 3) float32, lx, light that each texel reflects
    net : (n, 2) uint32; shared : uint32; sky : (3,) float32, cd/m2
    limits : (2,) float64, AO distance in metres and the number of shadow rays for MIS
    out : (n_front, 8) float32, see the column names
    """
    n_samples = len(net)
    width, scene, intersect, occluded = tracer.width, tracer.scene, tracer.intersect, tracer.occluded
    valid, floats, words = new_packet(width)
    n = end - begin
    origin = np.zeros((n, N_POINTS, 3), np.float32)
    normal = np.zeros((n, N_POINTS, 3), np.float32)
    hit = np.zeros((n, N_POINTS), np.int32)
    bary = np.zeros((n, N_POINTS, 2), np.float32)
    place_points(surface, begin, end, origin, normal, hit, bary)
    drop_buried(mask, begin, end, origin, normal)
    chance = np.zeros(len(emitters.power), np.float32)
    cumulative = np.zeros(len(emitters.power), np.float32)
    if len(emitters.power):
        x, y, z, radius = bounding_sphere(origin.reshape(n * N_POINTS, 3), 0, n * N_POINTS)
        cluster_chances(emitters, x, y, z, radius, chance, cumulative)
    radiance = np.zeros(4)
    total = np.zeros((width, 7))
    batch = np.zeros((width, N_POINTS))
    seeds = np.zeros((width, 2), np.uint32)
    distance = _f(limits[0])
    row, lookup, back_entry, size, lamp = table.row, table.lookup, table.back_entry, table.size, emitters.row
    for group in range(0, n, width):
        lanes = min(width, n - group)
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
                dx, dy, dz = floats[DIR_X * width + lane], floats[DIR_Y * width + lane], floats[DIR_Z * width + lane]
                hit_u, hit_v = floats[HIT_U * width + lane], floats[HIT_V * width + lane]
                m = np.int64(row[prim, 12])
                if m >= 0:
                    i = group + lane
                    weight = emitter_hit(
                        row, lamp, chance, cumulative, prim, m, dx, dy, dz,
                        normal[i, k, 0], normal[i, k, 1], normal[i, k, 2], far, limits[1], n_samples,
                    ) * n_samples / np.pi  # fmt: skip
                    if weight > 0.0:
                        for c in range(3):
                            radiance[c] = lamp[m, RADIANCE + c]
                        if lamp[m, TEXTURED] > _f(0.0):
                            emitted_radiance(shading, surface.triangle, prim, hit_u, hit_v, radiance)
                        for c in range(3):
                            total[lane, DIRECT + c] += radiance[c] * weight
                            batch[lane, k] += radiance[c] * weight
                entry = hit_entry(row, lookup, back_entry, size, prim, hit_u, hit_v, front_facing(row, prim, dx, dy, dz))
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
def open_share(surface, mask, tracer, begin, end, net, shared, distance, out):  # type: ignore[no-untyped-def]
    """Write the cosine-weighted share of the hemisphere that is open within `distance` metres.

    out : (n_front,) float32
    """
    n_samples = len(net)
    width, scene, intersect, occluded = tracer.width, tracer.scene, tracer.intersect, tracer.occluded
    valid, floats, words = new_packet(width)
    n = end - begin
    origin = np.zeros((n, N_POINTS, 3), np.float32)
    normal = np.zeros((n, N_POINTS, 3), np.float32)
    hit = np.zeros((n, N_POINTS), np.int32)
    bary = np.zeros((n, N_POINTS, 2), np.float32)
    place_points(surface, begin, end, origin, normal, hit, bary)
    drop_buried(mask, begin, end, origin, normal)
    count = np.zeros(width, np.int64)
    seeds = np.zeros((width, 2), np.uint32)
    for group in range(0, n, width):
        lanes = min(width, n - group)
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
