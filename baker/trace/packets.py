"""Defines the memory layout of ray packets in Numba kernels, and calls Embree through function addresses.

A packet of N rays is an array of 21 rows of N four-byte numbers: 12 rows for the rays and 9 rows for their
hits, laid out as RTCRayHitN. Lane i is column i, which holds ray i. Kernels call Embree through integer
addresses, because Numba cannot cache kernels that call ctypes objects.

The kernels of a bake process PACKET_WIDTH rays at a time. If the processor traces narrower packets natively,
`trace_lanes` splits the packet. With a constant width, the rows of a packet are at constant offsets, so the
compiler vectorises loops over lanes. Generating a cosine-weighted ray takes 3.5 ns with a constant width, and
28 ns with a variable width.

Based on: Embree 4 API reference, RTCRayHitN.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic
from numpy.typing import NDArray

from baker.trace.embree import Tracer
from baker.trace.jit import inner

# Rows of a packet: those of RTCRayN, then those of RTCHitN. ROWS is their number.
ORG_X, ORG_Y, ORG_Z, TNEAR, DIR_X, DIR_Y, DIR_Z, TIME, TFAR, MASK, ID, FLAGS = range(12)
NG_X, NG_Y, NG_Z, HIT_U, HIT_V, PRIM_ID, GEOM_ID = range(12, 19)
ROWS = 21
MAX_WIDTH = 16
# Number of rays that the kernels of a bake process together.
PACKET_WIDTH = 16
NO_HIT = np.uint32(0xFFFFFFFF)
# Fields of RTCFilterFunctionNArguments, in units of 8 bytes. FILTER_WIDTH is a field of 4 bytes.
FILTER_VALID, FILTER_DATA, FILTER_CONTEXT, FILTER_RAY, FILTER_HIT, FILTER_WIDTH = range(6)
# `geomID` of BLEND triangles, see `RayScene`.
BLEND_GEOMETRY = np.uint32(2)
# Values of a ray's ID row. They select what the hit filter does at a BLEND surface of alpha a and colour c.
# T = (1 - a) lerp(1, c, a) is the transmittance of the surface. t is `BlendBuffers.transmittance` of the ray
# with index n - 1.
#
#     scene of all triangles     0             the ray stops with probability a
#                                n = 1 to 16   the ray stops if a = 1, else it passes and t is multiplied by T
#                                UNAWARE       the ray stops if a = 1, else it passes
#                                SOLID         the ray passes if a = 0, else it stops
#     scene of BLEND triangles   n = 1 to 16   the ray passes, t is multiplied by lerp(1, c, a)
#                                PASSES + n    the ray passes, t is multiplied by T
PASSES, UNAWARE, SOLID = PACKET_WIDTH, np.uint32(2 * PACKET_WIDTH + 1), np.uint32(2 * PACKET_WIDTH + 2)
# Layout of the memory at the address of the query context, which filter functions of BLEND triangles read.
# Offsets are in four-byte words. RTCRayQueryContext comes first, then `BlendBuffers.stop`, `.transmittance`
# and `.edges`, and then, for each ray, EDGE_HITS pairs of the distance and the surface of a hit on an edge.
EDGE_HITS = 32
BLEND_STOP, BLEND_TRANSMITTANCE, BLEND_EDGES = 16, 16 + PACKET_WIDTH, 16 + 4 * PACKET_WIDTH
BLEND_EDGE_HITS = BLEND_EDGES + PACKET_WIDTH
CONTEXT_WORDS = BLEND_EDGE_HITS + PACKET_WIDTH * EDGE_HITS * 2
# RTC_RAY_QUERY_FLAG_COHERENT.
_COHERENT = 1 << 16


def _call(context: Any, builder: Any, kinds: Any, args: Any) -> Any:
    """Emit a call of `void f(int* valid, RTCScene, RTCRayN*, RTCArguments*)`.

    args : address of f, `valid`, scene, packet and, optionally, the RTCArguments; without these, NULL is
        passed
    kinds : Numba types of `args`
    """
    byte_pointer = ir.IntType(8).as_pointer()
    function_type = ir.FunctionType(ir.VoidType(), [byte_pointer] * 4)
    function = builder.inttoptr(args[0], function_type.as_pointer())
    data = [
        builder.bitcast(context.make_array(kinds[k])(context, builder, args[k]).data, byte_pointer)
        for k in (1, *range(3, len(args)))
    ]
    scene_pointer = builder.inttoptr(args[2], byte_pointer)
    arguments = data[2] if len(data) > 2 else byte_pointer(None)
    builder.call(function, [data[0], scene_pointer, data[1], arguments])
    return context.get_dummy_value()


def _call_embree(typing_context, address, valid, scene, ray):  # type: ignore[no-untyped-def]
    """Call rtcIntersectN or rtcOccludedN for a packet.

    address, scene : int64, addresses of the function and of the RTCScene
    valid : (N,) int32, -1 for lanes to trace, 0 for other lanes; ray : the packet, float32
    """
    signature = types.void(types.int64, valid, types.int64, ray)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(context, builder, sig.args, args)

    return signature, codegen


call_embree: Any = intrinsic(_call_embree)


def _call_embree_with(typing_context, address, valid, scene, ray, arguments):  # type: ignore[no-untyped-def]
    """Call rtcIntersectN or rtcOccludedN for a packet, with `arguments` (5,) int64, from `arguments_of`.

    The other arguments are those of `_call_embree`.
    """
    signature = types.void(types.int64, valid, types.int64, ray, arguments)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(context, builder, sig.args, args)

    return signature, codegen


call_embree_with: Any = intrinsic(_call_embree_with)


def _copy_four(typing_context, target, to, source, start):  # type: ignore[no-untyped-def]
    """Copy source[start : start + 4] to target[to : to + 4], without bounds checks.

    target, source : arrays of four-byte items
    """
    signature = types.void(target, types.intp, source, types.intp)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        four = ir.VectorType(ir.IntType(32), 4).as_pointer()
        target_data, source_data = (
            context.make_array(sig.args[k])(context, builder, args[k]).data for k in (0, 2)
        )
        loaded = builder.load(builder.bitcast(builder.gep(source_data, [args[3]]), four), align=4)
        builder.store(loaded, builder.bitcast(builder.gep(target_data, [args[1]]), four), align=4)
        return context.get_dummy_value()

    return signature, codegen


copy_four: Any = intrinsic(_copy_four)


class BlendBuffers(NamedTuple):
    """Memory for the transmittance of BLEND surfaces along sixteen rays, for one thread.

    Attributes
    ----------
    scene : int
        `Tracer.blend_scene`.
    coloured : int
        0 if no triangle of `scene` colours light.
    arguments : (5,) int64
        RTCOccludedArguments. In memory, the arrays below follow the query context of these arguments, so that
        filter functions can access the arrays.
    stop : (16,) uint32
        Triangle at which each ray ends. This triangle does not change the transmittance.
    transmittance : (3 * 16,) float32
        Transmittance of each ray: a row of 16 numbers for R, then G, then B.
    edges : (16,) uint32
        Number of each ray's hits on edges of triangles so far.
    """

    scene: int
    coloured: int
    arguments: NDArray[np.int64]
    stop: NDArray[np.uint32]
    transmittance: NDArray[np.float32]
    edges: NDArray[np.uint32]


class PacketBuffers(NamedTuple):
    """A tracer with the memory of one packet, for one thread.

    Attributes
    ----------
    scene, intersect, occluded, width : int
        See `Tracer`.
    valid : (16,) int32
        -1 for lanes to trace, 0 for others.
    floats, words : (21 * 16,) float32 and uint32
        A packet of the native width; both arrays share their memory.
    lane_valid, lane_floats, lane_words : ndarray
        `valid`, `floats` and `words` of a packet of PACKET_WIDTH rays.
    query : (5,) int64
        From `arguments_of`, with the coherent flag if `Tracer.coherent` is true.
    blend : BlendBuffers or None
        None without BLEND triangles; Numba then compiles kernels without the code for transmittance.
    """

    scene: int
    intersect: int
    occluded: int
    width: int
    valid: NDArray[np.int32]
    floats: NDArray[np.float32]
    words: NDArray[np.uint32]
    lane_valid: NDArray[np.int32]
    lane_floats: NDArray[np.float32]
    lane_words: NDArray[np.uint32]
    query: NDArray[np.int64]
    blend: BlendBuffers | None = None


def new_packet_buffers(tracer: Tracer, *, solid: bool = False) -> PacketBuffers:
    """Return memory for packets, aligned to 64 bytes as Embree requires.

    All rays have time 0, tnear 0 and all mask bits set. Kernels do not change these rows.

    Parameters
    ----------
    tracer : Tracer
        Scene to trace.
    solid : bool
        Whether the rays of `lane_floats` stop at BLEND surfaces of any alpha above 0, see `SOLID`.

    Returns
    -------
    PacketBuffers
        Memory for one thread.
    """
    valid, floats = _packet_memory(tracer.width)
    lane_valid, lane_floats = _packet_memory(PACKET_WIDTH)
    if solid:
        lane_floats.view(np.uint32)[ID * PACKET_WIDTH : (ID + 1) * PACKET_WIDTH] = SOLID
    return PacketBuffers(
        *tracer[:4],
        *(valid, floats, floats.view(np.uint32)),
        *(lane_valid, lane_floats, lane_floats.view(np.uint32)),
        arguments_of(coherent=tracer.coherent),
        None if tracer.blend_scene is None else new_blend_buffers(tracer.blend_scene, tracer.coloured),
    )


def new_blend_buffers(scene: int, coloured: bool) -> BlendBuffers:
    """Return memory for the transmittance of sixteen rays.

    Parameters
    ----------
    scene : int
        `Tracer.blend_scene`.
    coloured : bool
        `Tracer.coloured`.

    Returns
    -------
    BlendBuffers
        Memory for one thread.
    """
    # RTCRayQueryContext, with all instance IDs invalid, followed by the arrays that filter functions access.
    memory = aligned_floats(CONTEXT_WORDS)
    words = memory.view(np.uint32)
    words[:BLEND_STOP] = NO_HIT
    # Do not set the coherent flag. With the flag, Embree traverses the rays of each octant of directions
    # separately, but calls the filter for all rays of the packet at each leaf.
    arguments = arguments_of()
    arguments[1] = memory.ctypes.data
    stop, edges = words[BLEND_STOP:BLEND_TRANSMITTANCE], words[BLEND_EDGES:BLEND_EDGE_HITS]
    return BlendBuffers(scene, int(coloured), arguments, stop, memory[BLEND_TRANSMITTANCE:BLEND_EDGES], edges)


def arguments_of(*, coherent: bool = False) -> NDArray[np.int64]:
    """Return RTCIntersectArguments or RTCOccludedArguments, whose layouts are equal.

    The structure is 32 bits of flags, 32 bits of features, and NULL for context and functions.

    Parameters
    ----------
    coherent : bool
        Whether Embree traverses the rays of a packet together (RTC_RAY_QUERY_FLAG_COHERENT).

    Returns
    -------
    (5,) int64
        The structure.
    """
    flags = _COHERENT if coherent else 0
    return np.array([0xFFFFFFFF << 32 | flags, 0, 0, 0, 0], np.uint64).view(np.int64)


def _packet_memory(width: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Return `valid` (16,), all 0, and a packet of `width` lanes in (21 * 16,), with all mask bits set."""
    valid, floats = aligned_floats(MAX_WIDTH).view(np.int32), aligned_floats(ROWS * MAX_WIDTH)
    floats.view(np.uint32)[MASK * width : (MASK + 1) * width] = NO_HIT
    return valid, floats


def aligned_floats(n: int) -> NDArray[np.float32]:
    """Return an array of zeros whose address is a multiple of 64 bytes.

    Parameters
    ----------
    n : int
        Number of items.

    Returns
    -------
    (n,) float32
        Zeros.
    """
    raw = np.zeros(4 * n + 64, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + 4 * n].view(np.float32)


@inner
def set_ray(floats, words, width, lane, x, y, z, dx, dy, dz, tfar):  # type: ignore[no-untyped-def]
    """Write one ray into a lane of a packet.

    floats, words : (21 * width,) float32 and uint32, the packet; both arrays share their memory
    x, y, z : origin, metres; dx, dy, dz : direction; tfar : end of the ray, in units of the direction's
    length
    """
    floats[ORG_X * width + lane] = x
    floats[ORG_Y * width + lane] = y
    floats[ORG_Z * width + lane] = z
    floats[DIR_X * width + lane] = dx
    floats[DIR_Y * width + lane] = dy
    floats[DIR_Z * width + lane] = dz
    floats[TFAR * width + lane] = tfar
    words[GEOM_ID * width + lane] = np.uint32(0xFFFFFFFF)


@inner
def trace(function, scene, valid, floats):  # type: ignore[no-untyped-def]
    """Trace the lanes whose `valid` is -1, and write their hits into the packet.

    function : address of `intersect` or `occluded`; scene : see `Tracer`
    valid : (width,) int32; floats : (21 * width,) float32, the packet
    """
    call_embree(function, valid, scene, floats)


@inner
def trace_lanes(function, scene, width, query, lane_valid, lane_floats, valid, floats):  # type: ignore[no-untyped-def]
    """Trace the rays of sixteen lanes whose `lane_valid` is -1, in packets of the native width.

    function : address of `intersect` or `occluded`; scene, width, query : see `PacketBuffers`
    lane_valid : (16,) int32; lane_floats : (21 * 16,) float32, packet of the sixteen rays and their hits
    valid, floats : working memory, a packet of the native width, see `PacketBuffers`
    """
    if width == PACKET_WIDTH:
        call_embree_with(function, lane_valid, scene, lane_floats, query)
        return
    # Copy four lanes at a time with `copy_four`, because the compiler generates less code for it than for
    # loops over lanes.
    for first in range(0, PACKET_WIDTH, width):
        lane = first
        while lane < first + width and lane_valid[lane] == 0:
            lane += 1
        if lane == first + width:
            continue
        for to in range(0, width, 4):
            at = first + to
            copy_four(valid, to, lane_valid, at)
            for row in range(DIR_Z + 1):
                copy_four(floats, row * width + to, lane_floats, row * PACKET_WIDTH + at)
            copy_four(floats, TFAR * width + to, lane_floats, TFAR * PACKET_WIDTH + at)
            copy_four(floats, ID * width + to, lane_floats, ID * PACKET_WIDTH + at)
            copy_four(floats, GEOM_ID * width + to, lane_floats, GEOM_ID * PACKET_WIDTH + at)
        call_embree_with(function, valid, scene, floats, query)
        for to in range(0, width, 4):
            at = first + to
            copy_four(lane_floats, TFAR * PACKET_WIDTH + at, floats, TFAR * width + to)
            for row in range(HIT_U, GEOM_ID + 1):
                copy_four(lane_floats, row * PACKET_WIDTH + at, floats, row * width + to)
