# mypy: disable-error-code="no-untyped-def"
"""A few rays from points of texels to find those that lie inside other geometry."""

from __future__ import annotations

import numpy as np

from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_frame, new_seeds
from baker.kernels.triangle_lookup import front_facing
from baker.trace.jit import kernel, smaller
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, NO_HIT, PACKET_WIDTH, PRIM_ID, trace_lanes

# What a triangle tells of a ray that meets it first. 0: nothing; 1: it sees a black back; 2, 3: it comes from
# the inside of a solid, because it meets the back, or the front of a face wound the wrong way.
BLACK_BACK, SOLID_BACK, SOLID_FRONT = 1, 2, 3
# So many rays from the inside of a solid prove that their point lies there: one may slip through an edge.
PROOF = 2
# Counts of a point: rays from the inside of solids in the low half, rays that saw anything else in the high.
ELSEWHERE = 16


@kernel
def inside_hits(
    origin, normal, table, tells, buffers, begin, sobol_points, shared, rays_per_point, proof, hits
):
    """Count what the rays of points say about being inside, until that is clear.

    origin, normal : (m, w, 3) float32; every point casts `rays_per_point` cosine-weighted rays
    tells : (T,) uint8, see above
    begin : number of the first of the m items, for its random numbers and its row of `hits`
    sobol_points : (w * rays_per_point, 2) uint32; shared : uint32, see `sampling`
    proof : rays from the inside of solids that settle a point
    hits : (n, w) uint8, counts are added, see `ELSEWHERE`
    Returns the number of rays cast.
    """
    scene, intersect, width = buffers.scene, buffers.intersect, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row = table.row
    seeds, frame = new_seeds(), new_frame()
    cast = 0
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin) - group)
        lane_seeds(begin + group, lanes, 10, seeds)
        for lane in range(PACKET_WIDTH):
            on[lane] = -1 if lane < lanes else 0
        for sample in range(len(sobol_points)):
            point = sample // rays_per_point
            turn = sample % rays_per_point
            if turn == 0:
                load_frames(rays, frame, origin, normal, group, lanes, point)
            clear = 0
            for lane in range(lanes):
                count = np.int64(hits[begin + group + lane, point])
                inside, elsewhere = count % ELSEWHERE, count // ELSEWHERE
                # Too few rays are left for a proof, and some saw the open.
                lost = elsewhere > 0 and inside + rays_per_point - turn < proof
                clear += 1 if inside >= proof or lost else 0
            if clear == lanes:
                continue
            cast += lanes
            aim_lanes(
                rays, words, frame, seeds, sobol_points[sample, 0], sobol_points[sample, 1], shared, FAR
            )
            trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
            for lane in range(lanes):
                told = np.int64(0)
                front = 0
                if words[GEOM_ID * PACKET_WIDTH + lane] != NO_HIT:
                    prim = np.int64(words[PRIM_ID * PACKET_WIDTH + lane])
                    dx, dy, dz = (
                        rays[DIR_X * PACKET_WIDTH + lane],
                        rays[DIR_Y * PACKET_WIDTH + lane],
                        rays[DIR_Z * PACKET_WIDTH + lane],
                    )
                    told = np.int64(tells[prim])
                    if told > 0 and front_facing(row, prim, dx, dy, dz):
                        front = 1
                if (told == SOLID_BACK and front == 0) or (told == SOLID_FRONT and front == 1):
                    hits[begin + group + lane, point] += 1
                elif told != BLACK_BACK or front == 1:
                    hits[begin + group + lane, point] += ELSEWHERE
    return cast
