"""Defines the memory layout of all paths of a tile: blocks of eight paths.

A block is a ray packet of width 8, followed by further rows of eight numbers. A lane is one column of a block
and holds one path. Rays are traced and shaded in place. All rows are at constant offsets in one array, for
two reasons. The compiler vectorizes loops over lanes only if it can prove that rows do not overlap. It
vectorizes loops of eight iterations only if they access a single array. Lanes of ended paths are refilled
with paths from the last blocks, so that packets stay full.

Based on: Laine, Karras and Aila, Megakernels considered harmful, 2013 (many paths between rays); van
Antwerpen, Improving SIMD efficiency for parallel Monte Carlo light transport on the GPU, 2011 (compaction).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.transmittance import trace_transmittance_packet, transmittance
from baker.trace.embree import RayScene
from baker.trace.jit import inner
from baker.trace.packets import (
    DIR_X,
    GEOM_ID,
    MASK,
    NO_HIT,
    ORG_X,
    PRIM_ID,
    ROWS,
    TFAR,
    BlendBuffers,
    aligned_floats,
    call_embree,
    new_blend_buffers,
)
from baker.trace.pointers import prefetch

# Number of paths in a block, and number of blocks of a tile.
BLOCK_WIDTH, BLOCKS = 8, 32
_L = BLOCK_WIDTH
# Rows after those of the packet. State of a path:
#
#     BETA      throughput (3)
#     DENSITY   density, per steradian, of the ray's direction; 0 if emission at its hit has MIS weight 1
#     COSINE    cosine of the ray's direction to the shading normal at its origin
#     BOUNCES   number of reflections; -1 before the first hit of a camera ray
#     POINT     row of the path's point in the tile's sums
#     ALIVE     1 if the lane holds a path, else 0
#     KEY       uint32: number of the point, for random numbers
#     SAMPLE    uint32: number of the sample
#     COUNT     uint32: twice the number of vertices so far
BETA, DENSITY, COSINE, BOUNCES, POINT, ALIVE = (ROWS + i for i in (0, 3, 4, 5, 6, 7))
KEY, SAMPLE, COUNT = ROWS + 8, ROWS + 9, ROWS + 10
# At a vertex (3 rows each): albedo; unit geometric normal, on the side that was hit; unit shading normal;
# tangent; bitangent.
ALBEDO, NORMAL, SHADED, TANGENT, BITANGENT = (ROWS + i for i in (11, 14, 17, 20, 23))
# Random numbers, float32, uniform in [1, 2): a pair for the point on a light, a pair for the next direction,
# and one for Russian roulette. As uint32: random numbers that choose a light (CHOICE) and a lobe (LOBE).
U_LIGHT, W_LIGHT, U_DIRECTION, W_DIRECTION, ROULETTE = (ROWS + i for i in (26, 27, 28, 29, 30))
CHOICE, LOBE = ROWS + 31, ROWS + 32
# Ray to a light: unit direction (3), length in metres, contribution if nothing blocks it (3), barycentrics of
# its end on an emitter.
TO_LIGHT, MAX_DISTANCE, VALUE, B1, B2 = (ROWS + i for i in (33, 36, 37, 40, 41))
# Copies of the hit triangle's columns CORNER to TWO_SIDED in `Surfaces.row` (23), and of the chosen light's
# row in `LightTable.row` (20).
TRIANGLE, LIGHT_ROW = ROWS + 42, ROWS + 65
N_ROWS = ROWS + 85
BLOCK = N_ROWS * _L
# BINS: number of packets of pending shadow rays. Rays to the same light are in the same packet; with more
# than eight lights, several lights share a packet. Rows of such a packet after the 12 rows of its rays:
# contribution if nothing blocks the ray (3), `POINT` of its path.
BINS = 8
BIN_VALUE, BIN_POINT, BIN_ROWS = 12, 15, 16

_f = np.float32


class PathMemory(NamedTuple):
    """An Embree scene and the memory of one thread for paths.

    Attributes
    ----------
    scene, intersect, occluded : int
        Addresses of the RTCScene, rtcIntersect8 and rtcOccluded8.
    on : (8,) int32
        -1 for lanes to trace, 0 for others.
    s : (BLOCKS * BLOCK,) float32
        Blocks.
    words : (BLOCKS * BLOCK,) uint32
        The memory of `s`, viewed as uint32.
    bins : (BINS * BIN_ROWS * 8,) float32
        Packets of shadow rays.
    blend : BlendBuffers or None
        See `PacketBuffers`.
    """

    scene: int
    intersect: int
    occluded: int
    on: NDArray[np.int32]
    s: NDArray[np.float32]
    words: NDArray[np.uint32]
    bins: NDArray[np.float32]
    blend: BlendBuffers | None


def new_path_memory(rays: RayScene) -> PathMemory:
    """Return memory aligned to 64 bytes, in which all rays have time 0, tnear 0 and all mask bits set."""
    on, s = aligned_floats(BLOCK_WIDTH).view(np.int32), aligned_floats(BLOCKS * BLOCK)
    bins = aligned_floats(BINS * BIN_ROWS * _L)
    s.view(np.uint32).reshape(BLOCKS, N_ROWS, BLOCK_WIDTH)[:, MASK] = NO_HIT
    bins.view(np.uint32).reshape(BINS, BIN_ROWS, BLOCK_WIDTH)[:, MASK] = NO_HIT
    intersect, occluded = rays.functions(BLOCK_WIDTH)
    blend_scene, coloured = rays.tracer.blend_scene, rays.tracer.coloured
    blend = None if blend_scene is None else new_blend_buffers(blend_scene, coloured)
    return PathMemory(rays.tracer.scene, intersect, occluded, on, s, s.view(np.uint32), bins, blend)


@inner
def unsigned(index):  # type: ignore[no-untyped-def]
    """Return an index below 2^32 as an int64 that the compiler can prove to be non-negative.

    The compiler then omits the code for negative indices.
    """
    return np.int64(np.uint32(index))


@inner
def lane_start(lane):  # type: ignore[no-untyped-def]
    """Return the index in `s` of row 0 of a lane. Lane numbers continue from one block to the next."""
    return unsigned(lane // BLOCK_WIDTH * BLOCK + lane % BLOCK_WIDTH)


@inner
def colour_lanes(blend, occluded, s, base, on):  # type: ignore[no-untyped-def]
    """Multiply the throughput of a block's lanes by the transmittance of `BLEND` surfaces along their rays.

    s : blocks, float32; base : index of the block's first number; on : (8,) int32, see `PathMemory`
    """
    if blend is None:
        return
    trace_transmittance_packet(blend, occluded, BLOCK_WIDTH, on, s[base : base + BLOCK], True)
    for c in range(3):
        for lane in range(BLOCK_WIDTH):
            s[base + (BETA + c) * _L + lane] *= transmittance(blend, c, lane)


@inner
def trace_blocks(s, words, blocks, on, intersect, occluded, scene, blend, surface):  # type: ignore[no-untyped-def]
    """Trace the rays of the first `blocks` blocks, and prefetch the rows of the hit triangles.

    Shading starts after all blocks are traced; by then the rows have arrived in the cache.

    s, words : blocks; on : (8,) int32, working memory
    surface : (T, 32) float32, see `Surfaces`; a row is two cache lines

    Returns
    -------
    int
        Number of rays.
    """
    n = 0
    for block in range(blocks):
        base = unsigned(block * BLOCK)
        for lane in range(BLOCK_WIDTH):
            alive = s[base + ALIVE * _L + lane] > _f(0.0)
            on[lane] = np.int32(-1) if alive else np.int32(0)
            n += 1 if alive else 0
            s[base + TFAR * _L + lane] = _f(1.0e30)
            words[base + GEOM_ID * _L + lane] = np.uint32(0xFFFFFFFF)
        call_embree(intersect, on, scene, s[base : base + BLOCK])
        colour_lanes(blend, occluded, s, base, on)
        for lane in range(BLOCK_WIDTH):
            if on[lane] != 0 and words[base + GEOM_ID * _L + lane] != NO_HIT:
                row = surface.ctypes.data + 4 * surface.shape[1] * np.int64(words[base + PRIM_ID * _L + lane])
                prefetch(row)
                prefetch(row + 64)
    return n


@inner
def close_gaps(s, blocks):  # type: ignore[no-untyped-def]
    """Move paths from the last blocks into free lanes of the first blocks; return the number of blocks used.

    s : blocks, float32
    """
    low, high = 0, blocks * _L - 1
    while True:
        while low <= high and s[lane_start(low) + ALIVE * _L] > _f(0.0):
            low += 1
        while low <= high and s[lane_start(high) + ALIVE * _L] == _f(0.0):
            high -= 1
        if low >= high:
            return (low + BLOCK_WIDTH - 1) // BLOCK_WIDTH
        to = lane_start(low)
        start = lane_start(high)
        for a in range(3):
            s[to + (ORG_X + a) * _L] = s[start + (ORG_X + a) * _L]
            s[to + (DIR_X + a) * _L] = s[start + (DIR_X + a) * _L]
        for r in range(BETA, COUNT + 1):
            s[to + r * _L] = s[start + r * _L]
        s[start + ALIVE * _L] = _f(0.0)
