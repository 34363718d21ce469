# mypy: disable-error-code="no-untyped-def"
"""Generates hemisphere rays of sixteen texels at a time, in loops that the compiler vectorises.

`frame` stores the tangent frame at one point of each texel. For each sample, two Sobol numbers are scrambled,
mapped to the hemisphere about +z, and rotated into the frame. All rows of `frame` are at constant offsets in
one array, so that the compiler can prove that they do not overlap.
"""

from __future__ import annotations

import numpy as np

from baker.kernels.sampling import cosine_direction, hash_combine, tangent_frame, texel_scramble
from baker.trace.jit import inner, scratch
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, GEOM_ID, ORG_X, PACKET_WIDTH, TFAR

# TFAR of rays of unlimited length, metres.
FAR = np.float32(1.0e30)
# Rows of a frame: tangent, bitangent, normal (3 each).
_TANGENT, _BITANGENT, _NORMAL = 0, 3, 6
FRAME_ROWS = 9
# Working memory of kernels for sixteen lanes: seeds (2 * 16,) uint32 and frame (9 * 16,) float32.
new_seeds = scratch((2 * PACKET_WIDTH,), np.uint32)
new_frame = scratch((FRAME_ROWS * PACKET_WIDTH,), np.float32)


@inner
def lane_seeds(first, lanes, salt, seeds):
    """Write the scramble seeds of item `first` + lane into each lane, for both dimensions of a sample.

    lanes : number of lanes to write, at most 16; salt : int, a different number for each kind of rays
    seeds : (2 * 16,) uint32 output, by dimension and lane
    """
    for lane in range(lanes):
        seeds[lane] = hash_combine(np.uint32(first + lane), np.uint32(2 * salt))
        seeds[PACKET_WIDTH + lane] = hash_combine(np.uint32(first + lane), np.uint32(2 * salt + 1))


@inner
def load_frames(rays, frame, origin, normal, group, lanes, k):
    """Write origin and tangent frame of point k of texel `group` + lane into each lane.

    origin, normal : (n, w, 3) float32, metres and unit vectors, world
    rays : (21 * 16,) float32, a packet of sixteen rays (`trace.packets`); its origins are set
    frame : (9 * 16,) float32 output; tangent, bitangent, normal
    """
    for lane in range(lanes):
        for a in range(3):
            rays[(ORG_X + a) * PACKET_WIDTH + lane] = origin[group + lane, k, a]
            frame[(_NORMAL + a) * PACKET_WIDTH + lane] = normal[group + lane, k, a]
    for lane in range(PACKET_WIDTH):
        tx, ty, tz, bx, by, bz = tangent_frame(
            frame[_NORMAL * PACKET_WIDTH + lane],
            frame[(_NORMAL + 1) * PACKET_WIDTH + lane],
            frame[(_NORMAL + 2) * PACKET_WIDTH + lane],
        )
        frame[_TANGENT * PACKET_WIDTH + lane] = tx
        frame[(_TANGENT + 1) * PACKET_WIDTH + lane] = ty
        frame[(_TANGENT + 2) * PACKET_WIDTH + lane] = tz
        frame[_BITANGENT * PACKET_WIDTH + lane] = bx
        frame[(_BITANGENT + 1) * PACKET_WIDTH + lane] = by
        frame[(_BITANGENT + 2) * PACKET_WIDTH + lane] = bz


@inner
def aim_lanes(rays, words, frame, seeds, first, second, shared, far):
    """Write the cosine-weighted direction of one sample into each lane.

    rays, words : (21 * 16,) float32 and uint32 views of one packet; directions, TFAR and GEOM_ID are set
    frame : (9 * 16,) float32, from `load_frames`; seeds : (2 * 16,) uint32, from `lane_seeds`
    first, second : uint32, bit-reversed Sobol numbers of the sample
    shared : uint32, from `kernels.sampling.shared_bits_mask`
    far : float32, TFAR, metres
    """
    for lane in range(PACKET_WIDTH):
        # Compute (a, b, c) about +z, and rotate it into the frame: d = a tangent + b bitangent + c normal.
        u = texel_scramble(first, seeds[lane], shared)
        v = texel_scramble(second, seeds[PACKET_WIDTH + lane], shared)
        a, b, c = cosine_direction(u, v)
        rays[DIR_X * PACKET_WIDTH + lane] = (
            a * frame[_TANGENT * PACKET_WIDTH + lane]
            + b * frame[_BITANGENT * PACKET_WIDTH + lane]
            + c * frame[_NORMAL * PACKET_WIDTH + lane]
        )
        rays[DIR_Y * PACKET_WIDTH + lane] = (
            a * frame[(_TANGENT + 1) * PACKET_WIDTH + lane]
            + b * frame[(_BITANGENT + 1) * PACKET_WIDTH + lane]
            + c * frame[(_NORMAL + 1) * PACKET_WIDTH + lane]
        )
        rays[DIR_Z * PACKET_WIDTH + lane] = (
            a * frame[(_TANGENT + 2) * PACKET_WIDTH + lane]
            + b * frame[(_BITANGENT + 2) * PACKET_WIDTH + lane]
            + c * frame[(_NORMAL + 2) * PACKET_WIDTH + lane]
        )
    for lane in range(PACKET_WIDTH):
        rays[TFAR * PACKET_WIDTH + lane] = far
        words[GEOM_ID * PACKET_WIDTH + lane] = np.uint32(0xFFFFFFFF)
