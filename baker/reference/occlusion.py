"""Cosine-weighted occlusion rays from points of surfaces: the reference of ambient occlusion."""

from __future__ import annotations

import numpy as np
from numba import njit

from baker.kernels.rays import aim_lanes, load_frames, new_frame, new_seeds
from baker.reference.randomness import path_state
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, LANES, TFAR, trace_lanes

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
    scene, occluded, width = caster.scene, caster.occluded, caster.width
    on, rays, words = caster.lane_valid, caster.lane_floats, caster.lane_words
    seeds, frame = new_seeds(), new_frame()
    place, facing = np.zeros((LANES, 1, 3), np.float32), np.zeros((LANES, 1, 3), np.float32)
    samples, places = len(net), position.shape[1]
    for group in range(0, len(position), LANES):
        lanes = min(LANES, len(position) - group)
        for lane in range(LANES):
            on[lane] = -1 if lane < lanes else 0
        for lane in range(lanes):
            bits = path_state(seed, number, begin + group + lane, np.uint64(1) << np.uint64(42))
            seeds[lane] = np.uint32(bits & np.uint64(0xFFFFFFFF))
            seeds[LANES + lane] = np.uint32(bits >> np.uint64(32))
        for s in range(samples):
            k = (number * samples + s) % places
            if s == 0 or places > 1:
                for lane in range(lanes):
                    i = group + lane
                    most = max(abs(position[i, k, 0]), abs(position[i, k, 1]), abs(position[i, k, 2]), least)
                    for a in range(3):
                        place[lane, 0, a] = position[i, k, a] + _OFFSET * most * face_normal[i, k, a]
                        facing[lane, 0, a] = normal[i, k, a]
                load_frames(rays, frame, place, facing, 0, lanes, 0)
            aim_lanes(rays, words, frame, seeds, net[s, 0], net[s, 1], shared, reach)
            trace_lanes(occluded, scene, width, on, rays, caster.valid, caster.floats)
            for lane in range(lanes):
                # Directions below the facet of a smooth surface are closed by the surface itself.
                i = group + lane
                above = (
                    rays[DIR_X * LANES + lane] * face_normal[i, k, 0]
                    + rays[DIR_Y * LANES + lane] * face_normal[i, k, 1]
                    + rays[DIR_Z * LANES + lane] * face_normal[i, k, 2]
                )
                if rays[TFAR * LANES + lane] >= np.float32(0.0) and above > 0.0:
                    out[group + lane, 0] += 1.0
