"""Traces arbitrary rays in packets, as kernels do, and returns their closest hits to truth tests."""

from __future__ import annotations

from typing import Any

import numpy as np
from inner import compiled

from baker.trace.embree import Tracer
from baker.trace.packets import GEOM_ID, NO_HIT, PRIM_ID, TFAR, new_packet_buffers, set_ray, trace

set_ray, trace = compiled(set_ray, trace)


def closest_hits(tracer: Tracer, origin: Any, direction: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return triangle (n,) int64, -1 for none, and distance (n,) of the closest hits of n rays."""
    origin, direction = (np.ascontiguousarray(a, np.float32) for a in (origin, direction))
    primitive, distance = np.full(len(origin), -1, np.int64), np.full(len(origin), np.inf)
    buffers = new_packet_buffers(tracer)
    width, floats, words = buffers.width, buffers.floats, buffers.words
    for begin in range(0, len(origin), width):
        lanes = min(width, len(origin) - begin)
        buffers.valid[:] = np.where(np.arange(len(buffers.valid)) < lanes, -1, 0)
        for lane in range(lanes):
            set_ray(
                floats, words, width, lane, *origin[begin + lane], *direction[begin + lane], np.float32(1e30)
            )
        trace(buffers.intersect, buffers.scene, buffers.valid, floats)
        hit = words[GEOM_ID * width : GEOM_ID * width + lanes] != NO_HIT
        span = slice(begin, begin + lanes)
        primitive[span][hit] = words[PRIM_ID * width : PRIM_ID * width + lanes][hit]
        distance[span][hit] = floats[TFAR * width : TFAR * width + lanes][hit]
    return primitive, distance
