"""Defines the arguments that all ray stages of a bake share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import Part, TileRunner, run_tiles
from baker.core.progress import Progress
from baker.core.stage import Stage
from baker.kernels.surface import Surface
from baker.kernels.triangle_lookup import TriangleLookup
from baker.radiosity.point_cache import PointCache, some_points, tile_points
from baker.trace.embree import Tracer
from baker.trace.packets import PacketBuffers, new_packet_buffers


@dataclass(frozen=True)
class TraceJob:
    """Ray origins, the scene in which rays are traced, and the runner of tiles.

    Attributes
    ----------
    surface : Surface
        Triangles, and the n texel entries (rows of `TexelBuffer`) from which rays start.
    valid_points : (n,) uint16
        Bit k is set where point k of an entry is not inside geometry and lies on the entry's side
        (`radiosity.sides`).
    lookup : TriangleLookup
        Maps hits to texels.
    tracer : Tracer
        Embree scene.
    seed : int
        Seed of all random numbers.
    threads : int
        Number of threads of this process that compute tiles.
    progress : Progress
        Called between tiles.
    chart : (n,) int32, optional
        Chart of each entry. With None, emitters are chosen as if all entries were in one chart.
    point_cache : PointCache, optional
        Cache of points, which several stages share. With None, each stage computes the points of its tiles.
    runner : TileRunner
        Runs the tiles of a stage in this process or in others.
    """

    surface: Surface
    valid_points: NDArray[np.uint16]
    lookup: TriangleLookup
    tracer: Tracer
    seed: int
    threads: int
    progress: Progress
    chart: NDArray[np.int32] | None = None
    point_cache: PointCache | None = None
    runner: TileRunner = run_tiles

    @property
    def n(self) -> int:
        """Return the number of texel entries."""
        return len(self.surface.pixel)

    def on(self, runner: TileRunner) -> TraceJob:
        """Return the job with another tile runner."""
        return replace(self, runner=runner)

    def packet_buffers(self) -> PacketBuffers:
        """Return new packet buffers for one thread."""
        return new_packet_buffers(self.tracer)

    def occlusion_buffers(self, *, solid: bool = False) -> PacketBuffers:
        """Return packet buffers for occlusion rays, which are blocked or not and have no transmittance.

        Parameters
        ----------
        solid : bool
            If true, rays end at BLEND surfaces where alpha is above 0, see `new_packet_buffers`.
        """
        return new_packet_buffers(self.tracer.without_transmittance(), solid=solid)

    def tile_points(self, begin: int, end: int) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return origins and normals (m, 16, 3) float32 of all points of entries begin to end - 1."""
        return tile_points(self.surface, self.valid_points, begin, end, self.point_cache)

    def some_points(
        self, entry: NDArray[np.int64], point: NDArray[np.uint8]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Return origins and normals (m, 1, 3) float32 of one point of each entry.

        entry : (m,) int64; point : (m,) uint8, number of the point, 0 to 15
        """
        return some_points(self.surface, self.valid_points, entry, point, self.point_cache)

    def run(
        self,
        stage: Stage,
        n: int,
        tile: int,
        work: Callable[[int, int], Part],
        keep: Callable[[int, int, Part], object],
        *,
        rays_per_item: float,
    ) -> None:
        """Call `keep(begin, end, work(begin, end))` for each tile of n items; see `run_tiles`."""
        self.runner(
            n, tile, work, keep=keep, threads=self.threads,
            stage=stage, progress=self.progress, rays_per_item=rays_per_item,
        )  # fmt: skip

    def run_here(
        self,
        stage: Stage,
        n: int,
        tile: int,
        work: Callable[[int, int], object],
        *,
        rays_per_item: float = 0.0,
    ) -> None:
        """Call `work(begin, end)` for each tile in this process, without the runner; see `run_tiles`."""
        run_tiles(
            n, tile, work, threads=self.threads,
            stage=stage, progress=self.progress, rays_per_item=rays_per_item,
        )  # fmt: skip
