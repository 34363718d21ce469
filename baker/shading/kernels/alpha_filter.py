"""The function that Embree asks at hits of MASK and BLEND triangles whether they count.

A MASK hit counts where alpha reaches the cutoff. For a BLEND hit it depends on the ray (its ID row):

- Shadow rays (ID 1 to 16, the ray's number): the transmittance T = (1 - a) lerp(1, c, a) is multiplied into
  `packets.BlendBuffers.transmittance`, and the hit does not count. The ends of these rays are fixed, so
  Embree reports every crossing on the way, in any order.
- Rays that pass BLEND surfaces unaware (ID `packets.UNAWARE`): the hit counts where alpha is 1.
- Rays that ask what lies on which side (ID `packets.SOLID`): the hit counts where alpha is above 0.
- Other rays (ID 0): the hit counts with probability alpha. The number that decides is a hash of the bits of
  the ray and the triangle: the same ray always gets the same answer, however it is packed and on whatever
  thread, and surfaces along a ray decide independently. Rays of one texel differ in direction, so each has
  a decision of its own.

Based on: Enderton et al., Stochastic transparency, 2010; Embree 4 API reference, RTCFilterFunctionN.
"""

from __future__ import annotations

import numpy as np
from numba import carray, cfunc, types  # type: ignore[attr-defined]

from baker.kernels.alpha import SURFACE, AlphaTable, opacity
from baker.kernels.sampling import hash_u32
from baker.kernels.textures import MAX_LEVELS, TexturePack
from baker.kernels.transmittance import ROW_LENGTH, TransmittanceTable, filter_colour_at, no_transmittance
from baker.shading.kernels.edge_hits import crossed_before, on_edge
from baker.trace.embree import HitFilter
from baker.trace.jit import inner, larger, scratch
from baker.trace.packets import (
    BLEND_TRANSMITTANCE,
    CONTEXT_WORDS,
    DIR_X,
    HIT_U,
    HIT_V,
    ID,
    NG_X,
    ORG_X,
    PACKET_WIDTH,
    PRIM_ID,
    SOLID,
    TFAR,
)  # fmt: skip
from baker.trace.pointers import pointer

_INV_2_32 = 1.0 / 4294967296.0
_U, _V, _PRIM = HIT_U - NG_X, HIT_V - NG_X, PRIM_ID - NG_X
# Shadow rays that keep less than this share of their light are blocked.
_DARK = np.float32(1.0e-9)
_rgba, _rgb = scratch((4,), np.float64), scratch((3,), np.float64)


def filter_of(alpha: AlphaTable, blend: TransmittanceTable | None, pack: TexturePack) -> HitFilter:
    """Return what the ray tree has to know of the triangles that let light through."""
    blend = no_transmittance() if blend is None else blend
    arrays = (
        *(alpha.slot, alpha.row, pack.pixels, pack.level, pack.n_levels, pack.wrap),
        *(blend.slot, blend.row),
    )
    data = np.array([x for a in arrays for x in (a.ctypes.data, len(a))], np.int64)
    return HitFilter(alpha.slot >= 0, _let_through.address or 0, data.ctypes.data, (arrays, data))


@inner
def _hash_ray(bits, ray, n, lane):  # type: ignore[no-untyped-def]
    """Return a hash of `bits` and of origin and direction of a ray; ray (12 * n,) uint32."""
    for axis in range(3):
        bits = hash_u32(np.uint32(bits ^ ray[(ORG_X + axis) * n + lane]))
        bits = hash_u32(np.uint32(bits ^ ray[(DIR_X + axis) * n + lane]))
    return bits


@inner
def _surface_bits(surface, ray, hit, n, lane):  # type: ignore[no-untyped-def]
    """Return bits that the triangles of a surface share at an edge which a ray crosses.

    A closed surface is met from outside and then from inside: the side is part of the bits.
    """
    facing = np.float32(0.0)
    for axis in range(3):
        facing += hit[axis * n + lane] * ray[(DIR_X + axis) * n + lane]
    return hash_u32(np.uint32(2 * np.int64(surface) + (1 if facing > np.float32(0.0) else 0)) ^ np.uint32(77))


@cfunc(types.void(types.voidptr), cache=True, error_model="numpy")
def _let_through(arguments):  # type: ignore[no-untyped-def]
    """Clear `valid` of the hits that light passes; multiply the transmittance of shadow rays."""
    # RTCFilterFunctionNArguments: valid, geometryUserPtr, context, ray, hit, N (of four bytes).
    given = carray(arguments, (6,), np.int64)
    n = given[5] & 0xFFFFFFFF
    valid = carray(pointer(given[0]), (n,), np.int32)
    data = carray(pointer(given[1]), (16,), np.int64)
    # Only shadow rays have what lies behind the context.
    context = carray(pointer(given[2]), (CONTEXT_WORDS,), np.float32)
    context_words = carray(pointer(given[2]), (CONTEXT_WORDS,), np.uint32)
    ray = carray(pointer(given[3]), (12 * n,), np.float32)
    ray_words = carray(pointer(given[3]), (12 * n,), np.uint32)
    hit = carray(pointer(given[4]), (6 * n,), np.float32)
    hit_words = carray(pointer(given[4]), (6 * n,), np.uint32)
    slot = carray(pointer(data[0]), (data[1],), np.int32)
    row = carray(pointer(data[2]), (data[3], 16), np.float32)
    pack = TexturePack(
        carray(pointer(data[4]), (data[5], 4), np.float32),
        carray(pointer(data[6]), (data[7], MAX_LEVELS, 3), np.int64),
        carray(pointer(data[8]), (data[9],), np.int64),
        carray(pointer(data[10]), (data[11], 2), np.int64),
    )
    blend_slot = carray(pointer(data[12]), (data[13],), np.int32)
    blend_row = carray(pointer(data[14]), (data[15], ROW_LENGTH), np.float32)
    rgba, rgb = _rgba(), _rgb()
    for lane in range(n):
        if valid[lane] != -1:
            continue
        prim = hit_words[_PRIM * n + lane]
        k = np.int64(slot[prim])
        b1, b2 = np.float64(hit[_U * n + lane]), np.float64(hit[_V * n + lane])
        share = opacity(row, k, pack.pixels, pack.level, pack.wrap, b1, b2)
        if share >= 1.0:
            continue
        if share <= 0.0:
            valid[lane] = 0
            continue
        if ray_words[ID * n + lane] == SOLID:
            continue
        number = np.int64(ray_words[ID * n + lane]) - 1
        if number < 0:
            bits = hash_u32(prim)
            if on_edge(b1, b2):
                bits = _surface_bits(row[k, SURFACE], ray, hit, n, lane)
            if _hash_ray(bits, ray_words, n, lane) * _INV_2_32 >= share:
                valid[lane] = 0
            continue
        valid[lane] = 0
        if number >= PACKET_WIDTH:
            continue
        if on_edge(b1, b2) and crossed_before(
            context, context_words, number, row[k, SURFACE], ray[TFAR * n + lane]
        ):
            continue
        filter_colour_at(blend_row, np.int64(blend_slot[prim]), pack, b1, b2, rgba, rgb)
        most = np.float32(0.0)
        for c in range(3):
            kept = context[BLEND_TRANSMITTANCE + c * PACKET_WIDTH + number] * np.float32(
                (1.0 - share) * rgb[c]
            )
            context[BLEND_TRANSMITTANCE + c * PACKET_WIDTH + number] = kept
            most = larger(most, kept)
        if most < _DARK:
            valid[lane] = -1
