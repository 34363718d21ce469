"""What BLEND surfaces let through along rays.

    T = (1 - a) lerp(1, c, a)

is what a surface of alpha a and colour c lets through. Shadow rays are multiplied by T at each surface on
their way (`alpha_filter`). For rays to the first hit, whether a ray passes is decided at the hit, with
probability 1 - a; one that passed is multiplied by lerp(1, c, a) here. Embree asks about hits in no
particular order, also about some behind the end of a ray: so the surfaces that colour light are a tree of
their own, through which a second ray follows the first one as far as that got.

c = factor * texture(base uv) * vertex colour, each of its parts between 0 and 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.alpha import ALPHA, TEXTURE, UV
from baker.kernels.textures import sample_texture
from baker.trace.jit import inner, larger, smaller
from baker.trace.packets import (
    BLEND_GEOMETRY,
    DIR_Z,
    GEOM_ID,
    ID,
    NO_HIT,
    PACKET_WIDTH,
    PASSES,
    PRIM_ID,
    TFAR,
    UNAWARE,
    call_embree,
    call_embree_with,
    copy_four,
    trace_lanes,
)  # fmt: skip

_f = np.float32
# Columns of a row: as of `alpha`, then factor times vertex colour at corner 0 and what corners 1 and 2 add
# to it (3 each).
COLOUR = 12
ROW_LENGTH = 21


class TransmittanceTable(NamedTuple):
    """The K triangles that let a share of light through.

    slot (T,) int32, row of each triangle of the scene or -1; row (K, 21) float32, see the column names;
    coloured, whether any is not white.
    """

    slot: NDArray[np.int32]
    row: NDArray[np.float32]
    coloured: bool = False


def no_transmittance() -> TransmittanceTable:
    """Return the table of a scene in which nothing is BLEND."""
    return TransmittanceTable(np.zeros(0, np.int32), np.zeros((0, ROW_LENGTH), np.float32))


@inner
def trace_shadow_lanes(blend, function, scene, width, query, on, rays, words, spare_on, spare):  # type: ignore[no-untyped-def]
    """Trace sixteen shadow rays; `transmittance` then tells the transmittance of those that are not blocked.

    blend, scene, width, query, spare_on, spare : of a buffers; function : its `occluded`
    on, rays, words : (16,) int32 and (21 * 16,) float32 and uint32, see `trace_lanes`
    """
    if blend is None:
        trace_lanes(function, scene, width, query, on, rays, spare_on, spare)
        return
    reset_transmittance(blend)
    for lane in range(PACKET_WIDTH):
        words[ID * PACKET_WIDTH + lane] = np.uint32(lane + 1)
    trace_lanes(function, scene, width, blend.arguments, on, rays, spare_on, spare)
    for lane in range(PACKET_WIDTH):
        words[ID * PACKET_WIDTH + lane] = np.uint32(0)


@inner
def trace_shadow_packet(blend, function, scene, width, on, packet):  # type: ignore[no-untyped-def]
    """Do the same for one packet, where it lies.

    width : at most 16; packet : (12 * width or more,) float32
    """
    if blend is None:
        call_embree(function, on, scene, packet)
        return
    reset_transmittance(blend)
    words = packet.view(np.uint32)
    for lane in range(width):
        words[ID * width + lane] = np.uint32(lane + 1)
    call_embree_with(function, on, scene, packet, blend.arguments)
    for lane in range(width):
        words[ID * width + lane] = np.uint32(0)


@inner
def reset_transmittance(blend):  # type: ignore[no-untyped-def]
    """Set what sixteen rays are multiplied by to 1, and forget the edges that they met."""
    colour, edges = blend.transmittance, blend.edges
    for j in range(3 * PACKET_WIDTH):
        colour[j] = _f(1.0)
    for lane in range(PACKET_WIDTH):
        edges[lane] = np.uint32(0)


@inner
def filter_colour_at(row, k, pack, b1, b2, rgba, out):  # type: ignore[no-untyped-def]
    """Write lerp(1, c, a) of row k at barycentrics to `out` (3,), and return a.

    pack : TexturePack; rgba : (4,) float64, memory
    """
    rgba[0] = rgba[1] = rgba[2] = rgba[3] = 1.0
    if row[k, TEXTURE] >= _f(0.0):
        u = np.float64(row[k, UV]) + b1 * row[k, UV + 2] + b2 * row[k, UV + 4]
        v = np.float64(row[k, UV + 1]) + b1 * row[k, UV + 3] + b2 * row[k, UV + 5]
        sample_texture(pack, np.int64(row[k, TEXTURE]), u, v, 0.0, rgba)
    alpha = np.float64(row[k, ALPHA]) + b1 * row[k, ALPHA + 1] + b2 * row[k, ALPHA + 2]
    alpha = smaller(larger(alpha * rgba[3], 0.0), 1.0)
    for c in range(3):
        colour = np.float64(row[k, COLOUR + c])
        colour += b1 * row[k, COLOUR + 3 + c] + b2 * row[k, COLOUR + 6 + c]
        out[c] = 1.0 - alpha * (1.0 - smaller(larger(colour * rgba[c], 0.0), 1.0))
    return alpha


@inner
def trace_transmittance(blend, function, width, on, rays, hits, spare_on, spare):  # type: ignore[no-untyped-def]
    """Find the colours that sixteen rays passed, see `transmittance`; for blend None: nothing to do.

    blend, width : of a buffers; function : its `occluded`
    on, rays : (16,) int32 and (21 * 16,) float32, the lanes as they were traced
    hits : `rays` as uint32 if they were traced to their first hit, None if to any
    spare_on, spare : packet memory of the native width
    """
    if blend is None:
        return
    reset_transmittance(blend)
    if blend.coloured == 0:
        return
    stop = blend.stop
    for lane in range(PACKET_WIDTH):
        stop[lane] = NO_HIT
        if hits is not None and hits[GEOM_ID * PACKET_WIDTH + lane] != NO_HIT:
            # Where the ray ends no light passed.
            stop[lane] = hits[PRIM_ID * PACKET_WIDTH + lane]
    _trace_blend_lanes(blend, function, width, on, rays, spare_on, spare, 0)


@inner
def _trace_blend_lanes(blend, function, width, on, rays, spare_on, spare, number):  # type: ignore[no-untyped-def]
    """Do what `_trace_blend` does for sixteen rays; number : 0 or PASSES, see `packets`."""
    for first in range(0, PACKET_WIDTH, width):
        some = False
        for lane in range(width):
            spare_on[lane] = on[first + lane]
            some = some or on[first + lane] != 0
        if not some:
            continue
        for to in range(0, width, 4):
            for row in range(DIR_Z + 1):
                copy_four(spare, row * width + to, rays, row * PACKET_WIDTH + first + to)
            copy_four(spare, TFAR * width + to, rays, TFAR * PACKET_WIDTH + first + to)
        _trace_blend(blend, function, width, spare_on, spare, number + first)


@inner
def trace_transmittance_packet(blend, function, width, on, packet, hits):  # type: ignore[no-untyped-def]
    """Do the same for one packet, where it lies.

    width : at most 16; packet : (12 * width or more,) float32
    hits : whether it was traced to first hits
    """
    if blend is None:
        return
    reset_transmittance(blend)
    if blend.coloured == 0:
        return
    stop, words = blend.stop, packet.view(np.uint32)
    for lane in range(width):
        stop[lane] = NO_HIT
        if hits and words[GEOM_ID * width + lane] != NO_HIT:
            stop[lane] = words[PRIM_ID * width + lane]
    _trace_blend(blend, function, width, on, packet, 0)


@inner
def _trace_blend(blend, function, width, on, packet, first):  # type: ignore[no-untyped-def]
    """Trace a packet in the tree of BLEND triangles: the filter multiplies colours of rays `first` and on."""
    words = packet.view(np.uint32)
    for lane in range(width):
        words[ID * width + lane] = np.uint32(first + lane + 1)
    call_embree_with(function, on, blend.scene, packet, blend.arguments)
    for lane in range(width):
        words[ID * width + lane] = np.uint32(0)


@inner
def gather_turns(blend):  # type: ignore[no-untyped-def]
    """Return in how many turns each gather ray brings its light, see `trace_gather`."""
    return 1 if blend is None else 2


@inner
def trace_gather(blend, turn, intersect, scene, width, query, on, rays, words, spare_on, spare):  # type: ignore[no-untyped-def]
    """Trace sixteen gather rays to their first hit.

    Where there are BLEND surfaces, in turn 0 rays stop at them by chance, with probability alpha: that finds
    the light that these surfaces send. In turn 1 rays pass them all (but where alpha is 1), and find what is
    behind with certainty.
    """
    if blend is None:
        trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
        return
    set_blend_rule(blend, words, UNAWARE if turn == 1 else np.uint32(0))
    trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
    set_blend_rule(blend, words, np.uint32(0))


@inner
def set_blend_rule(blend, words, number):  # type: ignore[no-untyped-def]
    """Say of sixteen rays what BLEND surfaces are to them: 0, `packets.UNAWARE` or `packets.SOLID`."""
    if blend is None:
        return
    for lane in range(PACKET_WIDTH):
        words[ID * PACKET_WIDTH + lane] = number


@inner
def any_stopped(blend, words):  # type: ignore[no-untyped-def]
    """Tell whether any of sixteen rays stopped at a BLEND surface; True without such surfaces."""
    if blend is None:
        return True
    found = False
    for lane in range(PACKET_WIDTH):
        found = found or words[GEOM_ID * PACKET_WIDTH + lane] == BLEND_GEOMETRY
    return found


@inner
def trace_gather_transmittance(blend, turn, function, width, on, rays, words, spare_on, spare):  # type: ignore[no-untyped-def]
    """Find what the light that gather rays bring in a turn is multiplied by, see `transmittance`.

    In turn 0 rays that stopped at a BLEND surface bring its light in the colours of those passed before it.
    In turn 1 the others bring theirs, multiplied by the transmittance of all BLEND surfaces on the way.
    """
    if blend is None:
        return
    if turn == 0:
        trace_transmittance(blend, function, width, on, rays, words, spare_on, spare)
    else:
        reset_transmittance(blend)
        _trace_blend_lanes(blend, function, width, on, rays, spare_on, spare, PASSES)
    colour = blend.transmittance
    for lane in range(PACKET_WIDTH):
        if (words[GEOM_ID * PACKET_WIDTH + lane] == BLEND_GEOMETRY) != (turn == 0):
            for c in range(3):
                colour[c * PACKET_WIDTH + lane] = _f(0.0)


@inner
def transmittance(blend, c, lane):  # type: ignore[no-untyped-def]
    """Return the share of channel c that the light along a lane's ray kept, after it was traced."""
    if blend is None:
        return _f(1.0)
    return blend.transmittance[c * PACKET_WIDTH + lane]


@inner
def count_coloured(blend):  # type: ignore[no-untyped-def]
    """Count the colours that lost some of their light; no ray met anything BLEND if that is 0."""
    if blend is None:
        return 0
    colour = blend.transmittance
    found = 0
    for j in range(3 * PACKET_WIDTH):
        found += 1 if colour[j] != _f(1.0) else 0
    return found
