"""A few rays from points of texels to find those that lie inside other geometry."""

from __future__ import annotations

import numpy as np

from baker.kernels.hits import front_facing
from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_frame, new_seeds
from baker.trace.jit import kernel, smaller
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, LANES, NO_HIT, PRIM_ID, trace_lanes


@kernel
def back_face_hits(origin, normal, table, caster, begin, net, shared, rays_per_point, most, hits):  # type: ignore[no-untyped-def]
    """Count rays that hit the back of a one-sided surface, until it is clear whether more than `most` do.

    origin, normal : (m, w, 3) float32; every point casts `rays_per_point` cosine-weighted rays
    begin : number of the first of the m items, for its random numbers and its row of `hits`
    net : (w * rays_per_point, 2) uint32; shared : uint32, see `sampling`
    hits : (n, w) uint8, counts are added
    Returns the number of rays cast.
    """
    scene, intersect, width = caster.scene, caster.intersect, caster.width
    query = caster.query
    on, rays, words = caster.lane_valid, caster.lane_floats, caster.lane_words
    spare_on, spare = caster.valid, caster.floats
    row = table.row
    seeds, frame = new_seeds(), new_frame()
    cast = 0
    for group in range(0, len(origin), LANES):
        lanes = smaller(LANES, len(origin) - group)
        lane_seeds(begin + group, lanes, 10, seeds)
        for lane in range(LANES):
            on[lane] = -1 if lane < lanes else 0
        for sample in range(len(net)):
            point = sample // rays_per_point
            turn = sample % rays_per_point
            if turn == 0:
                load_frames(rays, frame, origin, normal, group, lanes, point)
            clear = 0
            for lane in range(lanes):
                found = np.int64(hits[begin + group + lane, point])
                clear += 1 if found > most or turn - found >= rays_per_point - most else 0
            if clear == lanes:
                continue
            cast += lanes
            aim_lanes(rays, words, frame, seeds, net[sample, 0], net[sample, 1], shared, FAR)
            trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
            for lane in range(lanes):
                if words[GEOM_ID * LANES + lane] == NO_HIT:
                    continue
                prim = np.int64(words[PRIM_ID * LANES + lane])
                dx, dy, dz = (
                    rays[DIR_X * LANES + lane], rays[DIR_Y * LANES + lane], rays[DIR_Z * LANES + lane]
                )  # fmt: skip
                if row[prim, 7] == np.float32(0.0) and not front_facing(row, prim, dx, dy, dz):
                    hits[begin + group + lane, point] += 1
    return cast
