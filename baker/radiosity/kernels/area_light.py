# mypy: disable-error-code="no-untyped-def"
"""Irradiance of texels from emissive triangles: shadow rays to sampled points, weighted for MIS.

    E = 1/n sum L cos / (p_light + (n_hemisphere / n) p_cosine)

The balance heuristic leaves the rest to hemisphere rays that hit the same emitters. Where nothing is found
to stand in between, the closed form takes the place of both (`polygon_light`).
Based on: Veach and Guibas, Optimally combining sampling techniques, 1995.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.alpha import opacity_at
from baker.kernels.emitters import (
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
# Shadow rays end this share of their length before the light.
_SHORT = np.float32(0.9999)
# The closed form is used for up to one emitter for so many samples.
_SAMPLES_AN_EMITTER = 8
# Memory of `light_samples`.
_rgba, _numbers, _lamps = (
    scratch((4,), np.float64),
    scratch((PACKET_WIDTH,), np.int64),
    scratch((17 * PACKET_WIDTH,), _f),
)
_pairs, _vectors = scratch((2 * PACKET_WIDTH,), _f), scratch((3 * PACKET_WIDTH,), _f)
_parts = scratch((N_POINTS, 6 * PACKET_WIDTH), _f)


@inner
def mis_weighted(cosine, density, n_light, n_hemisphere):
    """Return cosine / (n_light p_light + n_hemisphere p_cosine), densities per steradian."""
    return cosine / (n_light * density + n_hemisphere * cosine * _INV_PI)


@inner
def load_points(rays, facing, origin, normal, group, lanes, k):
    """Write origins of point k of texels group to group + lanes to `rays`, normals to `facing` (3 * 16,)."""
    for lane in range(lanes):
        for a in range(3):
            rays[(ORG_X + a) * PACKET_WIDTH + lane] = origin[group + lane, k, a]
            facing[a * PACKET_WIDTH + lane] = normal[group + lane, k, a]


@inner
def choose_lanes(row, starts, chance, cumulative, first, second, seeds, shared, uv, chosen, lamp):
    """Choose an emitter for every lane and copy what is needed of it.

    row, starts, chance, cumulative : see `emitters.TileEmitters`
    first, second : uint32, the sample's bit-reversed Sobol numbers
    uv : (2 * 16,) float32, place on the emitter; chosen : (16,) int64
    lamp : (17 * 16,) float32: corner 0, edges, normal, density per m2, 1 if two-sided, radiance
    """
    for lane in range(PACKET_WIDTH):
        uv[lane] = texel_scramble(first, seeds[lane], shared)
        uv[PACKET_WIDTH + lane] = texel_scramble(second, seeds[PACKET_WIDTH + lane], shared)
    same = True
    for lane in range(PACKET_WIDTH):
        m, density, u = choose_emitter(row, starts, chance, cumulative, uv[lane])
        uv[lane] = u
        chosen[lane] = m
        lamp[12 * PACKET_WIDTH + lane] = density
        same = same and m == chosen[0]
    if same:
        # The rule: neighbouring texels share the first bits of their numbers.
        m = chosen[0]
        for a in range(3):
            for lane in range(PACKET_WIDTH):
                lamp[a * PACKET_WIDTH + lane] = row[m, a]
                lamp[(3 + a) * PACKET_WIDTH + lane] = row[m, 3 + a] - row[m, a]
                lamp[(6 + a) * PACKET_WIDTH + lane] = row[m, 6 + a] - row[m, a]
                lamp[(9 + a) * PACKET_WIDTH + lane] = row[m, NORMAL + a]
                lamp[(14 + a) * PACKET_WIDTH + lane] = row[m, RADIANCE + a]
        for lane in range(PACKET_WIDTH):
            lamp[13 * PACKET_WIDTH + lane] = row[m, TWO_SIDED]
        return
    for lane in range(PACKET_WIDTH):
        m = chosen[lane]
        for a in range(3):
            lamp[a * PACKET_WIDTH + lane] = row[m, a]
            lamp[(3 + a) * PACKET_WIDTH + lane] = row[m, 3 + a] - row[m, a]
            lamp[(6 + a) * PACKET_WIDTH + lane] = row[m, 6 + a] - row[m, a]
            lamp[(9 + a) * PACKET_WIDTH + lane] = row[m, NORMAL + a]
            lamp[(14 + a) * PACKET_WIDTH + lane] = row[m, RADIANCE + a]
        lamp[13 * PACKET_WIDTH + lane] = row[m, TWO_SIDED]


@inner
def aim_at_emitters(rays, facing, uv, lamp, n_light, first_n, second_n, weight):
    """Write the shadow ray of every lane and its two weights; lanes that see no light get weight 0.

    uv : (2 * 16,) float32, becomes the barycentrics b1 and b2 on the emitter
    n_light, first_n, second_n : float32, rays that share the work: shadow rays, hemisphere rays of both
    estimates; weight : (2 * 16,) float32
    """
    for lane in range(PACKET_WIDTH):
        b1, b2 = triangle_barycentric(uv[lane], uv[PACKET_WIDTH + lane])
        dx = lamp[lane] + b1 * lamp[3 * PACKET_WIDTH + lane] + b2 * lamp[6 * PACKET_WIDTH + lane]
        dy = (
            lamp[PACKET_WIDTH + lane]
            + b1 * lamp[4 * PACKET_WIDTH + lane]
            + b2 * lamp[7 * PACKET_WIDTH + lane]
        )
        dz = (
            lamp[2 * PACKET_WIDTH + lane]
            + b1 * lamp[5 * PACKET_WIDTH + lane]
            + b2 * lamp[8 * PACKET_WIDTH + lane]
        )
        dx -= rays[ORG_X * PACKET_WIDTH + lane]
        dy -= rays[ORG_Y * PACKET_WIDTH + lane]
        dz -= rays[ORG_Z * PACKET_WIDTH + lane]
        square = larger(dx * dx + dy * dy + dz * dz, _f(1.0e-30))
        length = math.sqrt(square)
        cosine = (
            dx * facing[lane] + dy * facing[PACKET_WIDTH + lane] + dz * facing[2 * PACKET_WIDTH + lane]
        ) / length
        light = (
            dx * lamp[9 * PACKET_WIDTH + lane]
            + dy * lamp[10 * PACKET_WIDTH + lane]
            + dz * lamp[11 * PACKET_WIDTH + lane]
        )
        light = -light / length
        light = abs(light) if lamp[13 * PACKET_WIDTH + lane] > _f(0.0) else light
        seen = cosine > _f(0.0) and light > _f(1.0e-6)
        steradian = lamp[12 * PACKET_WIDTH + lane] * square / larger(light, _f(1.0e-6))
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
    origin, normal, lamps, shading, buffers, begin, sobol_points, shared, hemisphere, exact, out, second
):
    """Add the light-sampled share of irradiance of texels, and return the number of shadow rays cast.

    Sixteen neighbouring texels first look: one ray from each of their points. If none of these up to 256
    rays is blocked, no further one of theirs is cast: where a share p of the light is hidden, the error that
    this can bring is p (1 - p)^256 of it on average, at most 0.15 %. A few even emitters then are not
    sampled either: they shine by their closed form, and hemisphere rays have nothing to add.

    origin, normal : (m, 16, 3) float32, points of entries begin to begin + m
    shading : from `emitters.needed_shading`
    sobol_points : (n, 2) uint32, one row a shadow ray; shared : uint32 mask of bits that texels share
    hemisphere : (2,) hemisphere rays to weigh against, one number for each column block of `out`
    exact : (m,) uint8, set to 1 for texels whose light is complete in both estimates
    out : (m, 6) float32, lx: two differently weighted estimates of RGB
    second : (m,) float32, sum over 16 batches of the square of the first estimate's share
    """
    n_samples = len(sobol_points)
    scene, occluded, width = buffers.scene, buffers.occluded, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row, triangle, starts = lamps.row, lamps.triangle, lamps.first
    chance, cumulative = lamps.chance, lamps.cumulative
    any_alpha = False
    if shading is not None:
        any_alpha = len(shading.alpha.slot) > 0
    # One emitter in closed form at all points costs as much as some samples.
    plain = len(row) * _SAMPLES_AN_EMITTER <= n_samples
    for m in range(len(row) if plain else 0):
        plain = plain and row[m, TEXTURED] == _f(0.0)
        if shading is not None:
            # Alpha of anything but the emitter is in the way, and found by the looks.
            plain = plain and (not any_alpha or shading.alpha.slot[triangle[m]] < 0)
    found = _vectors()
    radiance = _rgba()
    # Sums of one point's samples are short: float32; those of all points are not.
    part = _parts()
    uv, weight = _pairs(), _pairs()
    chosen, lamp = _numbers(), _lamps()
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
        looked = blocked = 0
        if plain:
            unoccluded_irradiance(origin, normal, group, lanes, row, found)
            lit = False
            for j in range(3 * PACKET_WIDTH):
                lit = lit or found[j] != _f(0.0)
            if not lit:
                for lane in range(lanes):
                    exact[group + lane] = 1
                continue
        for turn in range(rounds):
            clear = turn == 1 and blocked == 0 and looked >= 8 * lanes
            if clear and plain:
                break
            for k in range(N_POINTS):
                start, end = -(-k * n_samples // N_POINTS), -(-(k + 1) * n_samples // N_POINTS)
                if start == end:
                    continue
                # Which of a point's samples looks first goes round, so that the looks are spread, too.
                look = start + k % (end - start)
                load_points(rays, facing, origin, normal, group, lanes, k)
                for s in range(start, end):
                    if rounds == 2 and (s == look) != (turn == 0):
                        continue
                    choose_lanes(
                        row,
                        starts,
                        chance,
                        cumulative,
                        sobol_points[s, 0],
                        sobol_points[s, 1],
                        seeds,
                        shared,
                        uv,
                        chosen,
                        lamp,
                    )
                    aim_at_emitters(rays, facing, uv, lamp, n_light, first_n, second_n, weight)
                    asked = 0
                    for lane in range(PACKET_WIDTH):
                        on[lane] = -1 if lane < lanes and weight[lane] > _f(0.0) else 0
                        asked -= on[lane]
                    if shading is not None:
                        # What is not there does not shine; rays that find an emitter know that already.
                        for lane in range(lanes if any_alpha else 0):
                            m = chosen[lane]
                            b1, b2 = on_triangle(row, m, uv[lane], uv[PACKET_WIDTH + lane])
                            there = _f(opacity_at(shading, triangle[m], b1, b2))
                            weight[lane] *= there
                            weight[PACKET_WIDTH + lane] *= there
                    if asked == 0:
                        continue
                    if not clear:
                        trace_shadow_lanes(
                            buffers.blend, occluded, scene, width, query, on, rays, words, spare_on, spare
                        )
                        cast += asked
                        looked += asked
                        for lane in range(PACKET_WIDTH):
                            hidden = on[lane] != 0 and rays[TFAR * PACKET_WIDTH + lane] < _f(0.0)
                            on[lane] = 0 if hidden else on[lane]
                            blocked += 1 if hidden else 0
                        # Where a pane is in the way, each ray has its own transmittance; where none is,
                        # all are 1 and stay so for the rays that are not cast.
                        blocked += count_coloured(buffers.blend)
                    if shading is not None:
                        for lane in range(lanes):
                            m = chosen[lane]
                            if on[lane] and row[m, TEXTURED] > _f(0.0):
                                b1, b2 = on_triangle(row, m, uv[lane], uv[PACKET_WIDTH + lane])
                                emitted_radiance(shading, triangle[m], b1, b2, radiance)
                                for c in range(3):
                                    lamp[(14 + c) * PACKET_WIDTH + lane] = radiance[c]
                    for c in range(3):
                        for lane in range(PACKET_WIDTH):
                            light = lamp[(14 + c) * PACKET_WIDTH + lane] if on[lane] else _f(0.0)
                            light *= transmittance(buffers.blend, c, lane)
                            part[k, c * PACKET_WIDTH + lane] += light * weight[lane]
                            part[k, (3 + c) * PACKET_WIDTH + lane] += light * weight[PACKET_WIDTH + lane]
        if plain and blocked == 0 and looked >= 8 * lanes and n_samples >= N_POINTS:
            # No squares: there is no variance.
            for lane in range(lanes):
                exact[group + lane] = 1
                for c in range(3):
                    out[group + lane, c] += found[c * PACKET_WIDTH + lane]
                    out[group + lane, 3 + c] += found[c * PACKET_WIDTH + lane]
            continue
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
