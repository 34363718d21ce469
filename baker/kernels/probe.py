"""A few rays from every texel to find points that lie inside other geometry."""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.kernels.hits import front_facing
from baker.kernels.rays import FAR, aim_texel
from baker.kernels.sampling import hash_combine, texel_scramble
from baker.kernels.surface import N_POINTS, place_points
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, NO_HIT, PRIM_ID, new_packet, trace

_f = np.float32
_u = np.uint32


@njit(cache=True, nogil=True)
def back_face_hits(surface, table, tracer, chosen, begin, end, net, rays_per_point, stride, hits):  # type: ignore[no-untyped-def]
    """Count, for texels chosen[begin:end], rays that hit the back of a one-sided surface.

    Each stride-th of a texel's 16 points casts `rays_per_point` cosine-weighted rays; `hits` (n, 16)
    uint8 gets the counts, by position in `chosen`. net : (16 / stride * rays_per_point, 2) uint32.
    """
    width, scene, intersect = tracer.width, tracer.scene, tracer.intersect
    row, pixel = table.row, surface.pixel
    valid, floats, words = new_packet(width)
    origin = np.zeros((width, N_POINTS, 3), np.float32)
    normal = np.zeros((width, N_POINTS, 3), np.float32)
    hit = np.zeros((width, N_POINTS), np.int32)
    bary = np.zeros((width, N_POINTS, 2), np.float32)
    for group in range(begin, end, width):
        lanes = min(width, end - group)
        for lane in range(lanes):
            i = chosen[group + lane]
            place_points(
                surface, i, i + 1, origin[lane : lane + 1], normal[lane : lane + 1], hit[lane : lane + 1],
                bary[lane : lane + 1],
            )  # fmt: skip
        for lane in range(width):
            valid[lane] = -1 if lane < lanes else 0
        sample = 0
        for point in range(0, N_POINTS, stride):
            for _ in range(rays_per_point):
                for lane in range(lanes):
                    seed = _u(pixel[chosen[group + lane]])
                    u = texel_scramble(net[sample, 0], hash_combine(seed, _u(21)), _u(0))
                    v = texel_scramble(net[sample, 1], hash_combine(seed, _u(22)), _u(0))
                    aim_texel(floats, words, width, lane, origin, normal, lane, point, u, v, FAR)
                sample += 1
                trace(intersect, scene, valid, floats)
                for lane in range(lanes):
                    if words[GEOM_ID * width + lane] == NO_HIT:
                        continue
                    prim = np.int64(words[PRIM_ID * width + lane])
                    if row[prim, 7] == _f(0.0) and not front_facing(
                        row, prim, floats[DIR_X * width + lane], floats[DIR_Y * width + lane],
                        floats[DIR_Z * width + lane],
                    ):  # fmt: skip
                        hits[group + lane, point] += 1
