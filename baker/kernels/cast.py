# mypy: disable-error-code="no-untyped-def"
"""Casts given rays and tells the triangle and the distance of each first hit."""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.trace.packets import GEOM_ID, NO_HIT, PRIM_ID, TFAR, TNEAR, set_ray, trace


@njit(cache=True, nogil=True)
def first_hits(buffers, origin, way, near, far, triangle, distance):
    """Trace n rays.

    origin, way : (n, 3) float32; near, far : (n,) float32, in units of the direction's length
    triangle : (n,) int32 output, -1 where nothing is hit; distance : (n,) float32 output
    """
    width, scene, intersect = buffers.width, buffers.scene, buffers.intersect
    valid, floats, words = buffers.valid, buffers.floats, buffers.words
    for group in range(0, len(origin), width):
        for lane in range(width):
            i = group + lane
            valid[lane] = -1 if i < len(origin) else 0
            if i < len(origin):
                set_ray(
                    floats, words, width, lane, origin[i, 0], origin[i, 1], origin[i, 2],
                    way[i, 0], way[i, 1], way[i, 2], far[i],
                )  # fmt: skip
                floats[TNEAR * width + lane] = near[i]
        trace(intersect, scene, valid, floats)
        for lane in range(width):
            i = group + lane
            if i < len(origin):
                missed = words[GEOM_ID * width + lane] == NO_HIT
                triangle[i] = -1 if missed else np.int32(words[PRIM_ID * width + lane])
                distance[i] = floats[TFAR * width + lane]
    for lane in range(width):
        floats[TNEAR * width + lane] = np.float32(0.0)
