"""Ray packets as Numba kernels see them: memory layout and calls through function addresses.

A packet of width N is 12 rows (ray) and 9 rows (hit) of N four-byte numbers, as RTCRayN and
RTCRayHitN lay them out. A call through an address held in an integer, unlike one through a
ctypes object, lets Numba keep the compiled kernel on disk.

The kernels of a bake handle sixteen rays at a time, whatever the width that the processor traces natively
(`trace_lanes`): with rows at constant offsets in one array, loops over lanes become
vector code. Making a cosine ray takes 3.5 ns that way, and 28 ns where the width is a variable.

Based on: Embree 4 API reference, RTCRayHitN.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from baker.trace.embree import Tracer

# Rows of a packet, in units of its width.
ORG_X, ORG_Y, ORG_Z, TNEAR, DIR_X, DIR_Y, DIR_Z, TIME, TFAR, MASK, ID, FLAGS = range(12)
NG_X, NG_Y, NG_Z, HIT_U, HIT_V, PRIM_ID, GEOM_ID = range(12, 19)
ROWS = 21
MAX_WIDTH = 16
# Rays that the kernels of a bake handle together.
LANES = 16
NO_HIT = np.uint32(0xFFFFFFFF)


@intrinsic
def call_embree(typing_context, address, valid, scene, ray, arguments):  # type: ignore[no-untyped-def]
    """Call `void f(int* valid, RTCScene, RTCRayN*, RTCArguments*)` at an address."""
    signature = types.void(types.int64, types.int64, types.int64, types.int64, types.int64)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        byte_pointer = ir.IntType(8).as_pointer()
        function_type = ir.FunctionType(ir.VoidType(), [byte_pointer] * 4)
        function = builder.inttoptr(args[0], function_type.as_pointer())
        builder.call(function, [builder.inttoptr(a, byte_pointer) for a in args[1:]])
        return context.get_dummy_value()

    return signature, codegen


class Caster(NamedTuple):
    """A tracer with the memory of one packet; each thread has its own.

    scene, intersect, occluded, width: see `Tracer`; valid (16,) int32, -1 for lanes to trace;
    floats (21 * 16,) float32 and words, the same memory as uint32: a packet of the native width.
    lane_valid, lane_floats, lane_words: the same for sixteen rays, rows 16 numbers apart.
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


def new_caster(tracer: Tracer) -> Caster:
    """Return packet memory at multiples of 64 bytes, as Embree wants.

    What no kernel changes is set here: time and tnear 0, all bits of the mask.
    """
    valid, floats = _packet_memory(tracer.width)
    lane_valid, lane_floats = _packet_memory(LANES)
    return Caster(
        *tracer, valid, floats, floats.view(np.uint32), lane_valid, lane_floats, lane_floats.view(np.uint32)
    )


def _packet_memory(width: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    raw = np.zeros((ROWS + 1) * MAX_WIDTH * 4 + 64, np.uint8)
    start = -raw.ctypes.data % 64
    valid = raw[start : start + MAX_WIDTH * 4].view(np.int32)
    floats = raw[start + MAX_WIDTH * 4 : start + (ROWS + 1) * MAX_WIDTH * 4].view(np.float32)
    floats.view(np.uint32)[MASK * width : (MASK + 1) * width] = NO_HIT
    return valid, floats


@njit(cache=True, nogil=True)
def set_ray(floats, words, width, lane, x, y, z, dx, dy, dz, tfar):  # type: ignore[no-untyped-def]
    """Write one ray into a lane of the packet."""
    floats[ORG_X * width + lane] = x
    floats[ORG_Y * width + lane] = y
    floats[ORG_Z * width + lane] = z
    floats[DIR_X * width + lane] = dx
    floats[DIR_Y * width + lane] = dy
    floats[DIR_Z * width + lane] = dz
    floats[TFAR * width + lane] = tfar
    words[GEOM_ID * width + lane] = np.uint32(0xFFFFFFFF)


@njit(cache=True, nogil=True)
def trace(function, scene, valid, floats):  # type: ignore[no-untyped-def]
    """Trace the lanes whose `valid` is -1; results are written into the packet."""
    call_embree(function, valid.ctypes.data, scene, floats.ctypes.data, 0)  # type: ignore[call-arg]


@njit(cache=True, nogil=True)
def trace_lanes(function, scene, width, lane_valid, lane_floats, valid, floats):  # type: ignore[no-untyped-def]
    """Trace those of sixteen rays whose `lane_valid` is -1, in packets of the native width.

    function, scene, width and the four arrays are a caster's
    """
    if width == LANES:
        trace(function, scene, lane_valid, lane_floats)
        return
    for first in range(0, LANES, width):
        some = np.int32(0)
        for lane in range(width):
            valid[lane] = lane_valid[first + lane]
            some |= valid[lane]
        if some == 0:
            continue
        for row in range(DIR_Z + 1):
            for lane in range(width):
                floats[row * width + lane] = lane_floats[row * LANES + first + lane]
        for lane in range(width):
            floats[TFAR * width + lane] = lane_floats[TFAR * LANES + first + lane]
            floats[ID * width + lane] = lane_floats[ID * LANES + first + lane]
            floats[GEOM_ID * width + lane] = lane_floats[GEOM_ID * LANES + first + lane]
        trace(function, scene, valid, floats)
        for lane in range(width):
            lane_floats[TFAR * LANES + first + lane] = floats[TFAR * width + lane]
        for row in range(HIT_U, GEOM_ID + 1):
            for lane in range(width):
                lane_floats[row * LANES + first + lane] = floats[row * width + lane]
