"""Runs passes of the bidirectional estimator: tiles of surface points, and pictures with their splats.

A picture is divided into blocks, and a block into tiles. A splat (see `bidirectional`) may be in any pixel,
so each tile returns a list of its splats. After each block, the lists are added to the picture, so that
memory is limited. The lists are added in the order of tiles, so that sums do not depend on the number of
threads.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import run_tiles
from baker.core.progress import Progress
from baker.core.scene import Camera
from baker.core.stage import Stage
from baker.pathtracer.bidirectional import trace_both_ways
from baker.pathtracer.bidirectional_weights import MAX_LIGHT_VERTICES
from baker.pathtracer.camera import CAMERA_COLUMNS, camera_columns, camera_rays
from baker.pathtracer.estimators import PathSettings
from baker.pathtracer.point_estimate import PointEstimate, add_pass
from baker.pathtracer.scene import Reference
from baker.trace.packets import new_packet_buffers

# Number of pixels of a tile and of a block.
_TILE = 512
_BLOCK = 64 * _TILE


def surface_tile(
    reference: Reference,
    points: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    begin: int,
    sobol_points: NDArray[np.uint32],
    settings: PathSettings,
    out: NDArray[np.float64],
) -> tuple[int, int]:
    """Add E / pi of each sample of m points to `out` (m, 3).

    points : position, normal and face normal, each (m, k, 3), see `irradiance_pass`
    begin : number of the first point, on which its random numbers depend
    Returns the numbers of closest-hit rays and shadow rays.
    """
    rays, shadows, _ = trace_both_ways(
        *points, begin, np.zeros(CAMERA_COLUMNS), 0.0, reference.surfaces, reference.lights,
        reference.shading, reference.sphere, new_packet_buffers(reference.rays.tracer), sobol_points,
        settings, out,
        np.zeros(0, np.int64), np.zeros((0, 3)),
    )  # fmt: skip
    return int(rays), int(shadows)


def picture_pass(
    reference: Reference,
    estimate: PointEstimate,
    camera: Camera,
    size: tuple[int, int],
    sobol_points: NDArray[np.uint32],
    settings: PathSettings,
    progress: Progress,
) -> None:
    """Add one pass of the radiance of all pixels to an estimate; see `radiance_pass`.

    size : width and height of the picture, pixels; sobol_points, settings : see `trace_paths`
    """
    width, height = size
    n, samples, number = width * height, estimate.samples, estimate.rounds
    eye = reference.local(camera.position)
    lens = camera_columns(camera, eye, width, height)
    seen, splatted = np.zeros((n, 3)), np.zeros((n, 3))
    for block in range(0, n, _BLOCK):
        span = min(_BLOCK, n - block)
        found: list[Any] = [None] * -(-span // _TILE)

        def work(begin: int, end: int, block: int = block, found: list[Any] = found) -> None:
            pixel = np.arange(block + begin, block + end)
            direction = camera_rays(camera, width, height, pixel, samples, settings.seed, number)
            origin = np.broadcast_to(eye, direction.shape).copy()
            most = len(pixel) * samples * (MAX_LIGHT_VERTICES - 1)
            splat_pixel, splat = np.zeros(most, np.int64), np.zeros((most, 3))
            span = slice(block + begin, block + end)
            cast, shadows, splats = trace_both_ways(
                origin, direction, direction, block + begin, lens, float(n), reference.surfaces,
                reference.lights, reference.shading, reference.sphere,
                new_packet_buffers(reference.rays.tracer), sobol_points, settings,
                seen[span], splat_pixel, splat,
            )  # fmt: skip
            found[begin // _TILE] = (splat_pixel[:splats].copy(), splat[:splats].copy(), cast, shadows)

        def report(
            stage: str, fraction: float, detail: str = "", block: int = block, span: int = span
        ) -> Any:
            return progress(stage, (block + fraction * span) / n, detail)

        run_tiles(span, _TILE, work, threads=reference.threads, stage=Stage.PATH_TRACING, progress=report)
        for splat_pixel, splat, cast, shadows in found:
            for c in range(3):
                splatted[:, c] += np.bincount(splat_pixel, splat[:, c], n)
            estimate.segments += int(cast)
            estimate.rays += int(cast + shadows)
    add_pass(estimate, np.arange(n), (seen + splatted) / samples)
    estimate.rounds += 1
