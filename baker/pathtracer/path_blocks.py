"""Blocks of eight paths, in which the paths of a tile are stored between two rays.

A block is a ray packet, followed by further rows of eight numbers. Rays are traced and shaded in place. All
rows of a block are at constant offsets in one array, since the compiler vectorizes loops over lanes only if
it can prove that rows do not overlap, and loops of eight only if they access a single array. Slots of ended
paths are filled with paths of the last blocks, so that packets stay full.

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

# Paths in a block, blocks of a tile.
BLOCK_WIDTH, BLOCKS = 8, 32
_L = BLOCK_WIDTH
# Rows after those of the packet. State of a path: throughput; density of the direction, per steradian (0: no
# MIS weight for emission); its cosine to the shading normal; bounces (-1 before the hit of a camera ray);
# point in the tile; 1 for a path. As uint32: point, sample, twice the number of vertices.
BETA, DENSITY, COSINE, BOUNCES, POINT, ALIVE = (ROWS + i for i in (0, 3, 4, 5, 6, 7))
KEY, SAMPLE, COUNT = ROWS + 8, ROWS + 9, ROWS + 10
# At a vertex: albedo, geometric normal on the side that was hit, shading normal, tangent, bitangent.
ALBEDO, NORMAL, SHADED, TANGENT, BITANGENT = (ROWS + i for i in (11, 14, 17, 20, 23))
# Uniform numbers, in [1, 2): two pairs (light, direction), and one for Russian roulette. As uint32: those
# that choose a light and a lobe.
U_LIGHT, W_LIGHT, U_DIRECTION, W_DIRECTION, ROULETTE = (ROWS + i for i in (26, 27, 28, 29, 30))
CHOICE, LOBE = ROWS + 31, ROWS + 32
# Ray to a light: direction, length, contribution if unblocked, barycentrics of its end.
TO_LIGHT, MAX_DISTANCE, VALUE, B1, B2 = (ROWS + i for i in (33, 36, 37, 40, 41))
# Copies of the hit triangle's first columns and of the chosen light's row.
TRIANGLE, LIGHT_ROW = ROWS + 42, ROWS + 65
N_ROWS = ROWS + 85
BLOCK = N_ROWS * _L
# Packets of pending shadow rays, by light; after the rows of the rays: contribution, point.
BINS = 8
BIN_VALUE, BIN_POINT, BIN_ROWS = 12, 15, 16

_f = np.float32


class PathMemory(NamedTuple):
    """An Embree scene and the memory of one thread for paths.

    scene, intersect, occluded : RTCScene, rtcIntersect8 and rtcOccluded8
    on (8,) int32 : lanes to trace
    s (BLOCKS * BLOCK,) float32, words (the same as uint32) : blocks
    bins (BINS * BIN_ROWS * 8,) float32 : packets of shadow rays
    blend : see `PacketBuffers.blend`
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
    """Return aligned memory; rows that kernels do not change are set: time and tnear 0, the mask."""
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
    """Return an index below 2^32 as a value that the compiler can prove to be non-negative: no wraparound."""
    return np.int64(np.uint32(index))


@inner
def lane_start(lane):  # type: ignore[no-untyped-def]
    """Return the index of a lane's first row; lanes are numbered through all blocks."""
    return unsigned(lane // BLOCK_WIDTH * BLOCK + lane % BLOCK_WIDTH)


@inner
def colour_lanes(blend, occluded, s, base, on):  # type: ignore[no-untyped-def]
    """Multiply the lanes' throughput by the transmittance of their rays.

    s : blocks, float32; on : (8,) int32, lanes to trace
    """
    if blend is None:
        return
    trace_transmittance_packet(blend, occluded, BLOCK_WIDTH, on, s[base : base + BLOCK], True)
    for c in range(3):
        for lane in range(BLOCK_WIDTH):
            s[base + (BETA + c) * _L + lane] *= transmittance(blend, c, lane)


@inner
def trace_blocks(s, words, blocks, on, intersect, occluded, scene, blend, surface):  # type: ignore[no-untyped-def]
    """Trace the rays of the first blocks and prefetch the rows, two cache lines each, of the hit triangles.

    Shading starts when all blocks are traced; the rows are in the cache then.

    s, words : blocks; on : (8,) int32, working memory; surface : (T, 32) float32, see `Surfaces`

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
    """Move paths from the last blocks into the gaps of the first; return the number of blocks left.

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
