# mypy: disable-error-code="no-untyped-def"
"""Sums light over a texel's points where the shadow ray meets nothing that blocks it."""

from __future__ import annotations

import numpy as np

from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import light_kept, trace_shadow_lanes
from baker.trace.jit import kernel, smaller
from baker.trace.packets import DIR_X, LANES, ORG_X, TFAR

_f = np.float32


@kernel
def add_visible(caster, origin, ray, weight, colour, out):
    """Add colour * mean over a texel's 16 points of weight * visibility to `out`, both column blocks.

    origin : (n, 16, 3) float32; ray : (n, 16, 4) float32, direction and reach in units of its length
    weight : (n, 16) float32, irradiance for colour 1 if nothing is in the way; 0 casts no ray
    Visibility is the transmittance of the BLEND surfaces on the way where nothing blocks: no chance is in it.
    colour : (3,) float32; out : (n, 6) float32
    """
    scene, occluded, width = caster.scene, caster.occluded, caster.width
    query = caster.query
    on, rays, words = caster.lane_valid, caster.lane_floats, caster.lane_words
    spare_on, spare = caster.valid, caster.floats
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
                    on[lane] = -1
                    any_lane = True
            if not any_lane:
                continue
            trace_shadow_lanes(caster.tint, occluded, scene, width, query, on, rays, words, spare_on, spare)
            for lane in range(lanes):
                if on[lane] and rays[TFAR * LANES + lane] >= _f(0.0):
                    i = group + lane
                    for c in range(3):
                        share = colour[c] * weight[i, k] / _f(N_POINTS) * light_kept(caster.tint, c, lane)
                        out[i, c] += share
                        out[i, 3 + c] += share
