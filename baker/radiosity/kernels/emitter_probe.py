# mypy: disable-error-code="no-untyped-def"
"""Casts shadow rays to find which clusters of emitters are visible from the texels of a tile."""

from __future__ import annotations

import numpy as np

from baker.kernels.emitters import CORNER, CORNER_1, CORNER_2, CUMULATIVE, NORMAL, TWO_SIDED
from baker.kernels.sampling import hash_combine, triangle_barycentric
from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import trace_shadow_lanes
from baker.trace.jit import inner, kernel, smaller
from baker.trace.packets import DIR_X, ORG_X, PACKET_WIDTH, TFAR

_f = np.float32
# TFAR of shadow rays, as a share of the distance to the emitter: the rays end before they hit the emitter.
_SHORT = np.float32(0.9999)
# Hash input for dimension 0 of a ray's uniform numbers; dimension d uses _SALT + d.
_SALT = 77
_INV_2_24 = np.float32(5.9604645e-08)


@kernel
def probe_clusters(origin, normal, row, first, buffers, bounds, chosen, n_rays, asked, seen):
    """Trace shadow rays from blocks of texels to each cluster, and count the unblocked rays.

    origin, normal : (m, 16, 3) float32, metres and unit vectors, world; points of the texels of a tile
    row (M, 24) float32, first (C + 1,) int32 : see `kernels.emitters.Emitters`
    buffers : PacketBuffers
    bounds : (B + 1,) int64, block b contains the texels bounds[b] to bounds[b + 1] - 1
    chosen : (C,) bool, clusters to probe
    n_rays : number of rays from each block to each cluster; their origins are distributed over the block
    asked : (B, C) int32 output, number of rays with positive cosines at the texel and at the emitter
    seen : (B, C) int32 output, how many of these rays are unblocked
    """
    scene, occluded, width = buffers.scene, buffers.occluded, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    for b in range(len(bounds) - 1):
        begin, size = bounds[b], bounds[b + 1] - bounds[b]
        for c in range(len(chosen)):
            asked[b, c] = seen[b, c] = 0
            for group in range(0, n_rays if chosen[c] else 0, PACKET_WIDTH):
                # Aim a packet of rays, each from a point in its stratum of the block.
                for lane in range(PACKET_WIDTH):
                    on[lane] = 0
                    r = group + lane
                    if r < n_rays:
                        code = np.uint32((b * len(chosen) + c) * n_rays + r)
                        i = begin + smaller(np.int64((r + _uniform(code, 0)) * size / n_rays), size - 1)
                        k = smaller(np.int64(_uniform(code, 1) * N_POINTS), N_POINTS - 1)
                        for a in range(3):
                            rays[(ORG_X + a) * PACKET_WIDTH + lane] = origin[i, k, a]
                        on[lane] = _aim(rays, lane, normal, i, k, row, first[c], first[c + 1], code)
                        asked[b, c] -= on[lane]
                # Trace the packet, and count the unblocked rays.
                trace_shadow_lanes(
                    buffers.blend, occluded, scene, width, query, on, rays, words, spare_on, spare
                )
                for lane in range(PACKET_WIDTH):
                    if on[lane] != 0 and rays[TFAR * PACKET_WIDTH + lane] >= _f(0.0):
                        seen[b, c] += 1


@inner
def _uniform(code, dimension):
    """Return a float32 in [0, 1) that depends on a ray's number and the dimension."""
    return _f(hash_combine(code, np.uint32(_SALT + dimension)) >> np.uint32(8)) * _INV_2_24


@inner
def _aim(rays, lane, normal, i, k, row, start, end, code):
    """Write a ray from a texel's point to a random point of a cluster.

    rays : (21 * 16,) float32, a packet with origins; the direction and TFAR of `lane` are set
    normal : (m, 16, 3) float32, unit; the ray starts at point [i, k]
    row : (M, 24) float32, see `kernels.emitters.Emitters`
    start, end : the cluster contains the emitters `start` to `end` - 1
    code : uint32, number of the ray
    Returns -1 if the cosines at the texel and at the emitter are positive, else 0.
    """
    # Choose an emitter of the cluster in proportion to its power.
    u = _uniform(code, 2)
    m, high = np.int64(start), np.int64(end) - 1
    while m < high:
        middle = (m + high) // 2
        if row[middle, CUMULATIVE] > u:
            high = middle
        else:
            m = middle + 1
    # Sample a point on the emitter.
    b1, b2 = triangle_barycentric(_uniform(code, 3), _uniform(code, 4))
    received = sent = _f(0.0)
    for a in range(3):
        corner = row[m, CORNER + a]
        point = corner + b1 * (row[m, CORNER_1 + a] - corner) + b2 * (row[m, CORNER_2 + a] - corner)
        direction = point - rays[(ORG_X + a) * PACKET_WIDTH + lane]
        rays[(DIR_X + a) * PACKET_WIDTH + lane] = direction
        received += direction * normal[i, k, a]
        sent -= direction * row[m, NORMAL + a]
    rays[TFAR * PACKET_WIDTH + lane] = _SHORT
    if row[m, TWO_SIDED] > _f(0.0):
        sent = abs(sent)
    return np.int32(-1) if received > _f(0.0) and sent > _f(0.0) else np.int32(0)
