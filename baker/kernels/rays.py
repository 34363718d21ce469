# mypy: disable-error-code="no-untyped-def"
"""Hemisphere rays of sixteen texels at a time, in loops that the compiler turns into vector code.

What depends on the texel's point only (origin and tangent frame) is kept by lane in rows of `frame`;
per sample there remain the scrambles, the map to the hemisphere and a rotation. All rows lie at constant
offsets, or the compiler could not know that they do not overlap.
"""

from __future__ import annotations

import numpy as np

from baker.kernels.sampling import cosine_direction, hash_combine, tangent_frame, texel_scramble
from baker.trace.jit import inner, scratch
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, LANES, ORG_X, TFAR

FAR = np.float32(1.0e30)
# Rows of a frame: tangent, bitangent, normal (three each).
FRAME_ROWS = 9
# Working memory of kernels for sixteen lanes: seeds (2 * 16,) uint32 and frame (9 * 16,) float32.
new_seeds = scratch((2 * LANES,), np.uint32)
new_frame = scratch((FRAME_ROWS * LANES,), np.float32)


@inner
def lane_seeds(first, lanes, salt, seeds):
    """Write the two scramble seeds of items first to first + lanes to `seeds` (2 * 16,) uint32."""
    for lane in range(lanes):
        seeds[lane] = hash_combine(np.uint32(first + lane), np.uint32(2 * salt))
        seeds[LANES + lane] = hash_combine(np.uint32(first + lane), np.uint32(2 * salt + 1))


@inner
def load_frames(rays, frame, origin, normal, group, lanes, k):
    """Write origins of point k of texels group to group + lanes to `rays`, tangent frames to `frame`.

    origin, normal : (n, w, 3) float32; rays : (21 * 16,) float32; frame : (9 * 16,) float32
    """
    for lane in range(lanes):
        for a in range(3):
            rays[(ORG_X + a) * LANES + lane] = origin[group + lane, k, a]
            frame[(6 + a) * LANES + lane] = normal[group + lane, k, a]
    for lane in range(LANES):
        tx, ty, tz, bx, by, bz = tangent_frame(
            frame[6 * LANES + lane], frame[7 * LANES + lane], frame[8 * LANES + lane]
        )
        frame[lane], frame[LANES + lane], frame[2 * LANES + lane] = tx, ty, tz
        frame[3 * LANES + lane], frame[4 * LANES + lane], frame[5 * LANES + lane] = bx, by, bz


@inner
def aim_lanes(rays, words, frame, seeds, first, second, shared, far):
    """Write the cosine-weighted directions of one sample into all lanes.

    first, second : uint32, the sample's bit-reversed Sobol numbers; shared : uint32, see `sampling`
    far : float32, reach in metres
    """
    for lane in range(LANES):
        u = texel_scramble(first, seeds[lane], shared)
        v = texel_scramble(second, seeds[LANES + lane], shared)
        a, b, c = cosine_direction(u, v)
        rays[DIR_X * LANES + lane] = (
            a * frame[lane] + b * frame[3 * LANES + lane] + c * frame[6 * LANES + lane]
        )
        rays[DIR_Y * LANES + lane] = (
            a * frame[LANES + lane] + b * frame[4 * LANES + lane] + c * frame[7 * LANES + lane]
        )
        rays[DIR_Z * LANES + lane] = (
            a * frame[2 * LANES + lane] + b * frame[5 * LANES + lane] + c * frame[8 * LANES + lane]
        )
    for lane in range(LANES):
        rays[TFAR * LANES + lane] = far
        words[GEOM_ID * LANES + lane] = np.uint32(0xFFFFFFFF)
