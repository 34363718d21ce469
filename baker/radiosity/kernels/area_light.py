# mypy: disable-error-code="no-untyped-def"
"""Computes the irradiance of texels from emissive triangles, with shadow rays to sampled points and MIS.

    E = 1/n sum L cos / (p_light + (n_hemisphere / n) p_cosine)

The sum is over the unblocked rays of n shadow rays, with the radiance L of the emitter and the cosine at the
texel. p are probability densities per steradian. The balance heuristic combines these light samples with
n_hemisphere cosine-weighted rays, some of which hit the same emitters (`emitter_hit`). If no test ray of
sixteen consecutive texels is blocked and the emitters are few, untextured and opaque, the closed form of
`radiosity.kernels.polygon_light` replaces both estimates.

Based on: Veach and Guibas, Optimally combining sampling techniques, 1995.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.alpha import opacity_at
from baker.kernels.emitters import (
    CORNER,
    CORNER_1,
    CORNER_2,
    NORMAL,
    RADIANCE,
    TEXTURED,
    TWO_SIDED,
    choose_emitter,
    emitted_radiance,
    emitter_density,
    on_triangle,
)  # fmt: skip
from baker.kernels.rays import lane_seeds, new_seeds
from baker.kernels.sampling import texel_scramble, triangle_barycentric
from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import count_coloured, trace_shadow_lanes, transmittance
from baker.kernels.triangle_lookup import front_facing
from baker.radiosity.kernels.polygon_light import unoccluded_irradiance
from baker.trace.jit import inner, kernel, larger, scratch, smaller
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, ORG_X, ORG_Y, ORG_Z, PACKET_WIDTH, TFAR

_f = np.float32
_INV_PI = np.float32(1.0 / math.pi)
# TFAR of shadow rays, as a share of the distance to the emitter: the rays end before they hit the emitter.
_SHORT = np.float32(0.9999)
# Smallest ratio of samples per texel to emitters for which the closed form is used.
_SAMPLES_PER_EMITTER = 8
# Smallest mean number of test rays per texel for the early out of `light_samples`. With fewer test rays,
# texels are not treated as unoccluded.
_MIN_TESTS = 8
# Rows of `sampled`, the data of the emitter that each lane samples: corner 0, edges 1 and 2 and normal (3
# each), probability density per m2, 1 if two-sided else 0, radiance (3).
_CORNER, _EDGE_1, _EDGE_2, _NORMAL, _DENSITY, _TWO_SIDED, _RADIANCE = 0, 3, 6, 9, 12, 13, 14
_SAMPLED_ROWS = 17
# Working memory of `light_samples`.
_rgba, _numbers = scratch((4,), np.float64), scratch((PACKET_WIDTH,), np.int64)
_sampled = scratch((_SAMPLED_ROWS * PACKET_WIDTH,), _f)
_pairs, _vectors = scratch((2 * PACKET_WIDTH,), _f), scratch((3 * PACKET_WIDTH,), _f)
_parts = scratch((N_POINTS, 6 * PACKET_WIDTH), _f)


@inner
def mis_weighted(cosine, density, n_light, n_hemisphere):
    """Return cosine / (n_light p_light + n_hemisphere p_cosine).

    density : p_light, per steradian; p_cosine is cosine / pi
    """
    return cosine / (n_light * density + n_hemisphere * cosine * _INV_PI)


@inner
def load_points(rays, facing, origin, normal, group, lanes, k):
    """Copy origin and normal of point k of texel `group` + lane into each lane.

    rays : (21 * 16,) float32 output, a packet whose origins are set
    facing : (3 * 16,) float32 output, normals
    origin, normal : (m, 16, 3) float32, metres and unit vectors, world
    """
    for lane in range(lanes):
        for a in range(3):
            rays[(ORG_X + a) * PACKET_WIDTH + lane] = origin[group + lane, k, a]
            facing[a * PACKET_WIDTH + lane] = normal[group + lane, k, a]


@inner
def choose_lanes(row, starts, chance, cumulative, first, second, seeds, shared, uv, chosen, sampled):
    """Sample an emitter for every lane, and copy its data to `sampled`.

    row (M, 24), starts (C + 1,), chance, cumulative (C,) : see `kernels.emitters.TileEmitters`
    first, second : uint32, bit-reversed Sobol numbers of the sample
    seeds : (2 * 16,) uint32, from `lane_seeds`
    shared : uint32, from `kernels.sampling.shared_bits_mask`
    uv : (2 * 16,) float32 output, uniform numbers from which the point on the emitter is sampled
    chosen : (16,) int64 output, emitters; sampled : (17 * 16,) float32 output, see the row names
    """
    for lane in range(PACKET_WIDTH):
        uv[lane] = texel_scramble(first, seeds[lane], shared)
        uv[PACKET_WIDTH + lane] = texel_scramble(second, seeds[PACKET_WIDTH + lane], shared)
    same = True
    for lane in range(PACKET_WIDTH):
        m, density, u = choose_emitter(row, starts, chance, cumulative, uv[lane])
        uv[lane] = u
        chosen[lane] = m
        sampled[_DENSITY * PACKET_WIDTH + lane] = density
        same = same and m == chosen[0]
    if same:
        # All lanes sample one emitter. This is the usual case, because neighbouring texels share the first
        # bits of their random numbers. Numba vectorises these loops.
        m = chosen[0]
        for a in range(3):
            for lane in range(PACKET_WIDTH):
                sampled[(_CORNER + a) * PACKET_WIDTH + lane] = row[m, CORNER + a]
                sampled[(_EDGE_1 + a) * PACKET_WIDTH + lane] = row[m, CORNER_1 + a] - row[m, CORNER + a]
                sampled[(_EDGE_2 + a) * PACKET_WIDTH + lane] = row[m, CORNER_2 + a] - row[m, CORNER + a]
                sampled[(_NORMAL + a) * PACKET_WIDTH + lane] = row[m, NORMAL + a]
                sampled[(_RADIANCE + a) * PACKET_WIDTH + lane] = row[m, RADIANCE + a]
        for lane in range(PACKET_WIDTH):
            sampled[_TWO_SIDED * PACKET_WIDTH + lane] = row[m, TWO_SIDED]
        return
    for lane in range(PACKET_WIDTH):
        m = chosen[lane]
        for a in range(3):
            sampled[(_CORNER + a) * PACKET_WIDTH + lane] = row[m, CORNER + a]
            sampled[(_EDGE_1 + a) * PACKET_WIDTH + lane] = row[m, CORNER_1 + a] - row[m, CORNER + a]
            sampled[(_EDGE_2 + a) * PACKET_WIDTH + lane] = row[m, CORNER_2 + a] - row[m, CORNER + a]
            sampled[(_NORMAL + a) * PACKET_WIDTH + lane] = row[m, NORMAL + a]
            sampled[(_RADIANCE + a) * PACKET_WIDTH + lane] = row[m, RADIANCE + a]
        sampled[_TWO_SIDED * PACKET_WIDTH + lane] = row[m, TWO_SIDED]


@inner
def aim_at_emitters(rays, facing, uv, sampled, n_light, first_n, second_n, weight):
    """Write the shadow ray of every lane, and its factors from radiance to both irradiance estimates.

    rays : (21 * 16,) float32, a packet with origins; directions and TFAR are set
    facing : (3 * 16,) float32, unit normals of the points
    uv : (2 * 16,) float32, uniform numbers; replaced by the barycentrics b1 and b2 on the emitter
    sampled : (17 * 16,) float32, see the row names
    n_light : float32, number of light samples
    first_n, second_n : float32, numbers of hemisphere samples in the MIS weights of both estimates
    weight : (2 * 16,) float32 output, factors, see `mis_weighted`; 0 if a cosine is not positive
    """
    for lane in range(PACKET_WIDTH):
        # Sample a point on the emitter.
        b1, b2 = triangle_barycentric(uv[lane], uv[PACKET_WIDTH + lane])
        dx = (
            sampled[_CORNER * PACKET_WIDTH + lane]
            + b1 * sampled[_EDGE_1 * PACKET_WIDTH + lane]
            + b2 * sampled[_EDGE_2 * PACKET_WIDTH + lane]
        )
        dy = (
            sampled[(_CORNER + 1) * PACKET_WIDTH + lane]
            + b1 * sampled[(_EDGE_1 + 1) * PACKET_WIDTH + lane]
            + b2 * sampled[(_EDGE_2 + 1) * PACKET_WIDTH + lane]
        )
        dz = (
            sampled[(_CORNER + 2) * PACKET_WIDTH + lane]
            + b1 * sampled[(_EDGE_1 + 2) * PACKET_WIDTH + lane]
            + b2 * sampled[(_EDGE_2 + 2) * PACKET_WIDTH + lane]
        )
        dx -= rays[ORG_X * PACKET_WIDTH + lane]
        dy -= rays[ORG_Y * PACKET_WIDTH + lane]
        dz -= rays[ORG_Z * PACKET_WIDTH + lane]
        # Compute the cosines at the texel and at the emitter.
        square = larger(dx * dx + dy * dy + dz * dz, _f(1.0e-30))
        length = math.sqrt(square)
        cosine = (
            dx * facing[lane] + dy * facing[PACKET_WIDTH + lane] + dz * facing[2 * PACKET_WIDTH + lane]
        ) / length
        light = (
            dx * sampled[_NORMAL * PACKET_WIDTH + lane]
            + dy * sampled[(_NORMAL + 1) * PACKET_WIDTH + lane]
            + dz * sampled[(_NORMAL + 2) * PACKET_WIDTH + lane]
        )
        light = -light / length
        light = abs(light) if sampled[_TWO_SIDED * PACKET_WIDTH + lane] > _f(0.0) else light
        seen = cosine > _f(0.0) and light > _f(1.0e-6)
        # Convert the density to steradians, and apply the balance heuristic.
        steradian = sampled[_DENSITY * PACKET_WIDTH + lane] * square / larger(light, _f(1.0e-6))
        cosine = cosine if seen else _f(0.0)
        share = n_light * steradian
        weight[lane] = cosine / (share + first_n * cosine * _INV_PI)
        weight[PACKET_WIDTH + lane] = cosine / (share + second_n * cosine * _INV_PI)
        uv[lane] = b1
        uv[PACKET_WIDTH + lane] = b2
        rays[DIR_X * PACKET_WIDTH + lane] = dx
        rays[DIR_Y * PACKET_WIDTH + lane] = dy
        rays[DIR_Z * PACKET_WIDTH + lane] = dz
        rays[TFAR * PACKET_WIDTH + lane] = _SHORT


@kernel
def light_samples(
    origin, normal, emitters, shading, buffers, begin, sobol_points, shared, hemisphere, analytic, out, second
):
    """Add the irradiance of texels from light samples; return the number of shadow rays cast.

    Early out, with 32 or more samples: first, one test ray is traced from each point of sixteen consecutive
    texels. If none of these up to 256 rays is blocked, and at least `_MIN_TESTS` rays per texel were traced,
    the texels are treated as unoccluded: their other rays are not traced. If in truth the share p of the
    light is blocked, the expected error with 256 test rays is p (1 - p)^256 of the light, at most 0.15 %. If
    the emitters are few, untextured and opaque, the closed form replaces the samples of unoccluded texels.
    Hemisphere rays that hit these emitters then add nothing.

    origin, normal : (m, 16, 3) float32, metres and unit vectors, world; points of m texels
    emitters : TileEmitters; shading : Shading or None, from `kernels.emitters.needed_shading`
    buffers : PacketBuffers; begin : number of the first texel, which seeds the random numbers
    sobol_points : (n, 2) uint32, one row per shadow ray
    shared : uint32, from `kernels.sampling.shared_bits_mask`
    hemisphere : (2,) float64, numbers of hemisphere rays in the MIS weights of both estimates
    analytic : (m,) uint8, set to 1 for texels for which the closed form is used
    out : (m, 6) float32, lx, added to: two RGB estimates, which differ in their MIS weights
    second : (m,) float32 output, sum over the 16 points of x^2, where x is the point's contribution R + G + B
        to the first estimate
    """
    n_samples = len(sobol_points)
    scene, occluded, width = buffers.scene, buffers.occluded, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row, triangle, starts = emitters.row, emitters.triangle, emitters.first
    chance, cumulative = emitters.chance, emitters.cumulative
    any_alpha = False
    if shading is not None:
        any_alpha = len(shading.alpha.slot) > 0
    # Allow the closed form if emitters are few (see `_SAMPLES_PER_EMITTER`), untextured and opaque.
    untextured = len(row) * _SAMPLES_PER_EMITTER <= n_samples
    for m in range(len(row) if untextured else 0):
        untextured = untextured and row[m, TEXTURED] == _f(0.0)
        if shading is not None:
            untextured = untextured and (not any_alpha or shading.alpha.slot[triangle[m]] < 0)
    found = _vectors()
    radiance = _rgba()
    # Sum over the samples of one point in float32, and over all points in float64.
    part = _parts()
    uv, weight = _pairs(), _pairs()
    chosen, sampled = _numbers(), _sampled()
    facing = _vectors()
    seeds = new_seeds()
    n_light, first_n, second_n = _f(n_samples), _f(hemisphere[0]), _f(hemisphere[1])
    cast = 0
    rounds = 2 if n_samples >= 2 * N_POINTS else 1
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin) - group)
        lane_seeds(begin + group, lanes, 15, seeds)
        for k in range(N_POINTS):
            for j in range(6 * PACKET_WIDTH):
                part[k, j] = _f(0.0)
        tested = blocked = 0
        # Compute the closed form. If it is 0, no emitter lights these texels.
        if untextured:
            unoccluded_irradiance(origin, normal, group, lanes, row, found)
            lit = False
            for j in range(3 * PACKET_WIDTH):
                lit = lit or found[j] != _f(0.0)
            if not lit:
                for lane in range(lanes):
                    analytic[group + lane] = 1
                continue
        # Trace one early-out test for each point in round 0, and the other samples in round 1.
        for turn in range(rounds):
            clear = turn == 1 and blocked == 0 and tested >= _MIN_TESTS * lanes
            if clear and untextured:
                break
            for k in range(N_POINTS):
                start, end = -(-k * n_samples // N_POINTS), -(-(k + 1) * n_samples // N_POINTS)
                if start == end:
                    continue
                # Use a sample with a different number for each point as its early-out test, so that the tests
                # are stratified.
                early_out = start + k % (end - start)
                load_points(rays, facing, origin, normal, group, lanes, k)
                for s in range(start, end):
                    if rounds == 2 and (s == early_out) != (turn == 0):
                        continue
                    # Sample the emitters.
                    choose_lanes(
                        row, starts, chance, cumulative, sobol_points[s, 0], sobol_points[s, 1], seeds,
                        shared, uv, chosen, sampled,
                    )  # fmt: skip
                    aim_at_emitters(rays, facing, uv, sampled, n_light, first_n, second_n, weight)
                    asked = 0
                    for lane in range(PACKET_WIDTH):
                        on[lane] = -1 if lane < lanes and weight[lane] > _f(0.0) else 0
                        asked -= on[lane]
                    if shading is not None:
                        # Multiply by the emitter's alpha, because cut-out parts emit nothing. Gather rays
                        # need no such factor, because they pass through these parts.
                        for lane in range(lanes if any_alpha else 0):
                            m = chosen[lane]
                            b1, b2 = on_triangle(row, m, uv[lane], uv[PACKET_WIDTH + lane])
                            alpha = _f(opacity_at(shading, triangle[m], b1, b2))
                            weight[lane] *= alpha
                            weight[PACKET_WIDTH + lane] *= alpha
                    if asked == 0:
                        continue
                    # Trace the shadow rays; switch off the lanes whose ray is blocked.
                    if not clear:
                        trace_shadow_lanes(
                            buffers.blend, occluded, scene, width, query, on, rays, words, spare_on, spare
                        )
                        cast += asked
                        tested += asked
                        for lane in range(PACKET_WIDTH):
                            hidden = on[lane] != 0 and rays[TFAR * PACKET_WIDTH + lane] < _f(0.0)
                            on[lane] = 0 if hidden else on[lane]
                            blocked += 1 if hidden else 0
                        # Count rays through BLEND surfaces as blocked. The texels are then not treated as
                        # unoccluded, so every ray is traced and gets its own transmittance.
                        blocked += count_coloured(buffers.blend)
                    # Look up the radiance of textured emitters.
                    if shading is not None:
                        for lane in range(lanes):
                            m = chosen[lane]
                            if on[lane] and row[m, TEXTURED] > _f(0.0):
                                b1, b2 = on_triangle(row, m, uv[lane], uv[PACKET_WIDTH + lane])
                                emitted_radiance(shading, triangle[m], b1, b2, radiance)
                                for c in range(3):
                                    sampled[(_RADIANCE + c) * PACKET_WIDTH + lane] = radiance[c]
                    # Add radiance times transmittance times weight to both estimates.
                    for c in range(3):
                        for lane in range(PACKET_WIDTH):
                            light = sampled[(_RADIANCE + c) * PACKET_WIDTH + lane] if on[lane] else _f(0.0)
                            light *= transmittance(buffers.blend, c, lane)
                            part[k, c * PACKET_WIDTH + lane] += light * weight[lane]
                            part[k, (3 + c) * PACKET_WIDTH + lane] += light * weight[PACKET_WIDTH + lane]
        # Use the closed form if no test ray is blocked. The closed form has no variance, so `second` stays 0.
        if untextured and blocked == 0 and tested >= _MIN_TESTS * lanes and n_samples >= N_POINTS:
            for lane in range(lanes):
                analytic[group + lane] = 1
                for c in range(3):
                    out[group + lane, c] += found[c * PACKET_WIDTH + lane]
                    out[group + lane, 3 + c] += found[c * PACKET_WIDTH + lane]
            continue
        # Otherwise sum over the points.
        for lane in range(lanes):
            squares = 0.0
            for k in range(N_POINTS):
                now = 0.0
                for c in range(3):
                    now += part[k, c * PACKET_WIDTH + lane]
                squares += now * now
            second[group + lane] = squares
            for c in range(6):
                total = 0.0
                for k in range(N_POINTS):
                    total += part[k, c * PACKET_WIDTH + lane]
                out[group + lane, c] += total
    return cast


@inner
def emitter_hit(
    row, emitter_row, chance, cumulative, prim, m, direction, normal, distance, n_light, n_hemisphere
):
    """Return irradiance / radiance for a hemisphere ray that hits emitter m: what the ray adds.

    row : (T, 16) float32, see `TriangleLookup`; prim : triangle that the ray hits
    emitter_row (M, 24), chance, cumulative (C,) : see `kernels.emitters.TileEmitters`
    direction, normal : tuples of three float32, unit direction of the ray, and unit normal of the texel's
        point
    distance : distance of the hit, metres
    n_light, n_hemisphere : numbers of shadow rays and hemisphere rays
    The factor is 0 at the back of a one-sided emitter.
    """
    dx, dy, dz = direction
    nx, ny, nz = normal
    front = front_facing(row, prim, dx, dy, dz)
    if not front and emitter_row[m, TWO_SIDED] == _f(0.0):
        return 0.0
    cosine = dx * nx + dy * ny + dz * nz
    light = abs(
        dx * emitter_row[m, NORMAL] + dy * emitter_row[m, NORMAL + 1] + dz * emitter_row[m, NORMAL + 2]
    )
    if cosine <= 0.0 or light <= 1.0e-6:
        return 0.0
    density = emitter_density(emitter_row, chance, cumulative, m) * distance * distance / light
    return mis_weighted(cosine, density, n_light, n_hemisphere)
