"""Casts arbitrary rays in packets, as the kernels do, and returns the results of all lanes."""

from __future__ import annotations

import ctypes

import numpy as np
from numba import njit

from baker.trace.embree import Tracer
from baker.trace.packets import (
    GEOM_ID,
    HIT_U,
    HIT_V,
    PRIM_ID,
    TFAR,
    TNEAR,
    new_packet_buffers,
    set_ray,
    trace,
)


@njit(nogil=True)
def _cast(occluded, buffers, origin, direction, near, far, valid_ray, geom, prim, u, v, reach):  # type: ignore[no-untyped-def]
    width, valid, floats, words = buffers.width, buffers.valid, buffers.floats, buffers.words
    function = buffers.occluded if occluded else buffers.intersect
    for group in range(0, len(origin), width):
        lanes = min(width, len(origin) - group)
        for lane in range(width):
            valid[lane] = 0
            if lane < lanes:
                i = group + lane
                set_ray(
                    floats, words, width, lane, origin[i, 0], origin[i, 1], origin[i, 2],
                    direction[i, 0], direction[i, 1], direction[i, 2], far[i],
                )  # fmt: skip
                floats[TNEAR * width + lane] = near[i]
                valid[lane] = -1 if valid_ray[i] else 0
        trace(function, buffers.scene, valid, floats)
        for lane in range(lanes):
            i = group + lane
            geom[i] = words[GEOM_ID * width + lane]
            prim[i] = words[PRIM_ID * width + lane]
            u[i], v[i] = floats[HIT_U * width + lane], floats[HIT_V * width + lane]
            reach[i] = floats[TFAR * width + lane]


def tracer_of_width(rays, width):
    """Return a tracer for packets of the given width."""
    address = [
        ctypes.cast(getattr(rays._library, f"rtc{kind}{width}"), ctypes.c_void_p).value
        for kind in ("Intersect", "Occluded")
    ]
    return Tracer(rays.tracer.scene, *address, width)


def cast(rays, origin, direction, near=0.0, far=1e30, *, width=0, valid=True, occluded=False):
    """Return geometry (-1 for none), triangle, u, v and tfar of each ray; width 0 is the native width."""
    tracer = tracer_of_width(rays, width) if width else rays.tracer
    n = len(origin)
    origin, direction = np.float32(origin), np.float32(direction)
    near, far = (np.float32(np.broadcast_to(x, n)).copy() for x in (near, far))
    geom, prim = np.zeros(n, np.uint32), np.zeros(n, np.uint32)
    u, v, reach = (np.zeros(n, np.float32) for _ in range(3))
    valid = np.broadcast_to(np.asarray(valid, bool), n).copy()
    buffers = new_packet_buffers(tracer)
    _cast(occluded, buffers, origin, direction, near, far, valid, geom, prim, u, v, reach)
    return geom.astype(np.int32), prim.astype(np.int32), u, v, reach
