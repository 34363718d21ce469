# mypy: disable-error-code="no-untyped-def"
"""Shadow rays that wait until they fill a packet: rays to the same lamp together, of whichever paths."""

from __future__ import annotations

import numpy as np

from baker.kernels.transmittance import trace_shadow_packet, transmittance
from baker.pathtracer.path_blocks import (
    ALIVE,
    BIN_POINT,
    BIN_ROWS,
    BIN_VALUE,
    BINS,
    LANES,
    POINT,
    REACH,
    TO_LAMP,
    VALUE,
    unsigned,
)
from baker.trace.jit import inner
from baker.trace.packets import DIR_X, ORG_X, TFAR

_f = np.float32


@inner
def cast_packet(bins, filled, k, occluded, scene, blend, on, out):
    """Trace packet k, add the light of rays that nothing blocks to their points, and empty it.

    blend : of the path memory; out : (m, 3) float64
    """
    n, start = filled[k], unsigned(k * BIN_ROWS * LANES)
    for lane in range(LANES):
        on[lane] = -1 if lane < n else 0
    packet = bins[start : start + BIN_ROWS * LANES]
    trace_shadow_packet(blend, occluded, scene, LANES, on, packet)
    for lane in range(n):
        if bins[start + TFAR * LANES + lane] >= _f(0.0):
            point = unsigned(bins[start + BIN_POINT * LANES + lane])
            for c in range(3):
                out[point, c] += bins[start + (BIN_VALUE + c) * LANES + lane] * transmittance(blend, c, lane)
    filled[k] = 0


@inner
def cast_to_lamps(s, base, lamp, n_lamps, bins, filled, occluded, scene, blend, on, out):
    """Put the lanes' rays to lamps into packets, those to one lamp together; trace what is full.

    lamp : (8,) int64, -1 for none; filled : (BINS,) int64, rays in each packet

    Returns
    -------
    int
        Rays, those included that have to wait.
    """
    base = unsigned(base)
    n = 0
    for lane in range(LANES):
        here = base + lane
        brought = max(
            max(s[here + VALUE * LANES], s[here + (VALUE + 1) * LANES]), s[here + (VALUE + 2) * LANES]
        )
        if s[here + ALIVE * LANES] == _f(0.0) or lamp[lane] < 0 or brought <= _f(0.0):
            continue
        n += 1
        k = unsigned(lamp[lane] if n_lamps <= BINS else lamp[lane] * BINS // n_lamps)
        place = unsigned(k * BIN_ROWS * LANES + filled[k])
        for a in range(3):
            bins[place + (ORG_X + a) * LANES] = s[here + (ORG_X + a) * LANES]
            bins[place + (DIR_X + a) * LANES] = s[here + (TO_LAMP + a) * LANES]
            bins[place + (BIN_VALUE + a) * LANES] = s[here + (VALUE + a) * LANES]
        bins[place + TFAR * LANES] = s[here + REACH * LANES]
        bins[place + BIN_POINT * LANES] = s[here + POINT * LANES]
        filled[k] += 1
        if filled[k] == LANES:
            cast_packet(bins, filled, k, occluded, scene, blend, on, out)
    return n
