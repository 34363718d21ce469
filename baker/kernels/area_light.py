"""Irradiance of texels from emissive triangles: shadow rays to sampled points, weighted for MIS.

    E = 1/n sum L cos / (p_light + (n_hemisphere / n) p_cosine)

The balance heuristic leaves the rest to hemisphere rays that hit the same emitters.
Based on: Veach and Guibas, Optimally combining sampling techniques, 1995.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from baker.kernels.alpha import presence_at
from baker.kernels.emitters import (
    NORMAL,
    RADIANCE,
    TEXTURED,
    TWO_SIDED,
    choose_emitter,
    emitted_radiance,
    emitter_density,
)  # fmt: skip
from baker.kernels.hits import front_facing
from baker.kernels.rays import lane_seeds, new_lanes
from baker.kernels.sampling import texel_scramble, triangle_barycentric
from baker.kernels.surface import N_POINTS
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, MAX_WIDTH, ORG_X, ORG_Y, ORG_Z, TFAR, trace

_f = np.float32
_INV_PI = np.float32(1.0 / math.pi)
# Shadow rays end this share of their length before the light.
_SHORT = np.float32(0.9999)


@njit(cache=True, nogil=True, error_model="numpy")
def mis_weighted(cosine, density, n_light, n_hemisphere):  # type: ignore[no-untyped-def]
    """Return cosine / (n_light p_light + n_hemisphere p_cosine), densities per steradian."""
    return cosine / (n_light * density + n_hemisphere * cosine * _INV_PI)


@njit(cache=True, nogil=True, error_model="numpy")
def load_points(frame, origin, normal, group, lanes, k):  # type: ignore[no-untyped-def]
    """Write origins and normals of point k of texels group to group + lanes to `frame` (6, 16)."""
    for lane in range(lanes):
        for a in range(3):
            frame[a, lane] = origin[group + lane, k, a]
            frame[3 + a, lane] = normal[group + lane, k, a]


@njit(cache=True, nogil=True, error_model="numpy")
def choose_lanes(lamps, first, second, seeds, shared, width, uv, chosen, lamp):  # type: ignore[no-untyped-def]
    """Choose an emitter for every lane of a packet and copy what `aim_at_lamps` needs of it.

    first, second : uint32, the sample's bit-reversed Sobol numbers
    uv : (2, 16) float32, place on the emitter; chosen : (16,) int64
    lamp : (14, 16) float32: corner 0, edges, normal, density per m2, 1 if two-sided
    """
    row, starts, chance, cumulative = lamps.row, lamps.first, lamps.chance, lamps.cumulative
    for lane in range(width):
        uv[0, lane] = texel_scramble(first, seeds[0, lane], shared)
        uv[1, lane] = texel_scramble(second, seeds[1, lane], shared)
    for lane in range(width):
        m, density, u = choose_emitter(row, starts, chance, cumulative, uv[0, lane])
        uv[0, lane] = u
        chosen[lane] = m
        for a in range(3):
            lamp[a, lane] = row[m, a]
            lamp[3 + a, lane] = row[m, 3 + a] - row[m, a]
            lamp[6 + a, lane] = row[m, 6 + a] - row[m, a]
            lamp[9 + a, lane] = row[m, NORMAL + a]
        lamp[12, lane] = density
        lamp[13, lane] = row[m, TWO_SIDED]


@njit(cache=True, nogil=True, error_model="numpy")
def aim_at_lamps(floats, width, frame, uv, lamp, n_light, first_n, second_n, weight):  # type: ignore[no-untyped-def]
    """Write the shadow ray of every lane and its two weights; lanes that see no light get weight 0.

    uv : (2, 16) float32, becomes the barycentrics b1 and b2 on the emitter
    n_light, first_n, second_n : float32, rays that share the work: shadow rays, hemisphere rays of both
    estimates; weight : (2, 16) float32
    """
    for lane in range(width):
        b1, b2 = triangle_barycentric(uv[0, lane], uv[1, lane])
        ox, oy, oz = frame[0, lane], frame[1, lane], frame[2, lane]
        dx = lamp[0, lane] + b1 * lamp[3, lane] + b2 * lamp[6, lane] - ox
        dy = lamp[1, lane] + b1 * lamp[4, lane] + b2 * lamp[7, lane] - oy
        dz = lamp[2, lane] + b1 * lamp[5, lane] + b2 * lamp[8, lane] - oz
        square = max(dx * dx + dy * dy + dz * dz, _f(1.0e-30))
        length = math.sqrt(square)
        cosine = (dx * frame[3, lane] + dy * frame[4, lane] + dz * frame[5, lane]) / length
        light = -(dx * lamp[9, lane] + dy * lamp[10, lane] + dz * lamp[11, lane]) / length
        light = abs(light) if lamp[13, lane] > _f(0.0) else light
        seen = cosine > _f(0.0) and light > _f(1.0e-6)
        steradian = lamp[12, lane] * square / max(light, _f(1.0e-6))
        cosine = cosine if seen else _f(0.0)
        share = n_light * steradian
        weight[0, lane] = cosine / (share + first_n * cosine * _INV_PI)
        weight[1, lane] = cosine / (share + second_n * cosine * _INV_PI)
        uv[0, lane] = b1
        uv[1, lane] = b2
        floats[ORG_X * width + lane] = ox
        floats[ORG_Y * width + lane] = oy
        floats[ORG_Z * width + lane] = oz
        floats[DIR_X * width + lane] = dx
        floats[DIR_Y * width + lane] = dy
        floats[DIR_Z * width + lane] = dz
        floats[TFAR * width + lane] = _SHORT


@njit(cache=True, nogil=True, error_model="numpy")
def light_samples(origin, normal, lamps, shading, caster, begin, net, shared, hemisphere, out, second):  # type: ignore[no-untyped-def]
    """Add the light-sampled share of irradiance of texels.

    origin, normal : (m, 16, 3) float32, points of entries begin to begin + m
    net : (n, 2) uint32, one row a shadow ray; shared : uint32 mask of bits that texels share
    hemisphere : (2,) hemisphere rays to weigh against, one number for each column block of `out`
    out : (m, 6) float32, lx: two differently weighted estimates of RGB
    second : (m,) float32, sum over 16 batches of the square of the first estimate's share
    """
    n_samples = len(net)
    width, scene, occluded = caster.width, caster.scene, caster.occluded
    valid, floats = caster.valid, caster.floats
    row, triangle = lamps.row, lamps.triangle
    any_alpha = len(shading.alpha.slot) > 0
    radiance = np.zeros(4)
    # Sums of one point's samples are short: float32; those of all points are not.
    part = np.zeros((6, MAX_WIDTH), np.float32)
    total = np.zeros((6, MAX_WIDTH))
    squares = np.zeros(MAX_WIDTH)
    uv, weight = np.zeros((2, MAX_WIDTH), np.float32), np.zeros((2, MAX_WIDTH), np.float32)
    chosen, lamp = np.zeros(MAX_WIDTH, np.int64), np.zeros((14, MAX_WIDTH), np.float32)
    seeds, frame = new_lanes()
    n_light, first_n, second_n = _f(n_samples), _f(hemisphere[0]), _f(hemisphere[1])
    for group in range(0, len(origin), width):
        lanes = min(width, len(origin) - group)
        total[:] = 0.0
        squares[:] = 0.0
        lane_seeds(begin + group, lanes, 15, seeds)
        for s in range(n_samples):
            k = s * N_POINTS // n_samples
            if s == 0 or k != (s - 1) * N_POINTS // n_samples:
                load_points(frame, origin, normal, group, lanes, k)
                part[:] = _f(0.0)
            choose_lanes(lamps, net[s, 0], net[s, 1], seeds, shared, width, uv, chosen, lamp)
            aim_at_lamps(floats, width, frame, uv, lamp, n_light, first_n, second_n, weight)
            any_lane = False
            for lane in range(width):
                there = lane < lanes and weight[0, lane] > _f(0.0)
                if there and any_alpha:
                    # What is not there does not shine; rays that find an emitter know that already.
                    present = _f(presence_at(shading, triangle[chosen[lane]], uv[0, lane], uv[1, lane]))
                    weight[0, lane] *= present
                    weight[1, lane] *= present
                    there = present > _f(0.0)
                valid[lane] = -1 if there else 0
                any_lane = any_lane or there
            if any_lane:
                trace(occluded, scene, valid, floats)
                for lane in range(lanes):
                    if valid[lane] and floats[TFAR * width + lane] >= _f(0.0):
                        m = chosen[lane]
                        if row[m, TEXTURED] > _f(0.0):
                            emitted_radiance(shading, triangle[m], uv[0, lane], uv[1, lane], radiance)
                            for c in range(3):
                                part[c, lane] += _f(radiance[c]) * weight[0, lane]
                                part[3 + c, lane] += _f(radiance[c]) * weight[1, lane]
                        else:
                            for c in range(3):
                                part[c, lane] += row[m, RADIANCE + c] * weight[0, lane]
                                part[3 + c, lane] += row[m, RADIANCE + c] * weight[1, lane]
            if (s + 1) * N_POINTS // n_samples != k:
                for lane in range(lanes):
                    now = 0.0
                    for c in range(3):
                        now += part[c, lane]
                    squares[lane] += now * now
                    for c in range(6):
                        total[c, lane] += part[c, lane]
        for lane in range(lanes):
            second[group + lane] = squares[lane]
            for c in range(6):
                out[group + lane, c] += total[c, lane]


@njit(cache=True, nogil=True, error_model="numpy")
def emitter_hit(  # type: ignore[no-untyped-def]
    row, lamp, chance, cumulative, prim, m, dx, dy, dz, nx, ny, nz, distance, n_light, n_hemisphere
):
    """Return the factor that turns the radiance of a hit emitter into its share of irradiance (0: back)."""
    front = front_facing(row, prim, dx, dy, dz)
    if not front and lamp[m, TWO_SIDED] == _f(0.0):
        return 0.0
    cosine = dx * nx + dy * ny + dz * nz
    light = abs(dx * lamp[m, NORMAL] + dy * lamp[m, NORMAL + 1] + dz * lamp[m, NORMAL + 2])
    if cosine <= 0.0 or light <= 1.0e-6:
        return 0.0
    density = emitter_density(lamp, chance, cumulative, m) * distance * distance / light
    return mis_weighted(cosine, density, n_light, n_hemisphere)
