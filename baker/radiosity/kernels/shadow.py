# mypy: disable-error-code="no-untyped-def"
"""Computes the irradiance of texels from a light without area, with one shadow ray from each point."""

from __future__ import annotations

import numpy as np

from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import trace_shadow_lanes, transmittance
from baker.trace.jit import kernel, smaller
from baker.trace.packets import DIR_X, ORG_X, PACKET_WIDTH, TFAR

_f = np.float32
# Column of `ray` in `add_visible`; columns 0 to 2 are the direction.
MAX_DISTANCE = 3


@kernel
def add_visible(buffers, origin, ray, weight, colour, out):
    """Add the irradiance of texels from one light to both RGB estimates in `out`.

        irradiance = colour * mean(weight * visibility)

    The mean is over the texel's 16 points. The visibility of a blocked ray is 0. Otherwise it is the RGB
    transmittance of the BLEND surfaces that the ray crosses.

    buffers : PacketBuffers; origin : (n, 16, 3) float32, metres, world
    ray : (n, 16, 4) float32, direction, and TFAR in units of the direction's length (MAX_DISTANCE)
    weight : (n, 16) float32, unoccluded irradiance for an intensity of 1; no ray is cast where it is 0
    colour : (3,) float32, intensity of the light; out : (n, 6) float32, lx, two RGB estimates, added to
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
            # Trace the rays, and add the light of rays that are not blocked.
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
