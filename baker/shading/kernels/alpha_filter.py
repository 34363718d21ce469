# mypy: disable-error-code="no-untyped-def"
"""The filter function of MASK and BLEND triangles, which accepts or rejects ray hits.

A hit on a MASK triangle is accepted if alpha is at least the cutoff. A hit on a BLEND triangle of alpha a and
colour c is accepted if a is 1, and rejected if a is 0. For other a, the ID of the ray decides:

- Shadow rays (ID 1 to 16, the ray's number): `packets.BlendBuffers.transmittance` is multiplied by 1 - a and
  by the colour of the passing light (`pane`), and the hit is rejected. So Embree calls the filter for every
  crossing of the ray, in any order. If the transmittance falls below `_DARK`, the hit is accepted, which
  blocks the ray.
- Rays that pass BLEND surfaces (ID `packets.UNAWARE`): the hit is rejected.
- Rays between points of a texel (ID `packets.SOLID`): the hit is accepted.
- Other rays (ID 0): the hit is accepted with probability a. The random number is a hash of the bits of the
  ray and of the triangle's number; at an edge, the connected surface replaces the triangle's number. So a ray
  has the same result in any packet and on any thread. Decisions for different surfaces or different rays are
  independent.

Based on: Enderton et al., Stochastic transparency, 2010; Embree 4 API reference, RTCFilterFunctionN.
"""

from __future__ import annotations

import numpy as np
from numba import carray, cfunc, types  # type: ignore[attr-defined]

from baker.kernels.alpha import ROW_LENGTH as ALPHA_ROW_LENGTH
from baker.kernels.alpha import SURFACE, AlphaTable, opacity
from baker.kernels.sampling import hash_u32
from baker.kernels.textures import MAX_LEVELS, TexturePack
from baker.kernels.transmittance import ROW_LENGTH, TransmittanceTable, no_transmittance
from baker.shading.kernels.edge_hits import crossed_before, on_edge
from baker.shading.kernels.pane import cosine_of, is_pane, passed_colour_at
from baker.trace.embree import HitFilter
from baker.trace.jit import inner, larger, scratch
from baker.trace.packets import (
    BLEND_TRANSMITTANCE,
    CONTEXT_WORDS,
    DIR_X,
    FILTER_CONTEXT,
    FILTER_DATA,
    FILTER_HIT,
    FILTER_RAY,
    FILTER_VALID,
    FILTER_WIDTH,
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
# Indices in the user data of the filter, which contains address and length of each array.
_ALPHA_SLOT, _ALPHA_ROW, _PIXELS, _CODED, _LEVEL, _N_LEVELS, _WRAP, _BLEND_SLOT, _BLEND_ROW = range(0, 18, 2)
_U, _V, _PRIM = HIT_U - NG_X, HIT_V - NG_X, PRIM_ID - NG_X
# Limit of the transmittance (largest of R, G and B) along a shadow ray. Below this limit, the ray is treated
# as blocked.
_DARK = np.float32(1.0e-9)
_rgba, _rgb = scratch((4,), np.float64), scratch((3,), np.float64)


def filter_of(alpha: AlphaTable, blend: TransmittanceTable | None, pack: TexturePack) -> HitFilter:
    """Return the filter of the triangles in `alpha`; `blend` is the table of BLEND triangles, or None."""
    blend = no_transmittance() if blend is None else blend
    arrays = (
        *(alpha.slot, alpha.row, *pack),
        *(blend.slot, blend.row),
    )
    data = np.array([x for a in arrays for x in (a.ctypes.data, len(a))], np.int64)
    return HitFilter(alpha.slot >= 0, _let_through.address or 0, data.ctypes.data, (arrays, data))


@inner
def _hash_ray(bits, ray, n, lane):
    """Return a uint32 hash of `bits` and of the origin and direction of the ray in a lane.

    ray : (12 * n,) uint32, n rays as Embree passes them
    """
    for axis in range(3):
        bits = hash_u32(np.uint32(bits ^ ray[(ORG_X + axis) * n + lane]))
        bits = hash_u32(np.uint32(bits ^ ray[(DIR_X + axis) * n + lane]))
    return bits


@inner
def _surface_bits(surface, ray, hit, n, lane):
    """Return a uint32 hash of a surface and of the side from which a ray hits it.

    If the ray crosses an edge, this hash replaces the hash of the triangle's number. So the decision is the
    same for all triangles at the edge. The side is included, because a ray crosses a closed surface from
    outside and from inside, and the two decisions must be independent.

    surface : float32, `AlphaTable` column SURFACE
    ray, hit : (12 * n,) and (6 * n,) float32, arrays that Embree passes; n : packet width
    """
    facing = np.float32(0.0)
    for axis in range(3):
        facing += hit[axis * n + lane] * ray[(DIR_X + axis) * n + lane]
    return hash_u32(np.uint32(2 * np.int64(surface) + (1 if facing > np.float32(0.0) else 0)) ^ np.uint32(77))


@cfunc(types.void(types.voidptr), cache=True, error_model="numpy")
def _let_through(arguments):
    """Reject hits by setting `valid` to 0, and multiply the transmittance of shadow rays.

    arguments : address of RTCFilterFunctionNArguments
    """
    # View the arguments as arrays. N has four bytes. The arrays of `BlendBuffers` follow the query context
    # only for shadow rays.
    given = carray(arguments, (6,), np.int64)
    n = given[FILTER_WIDTH] & 0xFFFFFFFF
    valid = carray(pointer(given[FILTER_VALID]), (n,), np.int32)
    data = carray(pointer(given[FILTER_DATA]), (18,), np.int64)
    context = carray(pointer(given[FILTER_CONTEXT]), (CONTEXT_WORDS,), np.float32)
    context_words = carray(pointer(given[FILTER_CONTEXT]), (CONTEXT_WORDS,), np.uint32)
    ray = carray(pointer(given[FILTER_RAY]), (12 * n,), np.float32)
    ray_words = carray(pointer(given[FILTER_RAY]), (12 * n,), np.uint32)
    hit = carray(pointer(given[FILTER_HIT]), (6 * n,), np.float32)
    hit_words = carray(pointer(given[FILTER_HIT]), (6 * n,), np.uint32)
    slot = carray(pointer(data[_ALPHA_SLOT]), (data[_ALPHA_SLOT + 1],), np.int32)
    row = carray(pointer(data[_ALPHA_ROW]), (data[_ALPHA_ROW + 1], ALPHA_ROW_LENGTH), np.float32)
    pack = TexturePack(
        carray(pointer(data[_PIXELS]), (data[_PIXELS + 1], 4), np.float32),
        carray(pointer(data[_CODED]), (data[_CODED + 1], 4), np.uint8),
        carray(pointer(data[_LEVEL]), (data[_LEVEL + 1], MAX_LEVELS, 3), np.int64),
        carray(pointer(data[_N_LEVELS]), (data[_N_LEVELS + 1],), np.int64),
        carray(pointer(data[_WRAP]), (data[_WRAP + 1], 4), np.int64),
    )
    blend_slot = carray(pointer(data[_BLEND_SLOT]), (data[_BLEND_SLOT + 1],), np.int32)
    blend_row = carray(pointer(data[_BLEND_ROW]), (data[_BLEND_ROW + 1], ROW_LENGTH), np.float32)
    rgba, rgb = _rgba(), _rgb()
    for lane in range(n):
        if valid[lane] != -1:
            continue
        # Accept the hit if the triangle is opaque there, reject it if it is fully transparent. A pane of
        # alpha 0 has a colour.
        prim = hit_words[_PRIM * n + lane]
        k = np.int64(slot[prim])
        b1, b2 = np.float64(hit[_U * n + lane]), np.float64(hit[_V * n + lane])
        share = opacity(row, k, pack, b1, b2)
        if share >= 1.0:
            continue
        if share <= 0.0 and not is_pane(row, k):
            valid[lane] = 0
            continue
        if ray_words[ID * n + lane] == SOLID:
            continue
        # For a ray that is traced to its first hit, accept the hit with probability alpha.
        number = np.int64(ray_words[ID * n + lane]) - 1
        if number < 0:
            bits = hash_u32(prim)
            if on_edge(b1, b2):
                bits = _surface_bits(row[k, SURFACE], ray, hit, n, lane)
            if _hash_ray(bits, ray_words, n, lane) * _INV_2_32 >= share:
                valid[lane] = 0
            continue
        # For a shadow ray, reject the hit, and multiply the transmittance unless the hit is on an edge of a
        # surface that was already crossed there.
        valid[lane] = 0
        if number >= PACKET_WIDTH:
            continue
        if on_edge(b1, b2) and crossed_before(
            context, context_words, number, row[k, SURFACE], ray[TFAR * n + lane]
        ):
            continue
        cosine = cosine_of(ray, hit, n, lane)
        passed_colour_at(blend_row, np.int64(blend_slot[prim]), pack, b1, b2, cosine, rgba, rgb)
        largest = np.float32(0.0)
        for c in range(3):
            kept = context[BLEND_TRANSMITTANCE + c * PACKET_WIDTH + number] * np.float32(
                (1.0 - share) * rgb[c]
            )
            context[BLEND_TRANSMITTANCE + c * PACKET_WIDTH + number] = kept
            largest = larger(largest, kept)
        if largest < _DARK:
            valid[lane] = -1
