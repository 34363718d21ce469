# mypy: disable-error-code="no-untyped-def"
"""Computes the transmittance of BLEND surfaces along rays, for R, G and B.

    T = (1 - a) lerp(1, c, a)                           a: alpha
    c = clamp(factor * texture * vertex colour, 0, 1)   colour of the surface

Along a shadow ray, Embree's filter function multiplies the T of all BLEND surfaces that the ray crosses
(`shading.kernels.alpha_filter`).

A ray that is traced to its first hit passes each BLEND surface with probability 1 - a. The light of the ray
is then multiplied by lerp(1, c, a) for each surface that it passed, so that its expected factor is T. Embree
calls the filter function for hits in any order, including hits beyond the first hit. Therefore the colours
are multiplied along a second ray, which ends at the first hit of the first ray. The second ray is traced in a
second tree that contains only the BLEND triangles.

The argument `blend` of the functions below is a `BlendBuffers`, or None in scenes without BLEND surfaces.
With None, Numba compiles the functions without the code for transmittance.
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
# Columns of `TransmittanceTable.row`. Columns 0 to 11 are those of `AlphaTable.row`.
#
#     COLOUR                         factor times vertex colour at corner 0, RGB (3)
#     COLOUR_EDGE_1, COLOUR_EDGE_2   value at corner 1 and at corner 2, minus value at corner 0 (3 each)
COLOUR, COLOUR_EDGE_1, COLOUR_EDGE_2 = 12, 15, 18
ROW_LENGTH = 21


class TransmittanceTable(NamedTuple):
    """The K BLEND triangles that let light through and whose alpha is above 0 somewhere.

    Attributes
    ----------
    slot : (T,) int32
        Row in `row` of each triangle of the scene, -1 for all other triangles.
    row : (K, 21) float32
        Data of the K triangles: the columns of `AlphaTable.row`, then COLOUR to COLOUR_EDGE_2.
    coloured : bool
        Whether the colour c of any of the K triangles is not white.
    """

    slot: NDArray[np.int32]
    row: NDArray[np.float32]
    coloured: bool = False


def no_transmittance() -> TransmittanceTable:
    """Return the table of a scene without BLEND triangles.

    Returns
    -------
    TransmittanceTable
        Arrays of length 0.
    """
    return TransmittanceTable(np.zeros(0, np.int32), np.zeros((0, ROW_LENGTH), np.float32))


@inner
def trace_shadow_lanes(blend, function, scene, width, query, on, rays, words, spare_on, spare):
    """Trace sixteen shadow rays. `transmittance` then returns the product of T along each unblocked ray.

    blend, scene, width, query : fields of `PacketBuffers`; function : `PacketBuffers.occluded`
    on : (16,) int32; rays, words : (21 * 16,) float32 and uint32; see `trace_lanes`
    spare_on, spare : `PacketBuffers.valid` and `.floats`, a packet of the native width
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
    """Trace the shadow rays of one packet of the native width, see `trace_shadow_lanes`.

    blend, scene, width : fields of `PacketBuffers`, width at most 16; function : `PacketBuffers.occluded`
    on : (width,) int32; packet : (12 * width or more,) float32, changed in place
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
    """Set the transmittance of sixteen rays to 1, and forget their hits on edges (`BlendBuffers.edges`)."""
    colour, edges = blend.transmittance, blend.edges
    for j in range(3 * PACKET_WIDTH):
        colour[j] = _f(1.0)
    for lane in range(PACKET_WIDTH):
        edges[lane] = np.uint32(0)


@inner
def filter_colour_at(row, k, pack, b1, b2, rgba, out):
    """Write lerp(1, c, a) of the triangle in row k at barycentrics (b1, b2); return alpha a.

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
    """Compute the product of lerp(1, c, a) along sixteen traced rays, which `transmittance` then returns.

    blend, width : fields of `PacketBuffers`; function : `PacketBuffers.occluded`
    on, rays : (16,) int32 and (21 * 16,) float32, the packet after tracing
    hits : uint32 view of `rays` if the rays were traced to their first hits, None if they were traced to any
        hit
    spare_on, spare : `PacketBuffers.valid` and `.floats`, a packet of the native width
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
            # Exclude the triangle that was hit: the light starts on it and does not pass it.
            stop[lane] = hits[PRIM_ID * PACKET_WIDTH + lane]
    _trace_blend_lanes(blend, function, width, on, rays, spare_on, spare, 0)


@inner
def _trace_blend_lanes(blend, function, width, on, rays, spare_on, spare, number):
    """Call `_trace_blend` for sixteen rays, in packets of the native width.

    on : (16,) int32; rays : (21 * 16,) float32
    number : with 0, hits multiply the transmittance by lerp(1, c, a); with PASSES, by T
    spare_on, spare : `PacketBuffers.valid` and `.floats`, a packet of the native width
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
    """Compute the transmittance for one packet of the native width, see `trace_transmittance`.

    blend, width : fields of `PacketBuffers`, width at most 16; function : `PacketBuffers.occluded`
    on : (width,) int32; packet : (12 * width or more,) float32, the packet after tracing; changed in place
    hits : bool, whether the rays were traced to their first hits
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

    The filter function multiplies the transmittance of each ray at each hit, and rejects the hit.

    on : (width,) int32; packet : (12 * width or more,) float32
    first : number of the packet's first ray among the sixteen, plus 0 or PASSES, see `_trace_blend_lanes`
    """
    words = packet.view(np.uint32)
    for lane in range(width):
        words[ID * width + lane] = np.uint32(first + lane + 1)
    call_embree_with(function, on, blend.scene, packet, blend.arguments)
    for lane in range(width):
        words[ID * width + lane] = np.uint32(0)


@inner
def gather_turns(blend):
    """Return how many times each gather ray is traced, see `trace_gather`."""
    return 1 if blend is None else 2


@inner
def trace_gather(blend, turn, intersect, scene, width, query, on, rays, words, spare_on, spare):
    """Trace sixteen gather rays to their first hit.

    In scenes with BLEND surfaces, each ray is traced in two turns. In turn 0, the ray stops at each BLEND
    surface with probability alpha. If it stops there, it samples the light that the BLEND surface reflects.
    In turn 1, the ray passes all BLEND surfaces where alpha < 1. If its hit is not on a BLEND surface, the
    light of the hit is multiplied by T of the surfaces that it passed.

    blend, scene, width, query, intersect : fields of `PacketBuffers`; turn : 0 or 1
    on : (16,) int32; rays, words : (21 * 16,) float32 and uint32; see `trace_lanes`
    spare_on, spare : `PacketBuffers.valid` and `.floats`, a packet of the native width
    """
    if blend is None:
        trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
        return
    set_blend_rule(blend, words, UNAWARE if turn == 1 else np.uint32(0))
    trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
    set_blend_rule(blend, words, np.uint32(0))


@inner
def set_blend_rule(blend, words, number):
    """Write the ID row of sixteen rays, which determines where they stop at BLEND surfaces.

    blend : BlendBuffers; with None, nothing is written
    words : (21 * 16,) uint32, the packet; number : uint32; 0, or UNAWARE or SOLID of `trace.packets`
    """
    if blend is None:
        return
    for lane in range(PACKET_WIDTH):
        words[ID * PACKET_WIDTH + lane] = number


@inner
def any_stopped(blend, words):
    """Return whether any of sixteen rays ended at a BLEND surface; True if `blend` is None.

    words : (21 * 16,) uint32, the packet after tracing
    """
    if blend is None:
        return True
    found = False
    for lane in range(PACKET_WIDTH):
        found = found or words[GEOM_ID * PACKET_WIDTH + lane] == BLEND_GEOMETRY
    return found


@inner
def trace_gather_transmittance(blend, turn, function, width, on, rays, words, spare_on, spare):
    """Compute the RGB factors of the light of sixteen gather rays, which `transmittance` then returns.

    Each factor is a product over the BLEND surfaces that the ray passed before its hit:

        turn    hit on a BLEND surface      other hit, or no hit
        0       product of lerp(1, c, a)    0
        1       0                           product of T

    blend, width : fields of `PacketBuffers`; turn : 0 or 1; function : `PacketBuffers.occluded`
    on : (16,) int32; rays, words : (21 * 16,) float32 and uint32; see `trace_lanes`
    spare_on, spare : `PacketBuffers.valid` and `.floats`, a packet of the native width
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
    """Return the transmittance of colour channel c along the traced ray of a lane; 1 if `blend` is None."""
    if blend is None:
        return _f(1.0)
    return blend.transmittance[c * PACKET_WIDTH + lane]


@inner
def count_coloured(blend):
    """Return how many of the 3 * 16 transmittances of sixteen rays are not 1.

    The number is 0 if no ray crossed a BLEND surface.
    """
    if blend is None:
        return 0
    colour = blend.transmittance
    found = 0
    for j in range(3 * PACKET_WIDTH):
        found += 1 if colour[j] != _f(1.0) else 0
    return found
