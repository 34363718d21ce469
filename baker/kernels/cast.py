# mypy: disable-error-code="no-untyped-def"
"""Traces n rays to their first hits, and writes triangle and distance of each hit."""

from __future__ import annotations

import numpy as np

from baker.trace.jit import kernel
from baker.trace.packets import GEOM_ID, NO_HIT, PRIM_ID, TFAR, TNEAR, set_ray, trace


@kernel
def first_hits(buffers, origin, direction, near, far, triangle, distance):
    """Trace n rays to their first hit.

    buffers : PacketBuffers
    origin : (n, 3) float32, metres, world; direction : (n, 3) float32, of any length
    near, far : (n,) float32, TNEAR and TFAR of each ray, in units of the direction's length
    triangle : (n,) int32 output, triangle that was hit, -1 for none
    distance : (n,) float32 output, distance of the hit, in units of the direction's length; `far` without a
        hit
    """
    width, scene, intersect = buffers.width, buffers.scene, buffers.intersect
    valid, floats, words = buffers.valid, buffers.floats, buffers.words
    for group in range(0, len(origin), width):
        # Fill a packet, and disable lanes beyond the last ray.
        for lane in range(width):
            i = group + lane
            valid[lane] = -1 if i < len(origin) else 0
            if i < len(origin):
                set_ray(
                    floats, words, width, lane, origin[i, 0], origin[i, 1], origin[i, 2],
                    direction[i, 0], direction[i, 1], direction[i, 2], far[i],
                )  # fmt: skip
                floats[TNEAR * width + lane] = near[i]
        trace(intersect, scene, valid, floats)
        # Read the hits.
        for lane in range(width):
            i = group + lane
            if i < len(origin):
                missed = words[GEOM_ID * width + lane] == NO_HIT
                triangle[i] = -1 if missed else np.int32(words[PRIM_ID * width + lane])
                distance[i] = floats[TFAR * width + lane]
    # Reset TNEAR to 0, because other kernels do not set it.
    for lane in range(width):
        floats[TNEAR * width + lane] = np.float32(0.0)
