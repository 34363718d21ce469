# mypy: disable-error-code="no-untyped-def"
"""Finds which clusters of emitters the texels of a tile can see at all, by a few shadow rays."""

from __future__ import annotations

import numpy as np

from baker.kernels.emitters import CUMULATIVE, NORMAL, TWO_SIDED
from baker.kernels.sampling import hash_combine, triangle_barycentric
from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import trace_shadow_lanes
from baker.trace.jit import inner, kernel, smaller
from baker.trace.packets import DIR_X, ORG_X, PACKET_WIDTH, TFAR

_f = np.float32
# Shadow rays end this share of their length before the light.
_SHORT = np.float32(0.9999)
_SALT = 77
_INV_2_24 = np.float32(5.9604645e-08)


@kernel
def probe_clusters(origin, normal, row, first, buffers, bounds, chosen, n_rays, asked, seen):
    """Count the rays to each cluster that could carry light, and those that nothing blocks.

    origin, normal : (m, 16, 3) float32, points of neighbouring texels
    row, first : see `emitters.Emitters`
    bounds : (B + 1,) int64, where blocks of texels begin; chosen : (C,) bool, clusters that are asked about
    n_rays : rays from each block to each cluster; they start at points spread over the block
    asked, seen : (B, C) int32 output
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
                trace_shadow_lanes(
                    buffers.blend, occluded, scene, width, query, on, rays, words, spare_on, spare
                )
                for lane in range(PACKET_WIDTH):
                    if on[lane] != 0 and rays[TFAR * PACKET_WIDTH + lane] >= _f(0.0):
                        seen[b, c] += 1


@inner
def _uniform(code, dimension):
    return _f(hash_combine(code, np.uint32(_SALT + dimension)) >> np.uint32(8)) * _INV_2_24


@inner
def _aim(rays, lane, normal, i, k, row, start, end, code):
    """Write a ray to a point of a cluster's emitters start to end; return -1 if light may come from there."""
    u = _uniform(code, 2)
    m, high = np.int64(start), np.int64(end) - 1
    while m < high:
        middle = (m + high) // 2
        if row[middle, CUMULATIVE] > u:
            high = middle
        else:
            m = middle + 1
    b1, b2 = triangle_barycentric(_uniform(code, 3), _uniform(code, 4))
    received = sent = _f(0.0)
    for a in range(3):
        corner = row[m, a]
        point = corner + b1 * (row[m, 3 + a] - corner) + b2 * (row[m, 6 + a] - corner)
        way = point - rays[(ORG_X + a) * PACKET_WIDTH + lane]
        rays[(DIR_X + a) * PACKET_WIDTH + lane] = way
        received += way * normal[i, k, a]
        sent -= way * row[m, NORMAL + a]
    rays[TFAR * PACKET_WIDTH + lane] = _SHORT
    if row[m, TWO_SIDED] > _f(0.0):
        sent = abs(sent)
    return np.int32(-1) if received > _f(0.0) and sent > _f(0.0) else np.int32(0)
