"""The function that Embree asks at hits of MASK and BLEND triangles whether they count.

A BLEND hit counts with probability alpha. The number that decides comes from the bits of the ray and of
the triangle: the same ray always gets the same answer, however it is packed and on whatever thread.

Based on: Enderton et al., Stochastic transparency, 2010; Embree 4 API reference, RTCFilterFunctionN.
"""

from __future__ import annotations

import numpy as np
from numba import carray, cfunc, types  # type: ignore[attr-defined]

from baker.kernels.alpha import AlphaTable, presence
from baker.kernels.sampling import hash_u32
from baker.kernels.textures import TexturePack
from baker.trace.embree import SeeThrough
from baker.trace.packets import DIR_X, HIT_U, HIT_V, NG_X, ORG_X, PRIM_ID
from baker.trace.pointers import pointer

_INV_2_32 = 1.0 / 4294967296.0
_U, _V, _PRIM = HIT_U - NG_X, HIT_V - NG_X, PRIM_ID - NG_X


def filter_of(alpha: AlphaTable, pack: TexturePack) -> SeeThrough:
    """Return what the ray tree has to know of the triangles that let light through."""
    arrays = (alpha.slot, alpha.row, pack.pixels, pack.level, pack.wrap)
    data = np.array([x for a in arrays for x in (a.ctypes.data, len(a))], np.int64)
    return SeeThrough(alpha.slot >= 0, _let_through.address or 0, data.ctypes.data, (arrays, data))


@cfunc(types.void(types.voidptr), cache=True, error_model="numpy")
def _let_through(arguments):  # type: ignore[no-untyped-def]
    """Clear `valid` of the hits that light passes; nothing else is written."""
    # RTCFilterFunctionNArguments: valid, geometryUserPtr, context, ray, hit, N (of four bytes).
    given = carray(arguments, (6,), np.int64)
    n = given[5] & 0xFFFFFFFF
    valid = carray(pointer(given[0]), (n,), np.int32)
    data = carray(pointer(given[1]), (10,), np.int64)
    ray = carray(pointer(given[3]), (9 * n,), np.uint32)
    hit = carray(pointer(given[4]), (6 * n,), np.float32)
    hit_words = carray(pointer(given[4]), (6 * n,), np.uint32)
    slot = carray(pointer(data[0]), (data[1],), np.int32)
    row = carray(pointer(data[2]), (data[3], 16), np.float32)
    pixels = carray(pointer(data[4]), (data[5], 4), np.float32)
    level = carray(pointer(data[6]), (data[7], 16, 3), np.int64)
    wrap = carray(pointer(data[8]), (data[9], 2), np.int64)
    for lane in range(n):
        if valid[lane] != -1:
            continue
        prim = hit_words[_PRIM * n + lane]
        b1, b2 = np.float64(hit[_U * n + lane]), np.float64(hit[_V * n + lane])
        share = presence(row, np.int64(slot[prim]), pixels, level, wrap, b1, b2)
        if share >= 1.0:
            continue
        if share > 0.0:
            bits = hash_u32(prim)
            for axis in range(3):
                bits = hash_u32(np.uint32(bits ^ ray[(ORG_X + axis) * n + lane]))
                bits = hash_u32(np.uint32(bits ^ ray[(DIR_X + axis) * n + lane]))
            if bits * _INV_2_32 < share:
                continue
        valid[lane] = 0
