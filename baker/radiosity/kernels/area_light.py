# mypy: disable-error-code="no-untyped-def"
"""Irradiance of texels from emissive triangles: shadow rays to sampled points, weighted for MIS.

    E = 1/n sum L cos / (p_light + (n_hemisphere / n) p_cosine)

These are the light samples of the balance heuristic; hemisphere rays that hit the same emitters are the other
ones (`emitter_hit`). Where no shadow ray is blocked, the closed form replaces both (`polygon_light`).

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
# Shadow rays end at this share of their length, just before the light.
_SHORT = np.float32(0.9999)
# The closed form is used for at most one emitter for each of these samples of a texel.
_SAMPLES_PER_EMITTER = 8
# Early out: sixteen texels are unoccluded if none of their first rays is blocked, and there are at least
# this many of them a texel.
_MIN_TESTS = 8
# Rows of `sampled`, the emitters that lanes chose: corner 0, edges 1 and 2, normal (3 each), density per m2,
# 1 if two-sided, radiance (3).
_CORNER, _EDGE_1, _EDGE_2, _NORMAL, _DENSITY, _TWO_SIDED, _RADIANCE = 0, 3, 6, 9, 12, 13, 14
_SAMPLED_ROWS = 17
# Working memory of `light_samples`.
_rgba, _numbers = scratch((4,), np.float64), scratch((PACKET_WIDTH,), np.int64)
_sampled = scratch((_SAMPLED_ROWS * PACKET_WIDTH,), _f)
_pairs, _vectors = scratch((2 * PACKET_WIDTH,), _f), scratch((3 * PACKET_WIDTH,), _f)
_parts = scratch((N_POINTS, 6 * PACKET_WIDTH), _f)


@inner
def mis_weighted(cosine, density, n_light, n_hemisphere):
    """Return cosine / (n_light p_light + n_hemisphere p_cosine), densities per steradian."""
    return cosine / (n_light * density + n_hemisphere * cosine * _INV_PI)


@inner
def load_points(rays, facing, origin, normal, group, lanes, k):
    """Write origins of point k of texels `group` to `group + lanes` to `rays`, normals to `facing`.

    rays : (21 * 16,) float32 output, a packet; facing : (3 * 16,) float32 output
    origin, normal : (m, 16, 3) float32, metres, world, and unit
    """
    for lane in range(lanes):
        for a in range(3):
            rays[(ORG_X + a) * PACKET_WIDTH + lane] = origin[group + lane, k, a]
            facing[a * PACKET_WIDTH + lane] = normal[group + lane, k, a]


@inner
def choose_lanes(row, starts, chance, cumulative, first, second, seeds, shared, uv, chosen, sampled):
    """Choose an emitter for every lane and copy its data.

    row (M, 24), starts (C + 1,), chance, cumulative (C,) : see `emitters.TileEmitters`
    first, second : uint32, the sample's bit-reversed Sobol numbers
    seeds : (2 * 16,) uint32, see `lane_seeds`; shared : uint32, see `sampling`
    uv : (2 * 16,) float32 output, uniform numbers for the point on the emitter
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
        # The usual case, since neighbouring texels share the first bits of their numbers: vector code.
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
    """Write the shadow ray of every lane and its MIS weights for both estimates.

    rays : (21 * 16,) float32, a packet with origins; directions and TFAR are set
    facing : (3 * 16,) float32, unit normals of the points
    uv : (2 * 16,) float32, uniform numbers; replaced by the barycentrics b1 and b2 on the emitter
    sampled : (17 * 16,) float32, see the row names
    n_light, first_n, second_n : float32, numbers of light samples, and of hemisphere samples that each
        estimate is weighted against
    weight : (2 * 16,) float32 output, 0 for lanes whose point cannot see the emitter's front
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
        # Cosines at the texel and at the emitter.
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
        # Density per steradian, and the balance heuristic.
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

    Early out: sixteen neighbouring texels first trace one ray from each of their points. If none of these up
    to 256 rays is blocked, their other rays are not traced and are treated as unblocked. Where a share p of
    the light is hidden, the expected error is p (1 - p)^256 of it, at most 0.15 %. If there are few emitters
    and none is textured, the closed form replaces the samples of such texels, and hemisphere rays add
    nothing.

    origin, normal : (m, 16, 3) float32, metres, world, and unit; points of entries begin to begin + m
    emitters : TileEmitters; shading : Shading or None, from `emitters.needed_shading`
    buffers : PacketBuffers; begin : number of the first texel, for its random numbers
    sobol_points : (n, 2) uint32, one row a shadow ray; shared : uint32, see `sampling`
    hemisphere : (2,) float64, hemisphere samples that each estimate is weighted against
    analytic : (m,) uint8, set to 1 for texels whose light is complete in both estimates
    out : (m, 6) float32, lx, added to: two estimates of RGB, which differ in their MIS weights
    second : (m,) float32 output, sum over 16 batches of the square of the first estimate's share
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
    # Allow the closed form if emitters are few (one at all points costs as much as some samples), untextured
    # and opaque. Alpha of other triangles is found by the early-out tests.
    untextured = len(row) * _SAMPLES_PER_EMITTER <= n_samples
    for m in range(len(row) if untextured else 0):
        untextured = untextured and row[m, TEXTURED] == _f(0.0)
        if shading is not None:
            untextured = untextured and (not any_alpha or shading.alpha.slot[triangle[m]] < 0)
    found = _vectors()
    radiance = _rgba()
    # Sums over the few samples of one point are float32, those over all points float64.
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
        # Compute the closed form; without any light of it the texels are complete.
        if untextured:
            unoccluded_irradiance(origin, normal, group, lanes, row, found)
            lit = False
            for j in range(3 * PACKET_WIDTH):
                lit = lit or found[j] != _f(0.0)
            if not lit:
                for lane in range(lanes):
                    analytic[group + lane] = 1
                continue
        # Round 0 traces one early-out test for each point, round 1 the other samples.
        for turn in range(rounds):
            clear = turn == 1 and blocked == 0 and tested >= _MIN_TESTS * lanes
            if clear and untextured:
                break
            for k in range(N_POINTS):
                start, end = -(-k * n_samples // N_POINTS), -(-(k + 1) * n_samples // N_POINTS)
                if start == end:
                    continue
                # Use a different sample of each point as the early-out test, so that these tests are
                # stratified.
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
                        # Weight by alpha: cut-out parts emit nothing. Gather rays already pass through them.
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
                        # Treat a BLEND surface on the way as a blocker, since each ray has its own
                        # transmittance. Without any, all are 1, and remain so for the rays that are not
                        # traced.
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
        # Use the closed form where no ray is blocked. It has no variance, so `second` is unchanged.
        if untextured and blocked == 0 and tested >= _MIN_TESTS * lanes and n_samples >= N_POINTS:
            for lane in range(lanes):
                analytic[group + lane] = 1
                for c in range(3):
                    out[group + lane, c] += found[c * PACKET_WIDTH + lane]
                    out[group + lane, 3 + c] += found[c * PACKET_WIDTH + lane]
            continue
        # Else sum over the points.
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
    """Return the factor from the radiance of emitter m, hit by a hemisphere ray, to its share of irradiance.

    row : (T, 16) float32, see `TriangleLookup`; prim : triangle hit
    emitter_row (M, 24), chance, cumulative (C,) : see `emitters.TileEmitters`
    direction : unit direction of the ray; normal : unit normal of the texel's point; tuples of three float32
    distance : metres; n_light, n_hemisphere : samples of the balance heuristic
    0 for the back of a one-sided emitter.
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
