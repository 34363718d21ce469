"""Sums light over a texel's points where the shadow ray meets nothing."""

from __future__ import annotations

import numpy as np

from baker.kernels.sampling import hash_u32
from baker.kernels.surface import N_POINTS
from baker.kernels.tint import follow, light_kept
from baker.trace.jit import kernel, smaller
from baker.trace.packets import DIR_X, ID, LANES, ORG_X, TFAR, trace_lanes

_f = np.float32


@kernel
def add_visible(caster, origin, ray, weight, colour, out):  # type: ignore[no-untyped-def]
    """Add colour * mean over a texel's 16 points of weight * visibility to `out`, both column blocks.

    origin : (n, 16, 3) float32; ray : (n, 16, 4) float32, direction and reach in units of its length
    weight : (n, 16) float32, irradiance for colour 1 if nothing is in the way; 0 casts no ray
    colour : (3,) float32; out : (n, 6) float32
    """
    scene, occluded, width = caster.scene, caster.occluded, caster.width
    query = caster.query
    on, rays, words = caster.lane_valid, caster.lane_floats, caster.lane_words
    spare_on, spare = caster.valid, caster.floats
    bits = origin.view(np.uint32)
    for group in range(0, len(origin), LANES):
        lanes = smaller(LANES, len(origin) - group)
        for k in range(N_POINTS):
            any_lane = False
            for lane in range(LANES):
                on[lane] = 0
                if lane < lanes and weight[group + lane, k] > _f(0.0):
                    i = group + lane
                    for a in range(3):
                        rays[(ORG_X + a) * LANES + lane] = origin[i, k, a]
                        rays[(DIR_X + a) * LANES + lane] = ray[i, k, a]
                    rays[TFAR * LANES + lane] = ray[i, k, 3]
                    # Which texel's ray and which of its 16: `alpha_filter` lets them decide together.
                    texel = hash_u32(hash_u32(hash_u32(bits[i, 0, 0]) ^ bits[i, 0, 1]) ^ bits[i, 0, 2])
                    words[ID * LANES + lane] = np.uint32((texel & np.uint32(0xFFFFFFF0)) | np.uint32(k))
                    on[lane] = -1
                    any_lane = True
            if not any_lane:
                continue
            trace_lanes(occluded, scene, width, query, on, rays, spare_on, spare)
            follow(caster.tint, occluded, width, on, rays, None, spare_on, spare)
            for lane in range(lanes):
                if on[lane] and rays[TFAR * LANES + lane] >= _f(0.0):
                    i = group + lane
                    for c in range(3):
                        share = colour[c] * weight[i, k] / _f(N_POINTS) * light_kept(caster.tint, c, lane)
                        out[i, c] += share
                        out[i, 3 + c] += share
    for lane in range(LANES):
        words[ID * LANES + lane] = np.uint32(0)
