# mypy: disable-error-code="no-untyped-def"
"""The filter function of the tree of BLEND triangles, which multiplies transmittance and rejects every hit.

The ID of a ray is its number, 1 to 16, or PASSES plus its number (`trace.packets.PASSES`). If the ID is the
number, the transmittance is multiplied by the colour of the light that passes the surface (`pane`). If the ID
is PASSES plus the number, it is also multiplied by 1 - a, with the alpha a of the surface. In memory, the
transmittance is stored after the query context (`trace.packets.BlendBuffers`).

Based on: Embree 4 API reference, RTCFilterFunctionN and RTCRayQueryContext.
"""

from __future__ import annotations

import numpy as np
from numba import carray, cfunc, types  # type: ignore[attr-defined]

from baker.kernels.alpha import SURFACE
from baker.kernels.textures import MAX_LEVELS, TexturePack
from baker.kernels.transmittance import ROW_LENGTH, TransmittanceTable
from baker.shading.kernels.edge_hits import crossed_before, on_edge
from baker.shading.kernels.pane import cosine_of, passed_colour_at
from baker.trace.embree import HitFilter
from baker.trace.jit import scratch
from baker.trace.packets import (
    BLEND_STOP,
    BLEND_TRANSMITTANCE,
    CONTEXT_WORDS,
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
    PACKET_WIDTH,
    PASSES,
    PRIM_ID,
    TFAR,
)  # fmt: skip
from baker.trace.pointers import pointer

_U, _V, _PRIM = HIT_U - NG_X, HIT_V - NG_X, PRIM_ID - NG_X
# Indices in the user data of the filter, which contains address and length of each array.
_SLOT, _ROW, _PIXELS, _CODED, _LEVEL, _N_LEVELS, _WRAP = range(0, 14, 2)
_rgba, _rgb = scratch((4,), np.float64), scratch((3,), np.float64)


def filter_of(table: TransmittanceTable, pack: TexturePack) -> HitFilter:
    """Return the filter of the tree of BLEND triangles."""
    arrays = (table.slot, table.row, *pack)
    data = np.array([x for a in arrays for x in (a.ctypes.data, len(a))], np.int64)
    address = _multiply_colour.address or 0
    return HitFilter(table.slot >= 0, address, data.ctypes.data, (arrays, data), table.coloured)


@cfunc(types.void(types.voidptr), cache=True, error_model="numpy")
def _multiply_colour(arguments):
    """Multiply the transmittance of each valid lane's ray, and set `valid` to 0.

    arguments : address of RTCFilterFunctionNArguments
    """
    # View the arguments as arrays. N has four bytes.
    given = carray(arguments, (6,), np.int64)
    n = given[FILTER_WIDTH] & 0xFFFFFFFF
    valid = carray(pointer(given[FILTER_VALID]), (n,), np.int32)
    data = carray(pointer(given[FILTER_DATA]), (14,), np.int64)
    context = carray(pointer(given[FILTER_CONTEXT]), (CONTEXT_WORDS,), np.float32)
    context_words = carray(pointer(given[FILTER_CONTEXT]), (CONTEXT_WORDS,), np.uint32)
    ray = carray(pointer(given[FILTER_RAY]), (12 * n,), np.float32)
    ray_words = carray(pointer(given[FILTER_RAY]), (12 * n,), np.uint32)
    hit = carray(pointer(given[FILTER_HIT]), (6 * n,), np.float32)
    hit_words = carray(pointer(given[FILTER_HIT]), (6 * n,), np.uint32)
    slot = carray(pointer(data[_SLOT]), (data[_SLOT + 1],), np.int32)
    row = carray(pointer(data[_ROW]), (data[_ROW + 1], ROW_LENGTH), np.float32)
    pack = TexturePack(
        carray(pointer(data[_PIXELS]), (data[_PIXELS + 1], 4), np.float32),
        carray(pointer(data[_CODED]), (data[_CODED + 1], 4), np.uint8),
        carray(pointer(data[_LEVEL]), (data[_LEVEL + 1], MAX_LEVELS, 3), np.int64),
        carray(pointer(data[_N_LEVELS]), (data[_N_LEVELS + 1],), np.int64),
        carray(pointer(data[_WRAP]), (data[_WRAP + 1], 4), np.int64),
    )
    rgba, rgb = _rgba(), _rgb()
    for lane in range(n):
        if valid[lane] != -1:
            continue
        valid[lane] = 0
        prim = hit_words[_PRIM * n + lane]
        # Skip the hit at the end of the ray.
        number = np.int64(ray_words[ID * n + lane]) - 1
        full = number >= PASSES
        number -= PASSES if full else 0
        if not full and prim == context_words[BLEND_STOP + number]:
            continue
        # Skip the hit if it is on an edge of a surface that was already crossed there. Otherwise multiply.
        k = np.int64(slot[prim])
        b1, b2 = np.float64(hit[_U * n + lane]), np.float64(hit[_V * n + lane])
        if on_edge(b1, b2) and crossed_before(
            context, context_words, number, row[k, SURFACE], ray[TFAR * n + lane]
        ):
            continue
        alpha = passed_colour_at(row, k, pack, b1, b2, cosine_of(ray, hit, n, lane), rgba, rgb)
        share = 1.0 - alpha if full else 1.0
        for c in range(3):
            context[BLEND_TRANSMITTANCE + c * PACKET_WIDTH + number] *= np.float32(share * rgb[c])
