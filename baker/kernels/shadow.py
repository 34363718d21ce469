"""Sums light over a texel's points where the shadow ray meets nothing."""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.kernels.sampling import hash_u32
from baker.kernels.surface import N_POINTS
from baker.trace.packets import ID, TFAR, set_ray, trace

_f = np.float32


@njit(cache=True, nogil=True, error_model="numpy")
def add_visible(caster, origin, ray, weight, colour, out):  # type: ignore[no-untyped-def]
    """Add colour * mean over a texel's 16 points of weight * visibility to `out`, both column blocks.

    origin : (n, 16, 3) float32; ray : (n, 16, 4) float32, direction and reach in units of its length
    weight : (n, 16) float32, irradiance for colour 1 if nothing is in the way; 0 casts no ray
    colour : (3,) float32; out : (n, 6) float32
    """
    width, scene, occluded = caster.width, caster.scene, caster.occluded
    valid, floats, words = caster.valid, caster.floats, caster.words
    bits = origin.view(np.uint32)
    for group in range(0, len(origin), width):
        lanes = min(width, len(origin) - group)
        for k in range(N_POINTS):
            any_lane = False
            for lane in range(width):
                valid[lane] = 0
                if lane < lanes and weight[group + lane, k] > _f(0.0):
                    i = group + lane
                    set_ray(
                        floats, words, width, lane, origin[i, k, 0], origin[i, k, 1], origin[i, k, 2],
                        ray[i, k, 0], ray[i, k, 1], ray[i, k, 2], ray[i, k, 3],
                    )  # fmt: skip
                    # Which texel's ray and which of its 16: `alpha_filter` lets them decide together.
                    texel = hash_u32(hash_u32(hash_u32(bits[i, 0, 0]) ^ bits[i, 0, 1]) ^ bits[i, 0, 2])
                    words[ID * width + lane] = np.uint32((texel & np.uint32(0xFFFFFFF0)) | np.uint32(k))
                    valid[lane] = -1
                    any_lane = True
            if not any_lane:
                continue
            trace(occluded, scene, valid, floats)
            for lane in range(lanes):
                if valid[lane] and floats[TFAR * width + lane] >= _f(0.0):
                    i = group + lane
                    for c in range(3):
                        share = colour[c] * weight[i, k] / _f(N_POINTS)
                        out[i, c] += share
                        out[i, 3 + c] += share
    for lane in range(width):
        words[ID * width + lane] = np.uint32(0)
