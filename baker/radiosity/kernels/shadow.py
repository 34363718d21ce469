# mypy: disable-error-code="no-untyped-def"
"""Visibility of lights: sums irradiance over a texel's points whose shadow rays are not blocked."""

from __future__ import annotations

import numpy as np

from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import trace_shadow_lanes, transmittance
from baker.trace.jit import kernel, smaller
from baker.trace.packets import DIR_X, ORG_X, PACKET_WIDTH, TFAR

_f = np.float32
# Column of `ray` after the direction.
MAX_DISTANCE = 3


@kernel
def add_visible(buffers, origin, ray, weight, colour, out):
    """Add colour * mean over a texel's 16 points of weight * visibility to both column blocks of `out`.

    Visibility is 0 where something blocks the ray, else the transmittance of the BLEND surfaces on the way.

    buffers : PacketBuffers; origin : (n, 16, 3) float32, metres, world
    ray : (n, 16, 4) float32, direction, and MAX_DISTANCE in units of its length
    weight : (n, 16) float32, unoccluded irradiance for colour 1; 0 casts no ray
    colour : (3,) float32, intensity of the light; out : (n, 6) float32, lx, RGB twice, added to
    """
    scene, occluded, width = buffers.scene, buffers.occluded, buffers.width
    query = buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin) - group)
        for k in range(N_POINTS):
            # Write the shadow rays of point k of sixteen texels.
            any_lane = False
            for lane in range(PACKET_WIDTH):
                on[lane] = 0
                if lane < lanes and weight[group + lane, k] > _f(0.0):
                    i = group + lane
                    for a in range(3):
                        rays[(ORG_X + a) * PACKET_WIDTH + lane] = origin[i, k, a]
                        rays[(DIR_X + a) * PACKET_WIDTH + lane] = ray[i, k, a]
                    rays[TFAR * PACKET_WIDTH + lane] = ray[i, k, MAX_DISTANCE]
                    on[lane] = -1
                    any_lane = True
            if not any_lane:
                continue
            # Trace them, and add the light of those that are not blocked.
            trace_shadow_lanes(buffers.blend, occluded, scene, width, query, on, rays, words, spare_on, spare)
            for lane in range(lanes):
                if on[lane] and rays[TFAR * PACKET_WIDTH + lane] >= _f(0.0):
                    i = group + lane
                    for c in range(3):
                        share = (
                            colour[c] * weight[i, k] / _f(N_POINTS) * transmittance(buffers.blend, c, lane)
                        )
                        out[i, c] += share
                        out[i, 3 + c] += share
