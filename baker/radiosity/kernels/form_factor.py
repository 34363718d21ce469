# mypy: disable-error-code="no-untyped-def"
"""Estimates form factors of patches with cosine-weighted rays, and multiplies and balances their matrix.

    F_ij = share of the light leaving patch i that arrives at patch j
         = share of the cosine-weighted rays of patch i that hit patch j

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

# Values of `target` that are not patches:
#
#     LOST        the ray ended on the back of a one-sided surface, or on a surface without a texel
#     SKY         the ray left the scene
#     SPLIT - s   the ray hit a split texel, which another surface divides into sides (`radiosity.sides`);
#                 s is the texel's row in the `SideTable`
LOST, SKY, SPLIT = -1, -2, -3
# Columns of `tally`: number of rays that left the scene, and number of rays whose target is LOST.
ESCAPED, ABSORBED = 0, 1


@kernel
def cast_form_factors(
    origin, normal, lookup, seen, buffers, begin, sobol_points, shared, target, tally, colour
):
    """Trace R rays from each of m patches, and write the patch that each ray hits.

    origin, normal : (m, R, 3) float32; origins of the rays in metres, and unit normals; world space
    lookup : TriangleLookup; seen : SeenPatch, maps hits to patches
    buffers : PacketBuffers; begin : number of the first patch, which seeds the random numbers
    sobol_points : (R, 2) uint32, one row per ray; shared : uint32, from `kernels.sampling.shared_bits_mask`
    target : (m, R) int32 output, patch that was hit, LOST or SKY
    tally : (P, 2) int32, columns ESCAPED and ABSORBED; counts are added
    colour : (m, R, 3) float32 output, RGB transmittance of each ray; (0, R, 3) if no surface colours light
    """
    scene, intersect, width = buffers.scene, buffers.intersect, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row, size, n_pixels = lookup.row, lookup.size, lookup.n_pixels
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
            # Trace ray r of sixteen patches.
            load_frames(rays, frame, origin, normal, group, lanes, r)
            aim_lanes(rays, words, frame, seeds, sobol_points[r, 0], sobol_points[r, 1], shared, FAR)
            trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
            trace_transmittance(buffers.blend, buffers.occluded, width, on, rays, words, spare_on, spare)
            _note_colour(buffers.blend, colour, group, lanes, r)
            # Find the patch of each hit; store hits on split texels for the next step.
            n_split = 0
            for lane in range(lanes):
                p = group + lane
                target[p, r] = LOST
                if words[GEOM_ID * PACKET_WIDTH + lane] == NO_HIT:
                    target[p, r] = SKY
                    tally[begin + p, ESCAPED] += 1
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
                    tally[begin + p, ABSORBED] += 1
            # Find the side of each hit on a split texel. `find_side` overwrites the packet.
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
                            tally[begin + p, ABSORBED] += 1
                for lane in range(PACKET_WIDTH):
                    on[lane] = -1 if lane < lanes else 0


@inner
def _note_colour(blend, colour, group, lanes, r):
    """Write the transmittance of ray r of the patches `group` to `group + lanes - 1`.

    blend : `PacketBuffers.blend`
    colour : (m, R, 3) float32 output; with shape (0, R, 3), nothing is written
    """
    if blend is None or len(colour) == 0:
        return
    for lane in range(lanes):
        for c in range(3):
            colour[group + lane, r, c] = transmittance(blend, c, lane)


@kernel
def multiply(first, column, value, exitance, irradiance):
    """Write the product of F and `exitance` to `irradiance`.

    first (P + 1,) int64, column (nnz,) int32, value (nnz,) float32 : F in CSR
    exitance : (P, 3) float64, lx; irradiance : (P, 3) float64 output, lx
    """
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
    """Write the irradiance sum_j T_ij F_ij M_j of each patch i, where T_ij is the RGB transmittance.

    first (P + 1,) int64, column (nnz,) int32, value (nnz,) float32 : F in CSR
    transmittance : (nnz, 3) float32, T; exitance : (P, 3) float64, M, lx
    irradiance : (P, 3) float64 output, lx
    """
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
    """Write the transpose of a square CSR matrix. In each row of the transpose, columns ascend.

    first (P + 1,) int64, column (nnz,) int32, value (nnz,) float32 : the matrix
    at : (P,) int64, on entry, index of the first element of each row of the transpose; on return, index after
        its last element
    out_column (nnz,) int32, out_value (nnz,) float32 : output
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

        F_ij' = (F_ij + F_ji) A_j / (A_i + A_j)

    All patches cast the same number of rays, R. So the variance of the estimate of A_i F_ij is about A_i x /
    R, with x = A_i F_ij. Because A_i F_ij = A_j F_ji, the variances of both estimates are in the ratio A_i :
    A_j. Therefore the optimal weight of F_ij is A_j / (A_i + A_j), and the optimal weight of the reciprocal
    estimate is A_i / (A_i + A_j).

    first (P + 1,) int64, column (nnz,) int32, value (nnz,) float32 : F in CSR, columns of a row ascend
    other_first, other_column, other_value : transpose of F, whose row i contains F_ji
    area : (P,) float64, m2
    out_first (P + 1,), out_column (2 nnz,), out_value (2 nnz,) : output, merged F in CSR; items of
        `out_column` and `out_value` beyond out_first[P] are not written
    Returns sum A_i F_ij and sum |A_i F_ij - A_j F_ji|, both of the matrix before merging.
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
    """Replace F_ij by d_i F_ij d_j, with factors d for which the row sums are close to `goal`.

    So A_i F_ij stays symmetric. The factors satisfy

        d_i sum_j F_ij d_j = goal_i + slack_i (1 - d_i)

    If the rays of a large patch all miss a small patch, the measured row sum of the large patch is too low.
    Without slack, its factor d would become too small. This d also multiplies the accurate form factor from
    the small patch to the large patch. The slack limits how far d differs from 1.

    The solution minimises a convex function of log d. Each update of one factor d_i finds the exact minimum
    along that coordinate, so no damping is needed.

    first (P + 1,) int64, column (nnz,) int32, value (nnz,) float32 : F in CSR; value is changed in place
    goal : (P,) float64, measured row sums; slack : (P,) float64, uncertainty of each measured row sum
    factor : (P,) float64, d; ones on entry
    steps : int, largest number of passes; a pass updates all P factors
    Returns the largest |row sum - goal| before balancing.
    Based on: Knight, The Sinkhorn-Knopp algorithm: convergence and applications, 2008.
    """
    # Compute the largest error of a row sum.
    error = 0.0
    for i in range(len(first) - 1):
        total = 0.0
        for k in range(first[i], first[i + 1]):
            total += value[k]
        error = max(error, abs(total - goal[i]))
    # Update all factors in turn, pass after pass, until the largest change of a factor is small.
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
    # Apply the factors.
    for i in range(len(first) - 1):
        for k in range(first[i], first[i + 1]):
            value[k] *= factor[i] * factor[column[k]]
    return error
