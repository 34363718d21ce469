# mypy: disable-error-code="no-untyped-def"
"""Collects shadow rays in eight packets, and traces a packet when it contains eight rays.

Rays to the same light are in the same packet. With more than eight lights, consecutive lights share a packet.
The caller traces incomplete packets at the end.
"""

from __future__ import annotations

import numpy as np

from baker.kernels.transmittance import trace_shadow_packet, transmittance
from baker.pathtracer.path_blocks import (
    ALIVE,
    BIN_POINT,
    BIN_ROWS,
    BIN_VALUE,
    BINS,
    BLOCK_WIDTH,
    MAX_DISTANCE,
    POINT,
    TO_LIGHT,
    VALUE,
    unsigned,
)
from baker.trace.jit import inner
from baker.trace.packets import DIR_X, ORG_X, TFAR

_f = np.float32
_L = BLOCK_WIDTH


@inner
def cast_packet(bins, filled, k, occluded, scene, blend, on, out):
    """Trace packet k, add the light of its unblocked rays to `out`, and empty the packet.

    bins : packets, float32, see `PathMemory`; filled : (BINS,) int64, number of rays in each packet
    occluded, scene, blend : see `PathMemory`; on : (8,) int32, working memory
    out : (m, 3) float64, sums of light, one row for each point or pixel at which paths start; the row of a
        ray is the number in its `BIN_POINT`
    """
    n, start = filled[k], unsigned(k * BIN_ROWS * _L)
    for lane in range(BLOCK_WIDTH):
        on[lane] = -1 if lane < n else 0
    packet = bins[start : start + BIN_ROWS * _L]
    trace_shadow_packet(blend, occluded, scene, BLOCK_WIDTH, on, packet)
    for lane in range(n):
        if bins[start + TFAR * _L + lane] >= _f(0.0):
            point = unsigned(bins[start + BIN_POINT * _L + lane])
            for c in range(3):
                out[point, c] += bins[start + (BIN_VALUE + c) * _L + lane] * transmittance(blend, c, lane)
    filled[k] = 0


@inner
def cast_to_lights(s, base, light, n_lights, bins, filled, occluded, scene, blend, on, out):
    """Append the shadow rays of eight paths to the packets of their lights; trace full packets.

    s : float32, blocks of eight paths, see `path_blocks`; base : index in `s` of the block's first number
    light : (8,) int64, number of each lane's light, -1 without a ray; n_lights : number of all lights
    bins, filled, occluded, scene, blend, on, out : see `cast_packet`

    Returns
    -------
    int
        Number of rays appended, whether or not they have been traced.
    """
    base = unsigned(base)
    n = 0
    for lane in range(BLOCK_WIDTH):
        here = base + lane
        brought = max(
            max(s[here + VALUE * _L], s[here + (VALUE + 1) * _L]),
            s[here + (VALUE + 2) * _L],
        )
        if s[here + ALIVE * _L] == _f(0.0) or light[lane] < 0 or brought <= _f(0.0):
            continue
        n += 1
        k = unsigned(light[lane] if n_lights <= BINS else light[lane] * BINS // n_lights)
        start = unsigned(k * BIN_ROWS * _L + filled[k])
        for a in range(3):
            bins[start + (ORG_X + a) * _L] = s[here + (ORG_X + a) * _L]
            bins[start + (DIR_X + a) * _L] = s[here + (TO_LIGHT + a) * _L]
            bins[start + (BIN_VALUE + a) * _L] = s[here + (VALUE + a) * _L]
        bins[start + TFAR * _L] = s[here + MAX_DISTANCE * _L]
        bins[start + BIN_POINT * _L] = s[here + POINT * _L]
        filled[k] += 1
        if filled[k] == BLOCK_WIDTH:
            cast_packet(bins, filled, k, occluded, scene, blend, on, out)
    return n
