"""Hemisphere rays written into packets, a lane at a time in loops that the compiler can vectorise.

What depends on the texel's point only (origin and tangent frame) is kept by lane in rows of `frame`;
per sample there remain the scrambles, the map to the hemisphere and a rotation.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.kernels.sampling import cosine_direction, hash_combine, tangent_frame, texel_scramble
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, MAX_WIDTH, ORG_X, ORG_Y, ORG_Z, TFAR

FAR = np.float32(1.0e30)
# Rows of a frame: origin, tangent, bitangent, normal (three each).
FRAME_ROWS = 12


@njit(cache=True, nogil=True, error_model="numpy")
def lane_seeds(first, lanes, salt, seeds):  # type: ignore[no-untyped-def]
    """Write the two scramble seeds of items first to first + lanes to `seeds` (2, 16) uint32."""
    for lane in range(lanes):
        seeds[0, lane] = hash_combine(np.uint32(first + lane), np.uint32(2 * salt))
        seeds[1, lane] = hash_combine(np.uint32(first + lane), np.uint32(2 * salt + 1))


@njit(cache=True, nogil=True, error_model="numpy")
def load_frames(frame, origin, normal, group, lanes, k):  # type: ignore[no-untyped-def]
    """Write origins and tangent frames of point k of texels group to group + lanes to `frame` (12, 16).

    origin, normal : (n, w, 3) float32
    """
    for lane in range(lanes):
        i = group + lane
        x, y, z = normal[i, k, 0], normal[i, k, 1], normal[i, k, 2]
        tx, ty, tz, bx, by, bz = tangent_frame(x, y, z)
        frame[0, lane], frame[1, lane], frame[2, lane] = origin[i, k, 0], origin[i, k, 1], origin[i, k, 2]
        frame[3, lane], frame[4, lane], frame[5, lane] = tx, ty, tz
        frame[6, lane], frame[7, lane], frame[8, lane] = bx, by, bz
        frame[9, lane], frame[10, lane], frame[11, lane] = x, y, z


@njit(cache=True, nogil=True, error_model="numpy")
def aim_lanes(floats, words, width, frame, seeds, first, second, shared, far):  # type: ignore[no-untyped-def]
    """Write the cosine-weighted ray of one sample into every lane of a packet.

    first, second : uint32, the sample's bit-reversed Sobol numbers; shared : uint32, see `sampling`
    far : float32, reach in metres
    """
    for lane in range(width):
        u = texel_scramble(first, seeds[0, lane], shared)
        v = texel_scramble(second, seeds[1, lane], shared)
        a, b, c = cosine_direction(u, v)
        floats[ORG_X * width + lane] = frame[0, lane]
        floats[ORG_Y * width + lane] = frame[1, lane]
        floats[ORG_Z * width + lane] = frame[2, lane]
        floats[DIR_X * width + lane] = a * frame[3, lane] + b * frame[6, lane] + c * frame[9, lane]
        floats[DIR_Y * width + lane] = a * frame[4, lane] + b * frame[7, lane] + c * frame[10, lane]
        floats[DIR_Z * width + lane] = a * frame[5, lane] + b * frame[8, lane] + c * frame[11, lane]
        floats[TFAR * width + lane] = far
        words[GEOM_ID * width + lane] = np.uint32(0xFFFFFFFF)


@njit(cache=True, nogil=True, error_model="numpy")
def new_lanes():  # type: ignore[no-untyped-def]
    """Return working memory for a packet: seeds (2, 16) uint32 and frame (12, 16) float32."""
    return np.zeros((2, MAX_WIDTH), np.uint32), np.zeros((FRAME_ROWS, MAX_WIDTH), np.float32)
