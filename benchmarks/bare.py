"""Measures the ray rate of Embree alone: packets of rays as in a bake, without any evaluation of the hits.

There are two loops. `ready` traces packets that were created before the measurement. `made` also creates the
rays inside the measurement, like the kernels of a bake. Both use the points, directions, packet width, tiles
and threads of a bake.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numba import njit
from numpy.typing import NDArray

from baker.core.parallel import run_tiles
from baker.core.progress import silent
from baker.core.stage import Stage
from baker.kernels.emitters import Emitters
from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_frame, new_seeds
from baker.kernels.sampling import shared_bits_mask, sobol_reversed, texel_scramble, triangle_barycentric
from baker.kernels.surface import N_POINTS
from baker.pipeline.prepare import PreparedScene
from baker.radiosity.point_cache import points_of
from baker.trace.packets import (
    DIR_X,
    ORG_X,
    PACKET_WIDTH,
    TFAR,
    call_embree_with,
    new_packet_buffers,
    trace_lanes,
)

# Number of rows of a packet that hold the rays. A row is one member of Embree's `RTCRayHit16`, such as
# `org_x`, for all lanes.
RAY_ROWS = 12
# Row of the hit's geometry ID, the only row of the hit that must be reset before each call.
GEOM_ROW = 18
# Number of texels in a tile.
TILE = 256
# Approximate limit of the number of rays that are created in advance for the loop `ready`. A ray takes about
# 50 bytes.
MOST_READY = 4_000_000


@njit(cache=True, nogil=True)
def _aim_hemisphere(rays, words, origin, normal, group, lanes, net, shared, seeds, frame, s, far):  # type: ignore[no-untyped-def]
    k = s * N_POINTS // len(net)
    if s == 0 or k != (s - 1) * N_POINTS // len(net):
        load_frames(rays, frame, origin, normal, group, lanes, k)
    aim_lanes(rays, words, frame, seeds, net[s, 0], net[s, 1], shared, far)


@njit(cache=True, nogil=True)
def _aim_emitter(rays, on, origin, normal, group, lanes, net, shared, seeds, s, corner, cumulative):  # type: ignore[no-untyped-def]
    """Aim the rays of a packet at points distributed uniformly over the emitters' area.

    As in a bake, a lane is inactive if the front of the emitter or the surface at the point faces away.

    rays : float32 rows of the packet, output
    on : (PACKET_WIDTH,) int32 output, -1 for active lanes
    origin, normal : (n, 16, 3) float32, the 16 points of n texels
    net : (n_samples, 2), Sobol points
    corner : (M, 12) float32, cumulative : (M,) float32, results of `_emitter_corners`
    """
    k = s * N_POINTS // len(net)
    d = np.zeros(3, np.float32)
    for lane in range(lanes):
        i = group + lane
        u = texel_scramble(net[s, 0], seeds[lane], shared)
        v = texel_scramble(net[s, 1], seeds[PACKET_WIDTH + lane], shared)
        m = min(np.searchsorted(cumulative, u, side="right"), len(cumulative) - 1)
        low = cumulative[m - 1] if m else np.float32(0.0)
        u = min(max((u - low) / (cumulative[m] - low), np.float32(0.0)), np.float32(1.0))
        b1, b2 = triangle_barycentric(u, v)
        facing = emitted = np.float32(0.0)
        for c in range(3):
            edge1, edge2 = corner[m, 3 + c] - corner[m, c], corner[m, 6 + c] - corner[m, c]
            d[c] = corner[m, c] + b1 * edge1 + b2 * edge2 - origin[i, k, c]
            facing += d[c] * normal[i, k, c]
            emitted -= d[c] * corner[m, 9 + c]
            rays[(ORG_X + c) * PACKET_WIDTH + lane] = origin[i, k, c]
            rays[(DIR_X + c) * PACKET_WIDTH + lane] = d[c]
        rays[TFAR * PACKET_WIDTH + lane] = np.float32(0.9999)
        on[lane] = -1 if facing > 0.0 and emitted > 0.0 else 0


@njit(cache=True, nogil=True)
def _made(function, buffers, origin, normal, begin, net, shared, far):  # type: ignore[no-untyped-def]
    """Create and trace all hemisphere rays of a tile.

    Returns a number that depends on the results, so that the compiler does not remove the loop.
    """
    width, scene = buffers.width, buffers.scene
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    seeds, frame = new_seeds(), new_frame()
    mixed = np.uint32(0)
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = min(PACKET_WIDTH, len(origin) - group)
        lane_seeds(begin + group, lanes, 25, seeds)
        for lane in range(PACKET_WIDTH):
            on[lane] = -1 if lane < lanes else 0
        for s in range(len(net)):
            _aim_hemisphere(rays, words, origin, normal, group, lanes, net, shared, seeds, frame, s, far)
            trace_lanes(function, scene, width, buffers.query, on, rays, spare_on, spare)
            mixed ^= words[TFAR * PACKET_WIDTH]
    return mixed


@njit(cache=True, nogil=True)
def _store(buffers, origin, normal, begin, net, shared, far, corner, cumulative, bank, lanes_on):  # type: ignore[no-untyped-def]
    """Create all packets of a tile, towards emitters if `corner` has rows, else over the hemisphere.

    bank : (packets, RAY_ROWS * width) float32 output, rays
    lanes_on : (packets, width) int32 output, -1 for active lanes
    """
    width = buffers.width
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    seeds, frame = new_seeds(), new_frame()
    packet = 0
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = min(PACKET_WIDTH, len(origin) - group)
        lane_seeds(begin + group, lanes, 25, seeds)
        for lane in range(PACKET_WIDTH):
            on[lane] = -1 if lane < lanes else 0
        for s in range(len(net)):
            if len(corner):
                _aim_emitter(
                    rays, on, origin, normal, group, lanes, net, shared, seeds, s, corner, cumulative
                )
            else:
                _aim_hemisphere(rays, words, origin, normal, group, lanes, net, shared, seeds, frame, s, far)
            for first in range(0, PACKET_WIDTH, width):
                for row in range(RAY_ROWS):
                    for lane in range(width):
                        bank[packet, row * width + lane] = rays[row * PACKET_WIDTH + first + lane]
                for lane in range(width):
                    lanes_on[packet, lane] = on[first + lane]
                packet += 1


@njit(cache=True, nogil=True)
def _ready(function, buffers, bank, lanes_on):  # type: ignore[no-untyped-def]
    """Trace the packets stored by `_store`; return a number that depends on the results, see `_made`."""
    width, scene, valid, floats, words = (
        buffers.width,
        buffers.scene,
        buffers.valid,
        buffers.floats,
        buffers.words,
    )
    mixed = np.uint32(0)
    for packet in range(len(bank)):
        some = np.int32(0)
        for lane in range(width):
            valid[lane] = lanes_on[packet, lane]
            some |= valid[lane]
            words[GEOM_ROW * width + lane] = np.uint32(0xFFFFFFFF)
        if some == 0:
            continue
        for j in range(RAY_ROWS * width):
            floats[j] = bank[packet, j]
        call_embree_with(function, valid, scene, floats, buffers.query)
        mixed ^= words[GEOM_ROW * width]
    return mixed


@dataclass(frozen=True)
class _Tile:
    begin: int
    origin: NDArray[np.float32]
    normal: NDArray[np.float32]
    bank: NDArray[np.float32]
    lanes_on: NDArray[np.int32]
    rays: int


class BareRays:
    """Rays of one kind, which can be traced repeatedly.

    If there are too many rays to store (`MOST_READY`), they start only at the texels of every k-th tile.

    Parameters
    ----------
    world : PreparedScene
        Result of `baker.pipeline.prepare.prepare_scene`.
    n_samples : int
        Number of rays per texel.
    seed : int
        Seed of the directions.
    threads : int
        Number of threads.
    occlusion : bool
        Trace occlusion rays instead of closest-hit rays.
    distance : float
        Length of the rays, metres; inf for unlimited.
    to_emitters : bool
        Aim the rays at emissive triangles. Otherwise, they are distributed over the hemisphere.
    """

    def __init__(
        self,
        world: PreparedScene,
        *,
        n_samples: int,
        seed: int,
        threads: int,
        occlusion: bool,
        distance: float = np.inf,
        to_emitters: bool = False,
    ) -> None:
        self._tracer = world.rays.tracer
        self._function = self._tracer.occluded if occlusion else self._tracer.intersect
        self._threads = threads
        self._net = sobol_reversed(n_samples, seed, 6)
        self._shared = shared_bits_mask(n_samples)
        self._far = np.float32(min(distance, float(FAR)))
        self._made_too = not to_emitters
        corner, cumulative = _emitter_corners(world.emitters, wanted=to_emitters)
        n = world.texels.n_front
        tiles = -(-n // TILE)
        every = max(1, -(-n * n_samples // MOST_READY))
        self._tiles = [
            self._tile(world, number * TILE, min((number + 1) * TILE, n), corner, cumulative)
            for number in range(0, tiles, every)
        ]
        self.rays = sum(tile.rays for tile in self._tiles)

    def _tile(
        self,
        world: PreparedScene,
        begin: int,
        end: int,
        corner: NDArray[np.float32],
        cumulative: NDArray[np.float32],
    ) -> _Tile:
        origin, normal = points_of(world.job.surface, world.job.valid_points, np.arange(begin, end))
        width, n_samples = self._tracer.width, len(self._net)
        packets = -(-(end - begin) // PACKET_WIDTH) * (PACKET_WIDTH // width) * n_samples
        bank = np.zeros((packets, RAY_ROWS * width), np.float32)
        lanes_on = np.zeros((packets, width), np.int32)
        buffers = new_packet_buffers(self._tracer)
        _store(
            buffers, origin, normal, begin, self._net, self._shared, self._far, corner, cumulative,
            bank, lanes_on,
        )  # fmt: skip
        return _Tile(begin, origin, normal, bank, lanes_on, (end - begin) * n_samples)

    def rate(self, *, ready: bool) -> float:
        """Trace all rays once and return the rate in Mrays/s.

        Parameters
        ----------
        ready : bool
            Whether to trace the stored packets. Otherwise the rays are created inside the measurement, which
            is only possible for hemisphere rays.
        """
        if not ready and not self._made_too:
            raise ValueError("rays to emitters are only measured ready-made")
        local = threading.local()

        def work(begin: int, end: int) -> None:
            if not hasattr(local, "buffers"):
                local.buffers = new_packet_buffers(self._tracer)
            for tile in self._tiles[begin:end]:
                if ready:
                    _ready(self._function, local.buffers, tile.bank, tile.lanes_on)
                else:
                    _made(
                        self._function, local.buffers, tile.origin, tile.normal, tile.begin,
                        self._net, self._shared, self._far,
                    )  # fmt: skip

        start = perf_counter()
        run_tiles(len(self._tiles), 4, work, threads=self._threads, stage=Stage.FINAL_GATHER, progress=silent)
        return self.rays / (perf_counter() - start) / 1e6

    def warm(self) -> None:
        """Compile the kernels by tracing the first tile."""
        first, self._tiles = self._tiles, self._tiles[:1]
        self.rate(ready=True)
        if self._made_too:
            self.rate(ready=False)
        self._tiles = first


def _emitter_corners(emitters: Emitters, *, wanted: bool) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the geometry of M emissive triangles; M = 0 if `wanted` is false.

    Returns (M, 12) float32, the three corners and the normal of each triangle, and (M,) float32, the
    cumulative share of the triangles in the total area.
    """
    if not wanted or not len(emitters.row):
        return np.zeros((0, 12), np.float32), np.zeros(0, np.float32)
    area = emitters.row[:, 12].astype(np.float64)
    return np.ascontiguousarray(emitters.row[:, :12]), (np.cumsum(area) / area.sum()).astype(np.float32)
