# mypy: disable-error-code="no-untyped-def"
"""Transmittance of BLEND surfaces along rays.

    T = (1 - a) lerp(1, c, a)        a: alpha, c: colour of the surface

Shadow rays: the filter function multiplies T at each surface on the way (`alpha_filter`).

Rays to the first hit: at each hit the filter function lets the ray pass with probability 1 - a, and the light
of one that passed is multiplied by lerp(1, c, a). Embree reports hits in no particular order, some of them
beyond the first hit. So the colours are multiplied along a second ray, which ends where the first one did, in
a second tree that holds the BLEND triangles only.

    c = factor * texture(base uv) * vertex colour, each clamped to [0, 1]

Kernels call these functions with `blend`, a `BlendBuffers`, or None in scenes without BLEND surfaces: Numba
then compiles them to nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.alpha import ALPHA, ALPHA_EDGE_1, ALPHA_EDGE_2, TEXTURE, UV, UV_EDGE_1, UV_EDGE_2
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
# Columns of a row: those of `alpha`, then factor times vertex colour: at corner 0, and at corners 1 and 2
# minus that (3 each).
COLOUR, COLOUR_EDGE_1, COLOUR_EDGE_2 = 12, 15, 18
ROW_LENGTH = 21


class TransmittanceTable(NamedTuple):
    """The K BLEND triangles that let light through.

    Attributes
    ----------
    slot : (T,) int32
        Row of each triangle of the scene, -1 for the others.
    row : (K, 21) float32
        See the column names.
    coloured : bool
        Whether any of them is not white.
    """

    slot: NDArray[np.int32]
    row: NDArray[np.float32]
    coloured: bool = False


def no_transmittance() -> TransmittanceTable:
    """Return the table of a scene without BLEND triangles.

    Returns
    -------
    TransmittanceTable
        Without rows.
    """
    return TransmittanceTable(np.zeros(0, np.int32), np.zeros((0, ROW_LENGTH), np.float32))


@inner
def trace_shadow_lanes(blend, function, scene, width, query, on, rays, words, spare_on, spare):
    """Trace sixteen shadow rays; `transmittance` then returns T of those that are not blocked.

    blend, scene, width, query : of `PacketBuffers`; function : its `occluded`
    on : (16,) int32; rays, words : (21 * 16,) float32 and uint32; see `trace_lanes`
    spare_on, spare : packet memory of the native width, of `PacketBuffers`
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
def trace_shadow_packet(blend, function, scene, width, on, packet):
    """Do the same for one packet, in place.

    blend, scene, width : of `PacketBuffers`, width at most 16; function : its `occluded`
    on : (width,) int32; packet : (12 * width or more,) float32
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
def reset_transmittance(blend):
    """Set the transmittance of sixteen rays to 1, and forget the edges they met."""
    colour, edges = blend.transmittance, blend.edges
    for j in range(3 * PACKET_WIDTH):
        colour[j] = _f(1.0)
    for lane in range(PACKET_WIDTH):
        edges[lane] = np.uint32(0)


@inner
def filter_colour_at(row, k, pack, b1, b2, rgba, out):
    """Write lerp(1, c, a) of row k at barycentrics (b1, b2), and return a.

    row : (K, 21) float32, see `TransmittanceTable`; pack : TexturePack
    rgba : (4,) float64, working memory; out : (3,) float32 output
    """
    rgba[0] = rgba[1] = rgba[2] = rgba[3] = 1.0
    if row[k, TEXTURE] >= _f(0.0):
        u = np.float64(row[k, UV]) + b1 * row[k, UV_EDGE_1] + b2 * row[k, UV_EDGE_2]
        v = np.float64(row[k, UV + 1]) + b1 * row[k, UV_EDGE_1 + 1] + b2 * row[k, UV_EDGE_2 + 1]
        sample_texture(pack, np.int64(row[k, TEXTURE]), u, v, 0.0, rgba)
    alpha = np.float64(row[k, ALPHA]) + b1 * row[k, ALPHA_EDGE_1] + b2 * row[k, ALPHA_EDGE_2]
    alpha = smaller(larger(alpha * rgba[3], 0.0), 1.0)
    for c in range(3):
        colour = np.float64(row[k, COLOUR + c])
        colour += b1 * row[k, COLOUR_EDGE_1 + c] + b2 * row[k, COLOUR_EDGE_2 + c]
        out[c] = 1.0 - alpha * (1.0 - smaller(larger(colour * rgba[c], 0.0), 1.0))
    return alpha


@inner
def trace_transmittance(blend, function, width, on, rays, hits, spare_on, spare):
    """Find the colours that sixteen rays have passed; `transmittance` then returns them.

    blend, width : of `PacketBuffers`; function : its `occluded`
    on, rays : (16,) int32 and (21 * 16,) float32, the lanes as they were traced
    hits : `rays` as uint32 if they were traced to their first hit, None if to any
    spare_on, spare : packet memory of the native width, of `PacketBuffers`
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
            # The light starts at this hit: it did not pass the surface.
            stop[lane] = hits[PRIM_ID * PACKET_WIDTH + lane]
    _trace_blend_lanes(blend, function, width, on, rays, spare_on, spare, 0)


@inner
def _trace_blend_lanes(blend, function, width, on, rays, spare_on, spare, number):
    """Call `_trace_blend` for sixteen rays, in packets of the native width.

    on : (16,) int32; rays : (21 * 16,) float32; number : 0 or PASSES, see `packets`
    spare_on, spare : packet memory of the native width, of `PacketBuffers`
    """
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
def trace_transmittance_packet(blend, function, width, on, packet, hits):
    """Do the same for one packet, in place.

    blend, width : of `PacketBuffers`, width at most 16; function : its `occluded`
    on : (width,) int32; packet : (12 * width or more,) float32
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
def _trace_blend(blend, function, width, on, packet, first):
    """Trace a packet against the BLEND triangles.

    The filter function multiplies the transmittance of rays `first` and on, and rejects every hit.
    on : (width,) int32; packet : (12 * width or more,) float32
    """
    words = packet.view(np.uint32)
    for lane in range(width):
        words[ID * width + lane] = np.uint32(first + lane + 1)
    call_embree_with(function, on, blend.scene, packet, blend.arguments)
    for lane in range(width):
        words[ID * width + lane] = np.uint32(0)


@inner
def gather_turns(blend):
    """Return how often each gather ray is traced, see `trace_gather`."""
    return 1 if blend is None else 2


@inner
def trace_gather(blend, turn, intersect, scene, width, query, on, rays, words, spare_on, spare):
    """Trace sixteen gather rays to their first hit.

    With BLEND surfaces each ray is traced twice. In turn 0 it stops at them with probability alpha, which
    samples the light from these surfaces. In turn 1 it passes all of them (where alpha < 1), and the light of
    its hit is multiplied by T.
    blend, scene, width, query : of `PacketBuffers`; intersect : its `intersect`
    on : (16,) int32; rays, words : (21 * 16,) float32 and uint32; see `trace_lanes`
    spare_on, spare : packet memory of the native width, of `PacketBuffers`
    """
    if blend is None:
        trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
        return
    set_blend_rule(blend, words, UNAWARE if turn == 1 else np.uint32(0))
    trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
    set_blend_rule(blend, words, np.uint32(0))


@inner
def set_blend_rule(blend, words, number):
    """Set the treatment of BLEND surfaces by sixteen rays: their ID row.

    blend : BlendBuffers or None; nothing is done for None
    words : (21 * 16,) uint32, the packet; number : uint32, 0, `packets.UNAWARE` or `packets.SOLID`
    """
    if blend is None:
        return
    for lane in range(PACKET_WIDTH):
        words[ID * PACKET_WIDTH + lane] = number


@inner
def any_stopped(blend, words):
    """Return whether any of sixteen rays ended at a BLEND surface; True without such surfaces.

    words : (21 * 16,) uint32, the packet
    """
    if blend is None:
        return True
    found = False
    for lane in range(PACKET_WIDTH):
        found = found or words[GEOM_ID * PACKET_WIDTH + lane] == BLEND_GEOMETRY
    return found


@inner
def trace_gather_transmittance(blend, turn, function, width, on, rays, words, spare_on, spare):
    """Find the factors of the light that gather rays find in a turn, see `transmittance`.

    Turn 0: the colours passed before it for a ray that stopped at a BLEND surface, 0 for the others.
    Turn 1: the transmittance of all BLEND surfaces on the way for the others, 0 for those.
    blend, width : of `PacketBuffers`; function : its `occluded`
    on : (16,) int32; rays, words : (21 * 16,) float32 and uint32; see `trace_lanes`
    spare_on, spare : packet memory of the native width, of `PacketBuffers`
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
def transmittance(blend, c, lane):
    """Return the transmittance of channel c along a lane's ray, after it was traced."""
    if blend is None:
        return _f(1.0)
    return blend.transmittance[c * PACKET_WIDTH + lane]


@inner
def count_coloured(blend):
    """Return how many transmittances of sixteen rays are below 1: 0 if none met a BLEND surface."""
    if blend is None:
        return 0
    colour = blend.transmittance
    found = 0
    for j in range(3 * PACKET_WIDTH):
        found += 1 if colour[j] != _f(1.0) else 0
    return found
