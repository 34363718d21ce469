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
    emitted_radiance,
    emitter_density,
    sample_emitter,
)  # fmt: skip
from baker.kernels.hits import front_facing
from baker.kernels.rays import lane_seeds, new_lanes
from baker.kernels.sampling import texel_scramble
from baker.kernels.surface import N_POINTS
from baker.trace.packets import TFAR, set_ray, trace

_f = np.float32
_INV_PI = 1.0 / math.pi
# Shadow rays end this share of their length before the light.
_SHORT = np.float32(0.9999)


@njit(cache=True, nogil=True, error_model="numpy")
def mis_weighted(cosine, density, n_light, n_hemisphere):  # type: ignore[no-untyped-def]
    """Return cosine / (n_light p_light + n_hemisphere p_cosine), densities per steradian."""
    return cosine / (n_light * density + n_hemisphere * cosine * _INV_PI)


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
    valid, floats, words = caster.valid, caster.floats, caster.words
    row, first, triangle = lamps.row, lamps.first, lamps.triangle
    chance, cumulative = lamps.chance, lamps.cumulative
    any_alpha = len(shading.alpha.slot) > 0
    point = np.zeros(3, np.float32)
    radiance = np.zeros(4)
    value = np.zeros((width, 6))
    batch = np.zeros((width, N_POINTS))
    total = np.zeros((width, 6))
    seeds, _ = new_lanes()
    for group in range(0, len(origin), width):
        lanes = min(width, len(origin) - group)
        total[:] = 0.0
        batch[:] = 0.0
        valid[:] = 0
        lane_seeds(begin + group, lanes, 15, seeds)
        for s in range(n_samples):
            k = s * N_POINTS // n_samples
            any_lane = False
            for lane in range(lanes):
                valid[lane] = 0
                i = group + lane
                u = texel_scramble(net[s, 0], seeds[0, lane], shared)
                v = texel_scramble(net[s, 1], seeds[1, lane], shared)
                m, density, b1, b2 = sample_emitter(row, first, chance, cumulative, u, v, point)
                ox, oy, oz = origin[i, k, 0], origin[i, k, 1], origin[i, k, 2]
                dx, dy, dz = point[0] - ox, point[1] - oy, point[2] - oz
                square = dx * dx + dy * dy + dz * dz
                if square <= _f(0.0):
                    continue
                length = math.sqrt(square)
                cosine = (dx * normal[i, k, 0] + dy * normal[i, k, 1] + dz * normal[i, k, 2]) / length
                light = -(dx * row[m, NORMAL] + dy * row[m, NORMAL + 1] + dz * row[m, NORMAL + 2]) / length
                if row[m, TWO_SIDED] > _f(0.0):
                    light = abs(light)
                if cosine <= _f(0.0) or light <= _f(1.0e-6):
                    continue
                there = 1.0
                if any_alpha:
                    # What is not there does not shine; rays that find an emitter know that already.
                    there = presence_at(shading, triangle[m], b1, b2)
                    if there <= 0.0:
                        continue
                steradian = density * square / light
                first_weight = mis_weighted(cosine, steradian, n_samples, hemisphere[0])
                second_weight = mis_weighted(cosine, steradian, n_samples, hemisphere[1])
                if any_alpha:
                    first_weight *= there
                    second_weight *= there
                if row[m, TEXTURED] > _f(0.0):
                    emitted_radiance(shading, triangle[m], b1, b2, radiance)
                else:
                    for c in range(3):
                        radiance[c] = row[m, RADIANCE + c]
                for c in range(3):
                    value[lane, c] = radiance[c] * first_weight
                    value[lane, 3 + c] = radiance[c] * second_weight
                set_ray(floats, words, width, lane, ox, oy, oz, dx, dy, dz, _SHORT)
                valid[lane] = -1
                any_lane = True
            if not any_lane:
                continue
            trace(occluded, scene, valid, floats)
            for lane in range(lanes):
                if valid[lane] and floats[TFAR * width + lane] >= _f(0.0):
                    for c in range(6):
                        total[lane, c] += value[lane, c]
                    batch[lane, k] += value[lane, 0] + value[lane, 1] + value[lane, 2]
        for lane in range(lanes):
            squares = 0.0
            for k in range(N_POINTS):
                squares += batch[lane, k] * batch[lane, k]
            second[group + lane] = squares
            for c in range(6):
                out[group + lane, c] += total[lane, c]


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
