# mypy: disable-error-code="no-untyped-def"
"""Form factors of patches by cosine-weighted rays, and products with their matrix.

    F_ij = share of what leaves patch i that arrives at j = share of i's cosine rays that hit j

Based on: Malley, A shading method for computer generated images, 1988; Goral et al., Modeling the
interaction of light between diffuse surfaces, 1984; Cohen and Wallace, Radiosity and realistic image
synthesis, 1993.
"""

from __future__ import annotations

import numpy as np

from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_frame, new_seeds
from baker.kernels.transmittance import trace_transmittance, transmittance
from baker.kernels.triangle_lookup import front_facing, hit_pixel
from baker.radiosity.kernels.side_table import find_side, new_hits, note_hit
from baker.trace.jit import inner, kernel, larger, smaller
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
    trace_lanes,
)  # fmt: skip

# Targets of rays that hit no patch; SPLIT - s: the split texel in row s of the table of sides.
LOST, SKY, SPLIT = -1, -2, -3


@kernel
def cast_form_factors(
    origin, normal, table, seen, buffers, begin, sobol_points, shared, target, tally, colour
):
    """Cast the rays of patches.

    origin, normal : (m, R, 3) float32, one point for each ray of patches begin to begin + m
    seen : `side_table.SeenPatch`, patches that hits lie on
    sobol_points : (R, 2) uint32
    target : (m, R) int32 output, patch hit, LOST or SKY
    tally : (P, 2) int32 output: rays that left the scene; rays lost on black backs or uncovered texels
    colour : (m, R, 3) float32 output, what light along a ray is multiplied by; no rows if nothing colours it
    """
    scene, intersect, width = buffers.scene, buffers.intersect, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row, size, n_pixels = table.row, table.size, table.n_pixels
    patch, of_side = seen.image, seen.value
    side_point, side_normal, side_height = seen.sides.point, seen.sides.normal, seen.sides.height
    side_member, side_length = seen.sides.member, seen.sides.side
    hits = new_hits()
    seeds, frame = new_seeds(), new_frame()
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin) - group)
        lane_seeds(begin + group, lanes, 30, seeds)
        for lane in range(PACKET_WIDTH):
            on[lane] = -1 if lane < lanes else 0
        for r in range(len(sobol_points)):
            load_frames(rays, frame, origin, normal, group, lanes, r)
            aim_lanes(rays, words, frame, seeds, sobol_points[r, 0], sobol_points[r, 1], shared, FAR)
            trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
            trace_transmittance(buffers.blend, buffers.occluded, width, on, rays, words, spare_on, spare)
            _note_colour(buffers.blend, colour, group, lanes, r)
            n_split = 0
            for lane in range(lanes):
                p = group + lane
                target[p, r] = LOST
                if words[GEOM_ID * PACKET_WIDTH + lane] == NO_HIT:
                    target[p, r] = SKY
                    tally[begin + p, 0] += 1
                    continue
                prim = np.int64(words[PRIM_ID * PACKET_WIDTH + lane])
                front = front_facing(
                    row, prim, rays[DIR_X * PACKET_WIDTH + lane], rays[DIR_Y * PACKET_WIDTH + lane],
                    rays[DIR_Z * PACKET_WIDTH + lane],
                )  # fmt: skip
                u, v = rays[HIT_U * PACKET_WIDTH + lane], rays[HIT_V * PACKET_WIDTH + lane]
                pixel = hit_pixel(row, size, n_pixels, prim, u, v, front)
                if pixel >= 0:
                    target[p, r] = patch[pixel]
                if target[p, r] <= SPLIT:
                    note_hit(hits, lane, rays, row, prim, front)
                    n_split += 1
                elif target[p, r] < 0:
                    tally[begin + p, 1] += 1
            if n_split > 0:
                for lane in range(lanes):
                    p = group + lane
                    at = SPLIT - np.int64(target[p, r])
                    if at >= 0:
                        found = find_side(
                            side_point, side_normal, side_height, side_member, side_length,
                            at, hits, lane, buffers,
                        )  # fmt: skip
                        target[p, r] = LOST
                        if found >= 0:
                            target[p, r] = of_side[found]
                        else:
                            tally[begin + p, 1] += 1
                for lane in range(PACKET_WIDTH):
                    on[lane] = -1 if lane < lanes else 0


@inner
def _note_colour(blend, colour, group, lanes, r):
    if blend is None or len(colour) == 0:
        return
    for lane in range(lanes):
        for c in range(3):
            colour[group + lane, r, c] = transmittance(blend, c, lane)


@kernel
def multiply(first, column, value, exitance, irradiance):
    """Write irradiance = F exitance, both (P, 3) float64."""
    for i in range(len(first) - 1):
        red = green = blue = 0.0
        for k in range(first[i], first[i + 1]):
            j = column[k]
            f = value[k]
            red += f * exitance[j, 0]
            green += f * exitance[j, 1]
            blue += f * exitance[j, 2]
        irradiance[i, 0] = red
        irradiance[i, 1] = green
        irradiance[i, 2] = blue


@kernel
def multiply_coloured(first, column, value, transmittance, exitance, irradiance):
    """Write the same where light is multiplied by `transmittance` (nnz, 3) float32 on its way."""
    for i in range(len(first) - 1):
        red = green = blue = 0.0
        for k in range(first[i], first[i + 1]):
            j = column[k]
            f = value[k]
            red += f * transmittance[k, 0] * exitance[j, 0]
            green += f * transmittance[k, 1] * exitance[j, 1]
            blue += f * transmittance[k, 2] * exitance[j, 2]
        irradiance[i, 0] = red
        irradiance[i, 1] = green
        irradiance[i, 2] = blue


@kernel
def transpose(first, column, value, at, out_column, out_value):
    """Write column and value of the transpose of a square CSR matrix; columns rise.

    at : (P,) int64, where each row of the transpose begins; moved to where it ends
    """
    for i in range(len(first) - 1):
        for k in range(first[i], first[i + 1]):
            j = column[k]
            out_column[at[j]] = i
            out_value[at[j]] = value[k]
            at[j] += 1


@kernel
def merge_reciprocal_estimates(
    first, column, value, other_first, other_column, other_value, area, out_first, out_column, out_value
):
    """Merge F_ij with its reciprocal estimate A_j F_ji / A_i, row by row.

    `other` is the transpose of F in CSR: row i has the entries F_ji. The variance of A_i F_ij is
    proportional to A_i, so the best weights are A_j for the own estimate and A_i for the other's.
    Returns sum A_i F_ij and sum |A_i F_ij - A_j F_ji| of the two raw estimates.
    """
    at = 0
    exchanged = 0.0
    unlike = 0.0
    for i in range(len(first) - 1):
        out_first[i] = at
        a = first[i]
        b = other_first[i]
        while a < first[i + 1] or b < other_first[i + 1]:
            ca = column[a] if a < first[i + 1] else 2147483647
            cb = other_column[b] if b < other_first[i + 1] else 2147483647
            j = smaller(ca, cb)
            both = area[i] + area[j]
            own = 0.0
            other = 0.0
            if ca == j:
                own = value[a]
                a += 1
            if cb == j:
                other = other_value[b]
                b += 1
            exchanged += area[i] * own
            unlike += abs(area[i] * own - area[j] * other)
            out_column[at] = j
            out_value[at] = (own + other) * area[j] / both
            at += 1
    out_first[len(first) - 1] = at
    return exchanged, unlike


@kernel
def sinkhorn_balance(first, column, value, goal, slack, factor, steps):
    """Turn F_ij into d_i F_ij d_j, with factors d (P,) that make row sums `goal`; A_i F_ij stays symmetric.

    `slack` (P,) is how uncertain a goal is: d_i sum_j F_ij d_j = goal_i + slack_i (1 - d_i). Without it a
    large patch whose few rays all missed a small one would take from the small one what that saw well.
    In log d this is the minimum of a convex function, sum A_i F_ij d_i d_j / 2 - ..., and each step the exact
    minimum along one coordinate: it needs no damping (15 passes where damped ones took over 30).
    `value` is changed in place. Returns the largest distance of a row sum from its goal before that.
    Based on: Knight, The Sinkhorn-Knopp algorithm: convergence and applications, 2008.
    """
    error = 0.0
    for i in range(len(first) - 1):
        total = 0.0
        for k in range(first[i], first[i + 1]):
            total += value[k]
        error = max(error, abs(total - goal[i]))
    for _ in range(steps):
        most = 0.0
        for i in range(len(first) - 1):
            total = 0.0
            for k in range(first[i], first[i + 1]):
                total += value[k] * factor[column[k]]
            if total > 0.0:
                new = (goal[i] + slack[i]) / (total + slack[i])
                most = larger(most, abs(new - factor[i]))
                factor[i] = new
        if most < 1.0e-6:
            break
    for i in range(len(first) - 1):
        for k in range(first[i], first[i + 1]):
            value[k] *= factor[i] * factor[column[k]]
    return error
