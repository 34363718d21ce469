"""Hemisphere rays written into packets."""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.kernels.sampling import cosine_direction, tangent_frame
from baker.trace.packets import set_ray

FAR = np.float32(1.0e30)


@njit(cache=True, nogil=True, inline="always")
def aim_cosine(floats, words, width, lane, origin, normal, u, v, far):  # type: ignore[no-untyped-def]
    """Write the cosine-weighted ray that (u, v) gives about a unit normal; `far` is its reach in metres."""
    x, y, z = cosine_direction(u, v)
    tx, ty, tz, bx, by, bz = tangent_frame(normal[0], normal[1], normal[2])
    set_ray(
        floats, words, width, lane, origin[0], origin[1], origin[2],
        x * tx + y * bx + z * normal[0], x * ty + y * by + z * normal[1], x * tz + y * bz + z * normal[2],
        np.float32(0.0), far,
    )  # fmt: skip
