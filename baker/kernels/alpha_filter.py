"""The function that Embree asks at hits of MASK and BLEND triangles whether they count.

A BLEND hit counts with probability alpha. The number that decides comes from the bits of the ray and of
the triangle: the same ray always gets the same answer, however it is packed and on whatever thread. Rays with
a number (`shadow`) decide together with the 15 others of their texel: of alpha 0.25, four of them stop.

Based on: Enderton et al., Stochastic transparency, 2010; Laine and Karras, Stratified sampling for
stochastic transparency, 2011; Embree 4 API reference, RTCFilterFunctionN.
"""

from __future__ import annotations

import numpy as np
from numba import carray, cfunc, types  # type: ignore[attr-defined]

from baker.kernels.alpha import AlphaTable, presence
from baker.kernels.sampling import hash_u32
from baker.kernels.textures import TexturePack
from baker.trace.embree import SeeThrough
from baker.trace.jit import inner
from baker.trace.packets import DIR_X, HIT_U, HIT_V, ID, NG_X, ORG_X, PRIM_ID
from baker.trace.pointers import pointer

_INV_2_32 = 1.0 / 4294967296.0
_U, _V, _PRIM = HIT_U - NG_X, HIT_V - NG_X, PRIM_ID - NG_X


def filter_of(alpha: AlphaTable, pack: TexturePack) -> SeeThrough:
    """Return what the ray tree has to know of the triangles that let light through."""
    arrays = (alpha.slot, alpha.row, pack.pixels, pack.level, pack.wrap)
    data = np.array([x for a in arrays for x in (a.ctypes.data, len(a))], np.int64)
    return SeeThrough(alpha.slot >= 0, _let_through.address or 0, data.ctypes.data, (arrays, data))


@inner
def _one_of_sixteen(k, seed):  # type: ignore[no-untyped-def]
    """Return a random uint32 whose upper four bits take each value once over k = 0 to 15."""
    x = np.uint32(k)
    for turn in range(4):
        # Each step maps 0 to 15 onto itself, by seven bits of the seed a turn.
        part = np.uint32(seed >> np.uint32(7 * turn))
        x = np.uint32(
            (x ^ (part & np.uint32(15))) * (((part >> np.uint32(3)) & np.uint32(14)) | np.uint32(1))
        )
        x = np.uint32(x & np.uint32(15))
        x = np.uint32(x ^ (x >> np.uint32(2)))
    return np.uint32((x << np.uint32(28)) | (hash_u32(np.uint32(seed + k)) >> np.uint32(4)))


@cfunc(types.void(types.voidptr), cache=True, error_model="numpy")
def _let_through(arguments):  # type: ignore[no-untyped-def]
    """Clear `valid` of the hits that light passes; nothing else is written."""
    # RTCFilterFunctionNArguments: valid, geometryUserPtr, context, ray, hit, N (of four bytes).
    given = carray(arguments, (6,), np.int64)
    n = given[5] & 0xFFFFFFFF
    valid = carray(pointer(given[0]), (n,), np.int32)
    data = carray(pointer(given[1]), (10,), np.int64)
    ray = carray(pointer(given[3]), (12 * n,), np.uint32)
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
            number = ray[ID * n + lane]
            if number != np.uint32(0):
                seed = hash_u32(np.uint32(bits ^ (number & np.uint32(0xFFFFFFF0))))
                bits = _one_of_sixteen(number & np.uint32(15), seed)
            else:
                for axis in range(3):
                    bits = hash_u32(np.uint32(bits ^ ray[(ORG_X + axis) * n + lane]))
                    bits = hash_u32(np.uint32(bits ^ ray[(DIR_X + axis) * n + lane]))
            if bits * _INV_2_32 < share:
                continue
        valid[lane] = 0
