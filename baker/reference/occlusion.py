"""Cosine-weighted occlusion rays from points of surfaces: the reference of ambient occlusion."""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.kernels.rays import aim_lanes, new_lanes
from baker.kernels.sampling import tangent_frame
from baker.reference.randomness import path_state
from baker.trace.packets import MAX_WIDTH, TFAR, trace

_OFFSET = 1.0e-5


@njit(cache=True, nogil=True, error_model="numpy")
def open_rays(  # type: ignore[no-untyped-def]
    position, normal, face_normal, begin, caster, net, shared, reach, least, seed, number, out
):
    """Count the rays of each point that meet nothing within reach.

    position, normal, face_normal : (m, k, 3) float64; sample s of pass p starts at place (p n + s) modulo k
    begin : number of the first point; net : (n, 2) uint32; shared : uint32, bits that all points share
    reach : float32, metres; least : float; out : (m, 1) float64 output
    """
    width, scene, occluded = caster.width, caster.scene, caster.occluded
    valid, floats, words = caster.valid, caster.floats, caster.words
    seeds, frame = new_lanes()
    below = np.zeros(MAX_WIDTH)
    samples, places = len(net), position.shape[1]
    for group in range(0, len(position), width):
        lanes = min(width, len(position) - group)
        for lane in range(width):
            valid[lane] = -1 if lane < lanes else 0
        for lane in range(lanes):
            bits = path_state(seed, number, begin + group + lane, np.uint64(1) << np.uint64(42))
            seeds[0, lane] = np.uint32(bits & np.uint64(0xFFFFFFFF))
            seeds[1, lane] = np.uint32(bits >> np.uint64(32))
        for s in range(samples):
            k = (number * samples + s) % places
            if s == 0 or places > 1:
                for lane in range(lanes):
                    i = group + lane
                    most = max(abs(position[i, k, 0]), abs(position[i, k, 1]), abs(position[i, k, 2]), least)
                    for a in range(3):
                        frame[a, lane] = position[i, k, a] + _OFFSET * most * face_normal[i, k, a]
                        frame[9 + a, lane] = normal[i, k, a]
                    (
                        frame[3, lane], frame[4, lane], frame[5, lane],
                        frame[6, lane], frame[7, lane], frame[8, lane],
                    ) = tangent_frame(frame[9, lane], frame[10, lane], frame[11, lane])  # fmt: skip
            aim_lanes(floats, words, width, frame, seeds, net[s, 0], net[s, 1], shared, reach)
            for lane in range(lanes):
                # Directions below the facet of a smooth surface are closed by the surface itself.
                i = group + lane
                below[lane] = (
                    floats[4 * width + lane] * face_normal[i, k, 0]
                    + floats[5 * width + lane] * face_normal[i, k, 1]
                    + floats[6 * width + lane] * face_normal[i, k, 2]
                )
            trace(occluded, scene, valid, floats)
            for lane in range(lanes):
                if floats[TFAR * width + lane] >= np.float32(0.0) and below[lane] > 0.0:
                    out[group + lane, 0] += 1.0
