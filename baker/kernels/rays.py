"""Hemisphere rays written into packets."""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.kernels.sampling import cosine_direction, hash_combine, tangent_frame
from baker.trace.packets import set_ray

FAR = np.float32(1.0e30)


@njit(cache=True, nogil=True)
def aim_cosine(floats, words, width, lane, x, y, z, nx, ny, nz, u, v, far):  # type: ignore[no-untyped-def]
    """Write the cosine-weighted ray that (u, v) gives about a unit normal; `far` is its reach in metres."""
    a, b, c = cosine_direction(u, v)
    tx, ty, tz, bx, by, bz = tangent_frame(nx, ny, nz)
    set_ray(
        floats, words, width, lane, x, y, z,
        a * tx + b * bx + c * nx, a * ty + b * by + c * ny, a * tz + b * bz + c * nz, far,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def aim_texel(floats, words, width, lane, origin, normal, i, k, u, v, far):  # type: ignore[no-untyped-def]
    """Write the cosine-weighted ray of point k of texel i; origin and normal are (n, 16, 3) float32."""
    aim_cosine(
        floats, words, width, lane, origin[i, k, 0], origin[i, k, 1], origin[i, k, 2],
        normal[i, k, 0], normal[i, k, 1], normal[i, k, 2], u, v, far,
    )  # fmt: skip


@njit(cache=True, nogil=True)
def lane_seeds(first, lanes, salt, seeds):  # type: ignore[no-untyped-def]
    """Write the two scramble seeds of items first to first + lanes to `seeds` (width, 2) uint32."""
    for lane in range(lanes):
        seeds[lane, 0] = hash_combine(np.uint32(first + lane), np.uint32(2 * salt))
        seeds[lane, 1] = hash_combine(np.uint32(first + lane), np.uint32(2 * salt + 1))
