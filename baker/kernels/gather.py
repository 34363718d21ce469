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
from baker.kernels.hits import front_facing, hit_pixel
from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_lanes
from baker.kernels.surface import N_POINTS
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, HIT_U, HIT_V, NO_HIT, PRIM_ID, TFAR, trace

_f = np.float32
# Columns of `out`: indirect RGB, sky and emitted RGB, AO, sum of squares over 16 batches.
INDIRECT, DIRECT, OPEN, SQUARE = 0, 3, 6, 7
N_COLUMNS = 8


@njit(cache=True, nogil=True, error_model="numpy")
def gather(origin, normal, table, exitance, lamps, shading, caster, begin, net, shared, sky, limits, out):  # type: ignore[no-untyped-def]
    """Write the gathered light of texels.

    origin, normal : (m, 16, 3) float32, points of entries begin to begin + m
    exitance : (sides * P * H * W, 4) float32, lx, light that the texel at each pixel reflects (RGB,
        spare); no rows if nothing does
    net : (n, 2) uint32; shared : uint32; sky : (3,) float32, cd/m2
    limits : (2,) float64, AO distance in metres and the number of shadow rays for MIS
    begin : number of the first texel, for its random numbers; out : (m, 8) float32, see the column names
    """
    n_samples = len(net)
    width, scene, intersect = caster.width, caster.scene, caster.intersect
    valid, floats, words = caster.valid, caster.floats, caster.words
    row, size, n_pixels = table.row, table.size, table.n_pixels
    lamp, chance, cumulative = lamps.row, lamps.chance, lamps.cumulative
    radiance = np.zeros(4)
    total = np.zeros((width, 7))
    before = np.zeros(width)
    squares = np.zeros(width)
    pixel = np.zeros(width, np.int64)
    seeds, frame = new_lanes()
    distance = _f(limits[0])
    # Reflected light and `emitter_hit` are scaled so that all sums times pi / n are irradiance.
    inverse_pi = _f(1.0 / np.pi)
    lit = len(exitance) > 0
    whole = n_samples / np.pi
    for group in range(0, len(origin), width):
        lanes = min(width, len(origin) - group)
        lane_seeds(begin + group, lanes, 25, seeds)
        for lane in range(width):
            valid[lane] = -1 if lane < lanes else 0
        total[:] = 0.0
        before[:] = 0.0
        squares[:] = 0.0
        for s in range(n_samples):
            k = s * N_POINTS // n_samples
            if s == 0 or k != (s - 1) * N_POINTS // n_samples:
                load_frames(frame, origin, normal, group, lanes, k)
            aim_lanes(floats, words, width, frame, seeds, net[s, 0], net[s, 1], shared, FAR)
            trace(intersect, scene, valid, floats)
            # First only find the pixels, then fetch them: the fetches do not wait for each other.
            for lane in range(lanes):
                pixel[lane] = -1
                if words[GEOM_ID * width + lane] == NO_HIT:
                    total[lane, OPEN] += 1.0
                    for c in range(3):
                        total[lane, DIRECT + c] += sky[c]
                    continue
                far = floats[TFAR * width + lane]
                if far > distance:
                    total[lane, OPEN] += 1.0
                prim = np.int64(words[PRIM_ID * width + lane])
                dx = floats[DIR_X * width + lane]
                dy = floats[DIR_Y * width + lane]
                dz = floats[DIR_Z * width + lane]
                hit_u, hit_v = floats[HIT_U * width + lane], floats[HIT_V * width + lane]
                if row[prim, 12] >= _f(0.0):
                    m = np.int64(row[prim, 12])
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
                front = front_facing(row, prim, dx, dy, dz)
                pixel[lane] = hit_pixel(row, size, n_pixels, prim, hit_u, hit_v, front)
            for lane in range(lanes):
                p = pixel[lane]
                if p >= 0 and lit:
                    total[lane, INDIRECT] += exitance[p, 0] * inverse_pi
                    total[lane, INDIRECT + 1] += exitance[p, 1] * inverse_pi
                    total[lane, INDIRECT + 2] += exitance[p, 2] * inverse_pi
            if (s + 1) * N_POINTS // n_samples != k:
                for lane in range(lanes):
                    now = 0.0
                    for c in range(6):
                        now += total[lane, c]
                    squares[lane] += (now - before[lane]) ** 2
                    before[lane] = now
        scale = np.pi / n_samples
        for lane in range(lanes):
            i = group + lane
            for c in range(6):
                out[i, c] = total[lane, c] * scale
            out[i, OPEN] = total[lane, OPEN] / n_samples
            out[i, SQUARE] = squares[lane] * scale * scale


@njit(cache=True, nogil=True, error_model="numpy")
def open_share(origin, normal, caster, begin, net, shared, distance, out):  # type: ignore[no-untyped-def]
    """Write the cosine-weighted share of the hemisphere that is open within `distance` metres.

    origin, normal : (m, 16, 3) float32, points of entries begin to begin + m; out : (n_entries,) float32
    """
    n_samples = len(net)
    width, scene, occluded = caster.width, caster.scene, caster.occluded
    valid, floats, words = caster.valid, caster.floats, caster.words
    count = np.zeros(width, np.int64)
    seeds, frame = new_lanes()
    for group in range(0, len(origin), width):
        lanes = min(width, len(origin) - group)
        lane_seeds(begin + group, lanes, 25, seeds)
        count[:] = 0
        for lane in range(width):
            valid[lane] = -1 if lane < lanes else 0
        for s in range(n_samples):
            k = s * N_POINTS // n_samples
            if s == 0 or k != (s - 1) * N_POINTS // n_samples:
                load_frames(frame, origin, normal, group, lanes, k)
            aim_lanes(floats, words, width, frame, seeds, net[s, 0], net[s, 1], shared, distance)
            trace(occluded, scene, valid, floats)
            for lane in range(lanes):
                if floats[TFAR * width + lane] >= _f(0.0):
                    count[lane] += 1
        for lane in range(lanes):
            out[begin + group + lane] = count[lane] / n_samples
