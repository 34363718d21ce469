# mypy: disable-error-code="no-untyped-def"
"""Casts rays from the sample points of texels to find the points inside geometry."""

from __future__ import annotations

import numpy as np

from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_frame, new_seeds
from baker.kernels.triangle_lookup import front_facing
from baker.trace.jit import kernel, smaller
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, NO_HIT, PACKET_WIDTH, PRIM_ID, trace_lanes

# Values of `hit_kind`: what a first hit on a triangle implies about the origin of the ray.
#
#     0             nothing
#     BLACK_BACK    the triangle's back is black; if all rays of a point hit such backs, the point is inside
#                   geometry
#     SOLID_BACK    if the ray hits the back, its origin is inside a solid
#     SOLID_FRONT   if the ray hits the front, its origin is inside a solid whose faces are wound inwards
BLACK_BACK, SOLID_BACK, SOLID_FRONT = 1, 2, 3
# Number of hits on solids from inside that prove a point to be inside. A single such hit is no proof, because
# the ray may have passed through an edge.
PROOF = 2
# Factor of n_elsewhere in `hits` = n_inside + ELSEWHERE * n_elsewhere. n_inside is the number of rays that
# hit a solid from inside. n_elsewhere is the number of rays that hit neither a solid from inside nor a black
# back.
ELSEWHERE = 16


@kernel
def inside_hits(
    origin, normal, lookup, hit_kind, buffers, begin, sobol_points, shared, rays_per_point, proof, hits
):
    """Cast rays from w points of each of m texels, and count their first hits by kind.

    Sixteen texels are processed together: first point 0 of each texel, then point 1, and so on. When each of
    the sixteen current points is known to be inside or outside, their remaining rays are skipped.

    origin, normal : (m, w, 3) float32, metres and unit vectors, world; each point casts `rays_per_point`
        cosine-weighted rays
    lookup : TriangleLookup; hit_kind : (T,) uint8, see `BLACK_BACK`
    buffers : PacketBuffers
    begin : number of the first texel, which seeds the random numbers and is the row of `hits`
    sobol_points : (w * rays_per_point, 2) uint32; shared : uint32, from `kernels.sampling.shared_bits_mask`
    proof : number of hits on solids from inside that prove a point to be inside
    hits : (n, w) uint8, counts are added, see `ELSEWHERE`
    Returns the number of rays cast.
    """
    scene, intersect, width = buffers.scene, buffers.intersect, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row = lookup.row
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
            # Skip the ray if all lanes are decided.
            decided = 0
            for lane in range(lanes):
                count = np.int64(hits[begin + group + lane, point])
                inside, elsewhere = count % ELSEWHERE, count // ELSEWHERE
                # A point is outside if a ray went elsewhere and the remaining rays are too few for a proof.
                outside = elsewhere > 0 and inside + rays_per_point - turn < proof
                decided += 1 if inside >= proof or outside else 0
            if decided == lanes:
                continue
            # Trace one ray from each lane's point.
            cast += lanes
            aim_lanes(
                rays, words, frame, seeds, sobol_points[sample, 0], sobol_points[sample, 1], shared, FAR
            )
            trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
            # Count the hits by kind.
            for lane in range(lanes):
                kind = np.int64(0)
                front = 0
                if words[GEOM_ID * PACKET_WIDTH + lane] != NO_HIT:
                    prim = np.int64(words[PRIM_ID * PACKET_WIDTH + lane])
                    dx, dy, dz = (
                        rays[DIR_X * PACKET_WIDTH + lane],
                        rays[DIR_Y * PACKET_WIDTH + lane],
                        rays[DIR_Z * PACKET_WIDTH + lane],
                    )
                    kind = np.int64(hit_kind[prim])
                    if kind > 0 and front_facing(row, prim, dx, dy, dz):
                        front = 1
                if (kind == SOLID_BACK and front == 0) or (kind == SOLID_FRONT and front == 1):
                    hits[begin + group + lane, point] += 1
                elif kind != BLACK_BACK or front == 1:
                    hits[begin + group + lane, point] += ELSEWHERE
    return cast
