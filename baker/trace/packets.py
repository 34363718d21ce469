"""Ray packets in Numba kernels: memory layout, and calls through function addresses.

A packet of width N is 12 rows (ray) and 9 rows (hit) of N four-byte numbers, laid out as RTCRayN and
RTCRayHitN. Kernels call Embree through an address held in an integer: with a ctypes object Numba could not
cache them.

The kernels of a bake trace PACKET_WIDTH rays at a time, whatever width the processor traces natively
(`trace_lanes`): with rows at constant offsets in one array, loops over lanes are vectorised. Generating a
cosine-weighted ray takes 3.5 ns that way, and 28 ns where the width is a variable.

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

# Rows of a packet, in units of its width.
ORG_X, ORG_Y, ORG_Z, TNEAR, DIR_X, DIR_Y, DIR_Z, TIME, TFAR, MASK, ID, FLAGS = range(12)
NG_X, NG_Y, NG_Z, HIT_U, HIT_V, PRIM_ID, GEOM_ID = range(12, 19)
ROWS = 21
MAX_WIDTH = 16
# Rays that the kernels of a bake trace together.
PACKET_WIDTH = 16
NO_HIT = np.uint32(0xFFFFFFFF)
# Fields of RTCFilterFunctionNArguments, 8 bytes each; FILTER_WIDTH has 4.
FILTER_VALID, FILTER_DATA, FILTER_CONTEXT, FILTER_RAY, FILTER_HIT, FILTER_WIDTH = range(6)
# Geometry of BLEND triangles.
BLEND_GEOMETRY = np.uint32(2)
# Values of a ray's ID row: treatment of BLEND surfaces of alpha a and colour c.
#
#     tree of all triangles    0             stops with probability a
#                              n = 1 to 16   passes; T = (1 - a) lerp(1, c, a) is multiplied into
#                                            `BlendBuffers.transmittance` of ray n - 1
#                              UNAWARE       stops only where a = 1
#                              SOLID         passes only where a = 0
#     tree of BLEND triangles  n = 1 to 16   passes; lerp(1, c, a) is multiplied
#                              PASSES + n    passes; T is multiplied
PASSES, UNAWARE, SOLID = PACKET_WIDTH, np.uint32(2 * PACKET_WIDTH + 1), np.uint32(2 * PACKET_WIDTH + 2)
# Four-byte words that filter functions of BLEND triangles read at the address of the query context:
# RTCRayQueryContext, then `BlendBuffers.stop`, `.transmittance` and `.edges`, then EDGE_HITS pairs for each
# ray, distance and surface of a hit on an edge (`edge_hits`).
EDGE_HITS = 32
BLEND_STOP, BLEND_TRANSMITTANCE, BLEND_EDGES = 16, 16 + PACKET_WIDTH, 16 + 4 * PACKET_WIDTH
BLEND_EDGE_HITS = BLEND_EDGES + PACKET_WIDTH
CONTEXT_WORDS = BLEND_EDGE_HITS + PACKET_WIDTH * EDGE_HITS * 2
# RTC_RAY_QUERY_FLAG_COHERENT.
_COHERENT = 1 << 16


def _call(context: Any, builder: Any, kinds: Any, args: Any) -> Any:
    """Emit a call of `void f(int* valid, RTCScene, RTCRayN*, RTCArguments*)`, the last NULL if not given."""
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
    """Call the function at an address for a scene and the lanes of a packet.

    address, scene : int64; valid : (N,) int32; ray : the packet, float32
    """
    signature = types.void(types.int64, valid, types.int64, ray)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(context, builder, sig.args, args)

    return signature, codegen


call_embree: Any = intrinsic(_call_embree)


def _call_embree_with(typing_context, address, valid, scene, ray, arguments):  # type: ignore[no-untyped-def]
    """Do the same with the arguments in an array, see `arguments_of`."""
    signature = types.void(types.int64, valid, types.int64, ray, arguments)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return _call(context, builder, sig.args, args)

    return signature, codegen


call_embree_with: Any = intrinsic(_call_embree_with)


def _copy_four(typing_context, target, to, source, start):  # type: ignore[no-untyped-def]
    """Copy source[start : start + 4] to target[to : to + 4], four bytes an item, without bounds checks."""
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
        See `Tracer.blend_scene`.
    coloured : int
        0 if no triangle of that scene colours light.
    arguments : (5,) int64
        RTCOccludedArguments, whose context passes the arrays below to the filter functions.
    stop : (16,) uint32
        Triangle at which each ray ends; it lets nothing through.
    transmittance : (3 * 16,) float32
        Rows R, G, B.
    edges : (16,) uint32
        Number of hits on edges of triangles so far, see `edge_hits`.
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
        A packet of the native width; both are the same memory.
    lane_valid, lane_floats, lane_words : ndarray
        The same for PACKET_WIDTH rays: rows at offsets of 16 numbers.
    query : (5,) int64
        `arguments_of` rays of neighbouring texels in this scene.
    blend : BlendBuffers or None
        None without BLEND triangles; Numba then compiles kernels without transmittance.
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
    """Return memory for a packet, at multiples of 64 bytes as Embree requires.

    Rows that no kernel changes are set: time and tnear 0, all bits of the mask.

    Parameters
    ----------
    tracer : Tracer
        Scene to trace.
    solid : bool
        Whether the sixteen rays stop at BLEND surfaces wherever alpha is above 0, see `SOLID`.

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
    """Return memory for transmittance.

    Parameters
    ----------
    scene : int
        See `Tracer.blend_scene`.
    coloured : bool
        See `Tracer.coloured`.

    Returns
    -------
    BlendBuffers
        Memory for one thread.
    """
    # RTCRayQueryContext (without instances), followed by the arrays that the filter functions use.
    memory = aligned_floats(CONTEXT_WORDS)
    words = memory.view(np.uint32)
    words[:BLEND_STOP] = NO_HIT
    # Never coherent: with that flag Embree traverses the rays of each octant separately, but calls the filter
    # for all rays of the packet at each leaf.
    arguments = arguments_of()
    arguments[1] = memory.ctypes.data
    stop, edges = words[BLEND_STOP:BLEND_TRANSMITTANCE], words[BLEND_EDGES:BLEND_EDGE_HITS]
    return BlendBuffers(scene, int(coloured), arguments, stop, memory[BLEND_TRANSMITTANCE:BLEND_EDGES], edges)


def arguments_of(*, coherent: bool = False) -> NDArray[np.int64]:
    """Return RTCIntersectArguments or RTCOccludedArguments, whose layouts are the same.

    32 bits of flags, 32 bits of features, no context, no filter or other functions.

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
    """Return `valid` and a packet of `width` lanes with all bits of the mask set."""
    valid, floats = aligned_floats(MAX_WIDTH).view(np.int32), aligned_floats(ROWS * MAX_WIDTH)
    floats.view(np.uint32)[MASK * width : (MASK + 1) * width] = NO_HIT
    return valid, floats


def aligned_floats(n: int) -> NDArray[np.float32]:
    """Return zeros at a multiple of 64 bytes.

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

    floats, words : (21 * width,) float32 and uint32, the packet, one memory
    x, y, z : origin, metres; dx, dy, dz : direction; tfar : in units of its length
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
    """Trace the lanes whose `valid` is -1; hits are written into the packet.

    function : address; scene : of `Tracer`; valid : (width,) int32; floats : (21 * width,) float32
    """
    call_embree(function, valid, scene, floats)


@inner
def trace_lanes(function, scene, width, query, lane_valid, lane_floats, valid, floats):  # type: ignore[no-untyped-def]
    """Trace those of sixteen rays whose `lane_valid` is -1, in packets of the native width.

    function : address of intersect or occluded; scene, width, query : of `PacketBuffers`
    lane_valid : (16,) int32; lane_floats : (21 * 16,) float32, the rays; hits are written into them
    valid, floats : packet memory of the native width, of `PacketBuffers`
    """
    if width == PACKET_WIDTH:
        call_embree_with(function, lane_valid, scene, lane_floats, query)
        return
    # Copy four lanes at a time: for loops over lanes the compiler generates twenty times as much code.
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
