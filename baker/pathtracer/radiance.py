"""Estimates the radiance along camera rays, in passes; `pathtracer.irradiance` defines a pass."""

from __future__ import annotations

import numpy as np

from baker.core.parallel import run_tiles
from baker.core.progress import Progress, silent
from baker.core.scene import Camera
from baker.core.stage import Stage
from baker.kernels.sampling import sobol_reversed
from baker.pathtracer.camera import camera_rays
from baker.pathtracer.estimators import DEFAULT_OPTIONS, PassOptions, estimator_named
from baker.pathtracer.path_blocks import new_path_memory
from baker.pathtracer.path_settings import path_settings
from baker.pathtracer.paths import trace_paths
from baker.pathtracer.point_estimate import PointEstimate, add_pass
from baker.pathtracer.scene import Reference

# Number of pixels of a tile.
_TILE = 512


def radiance_pass(
    reference: Reference,
    estimate: PointEstimate,
    camera: Camera,
    width: int,
    height: int,
    *,
    options: PassOptions = DEFAULT_OPTIONS,
    progress: Progress = silent,
) -> None:
    """Add one pass of path tracing to an estimate of the radiance of all pixels, cd/m2.

    Parameters
    ----------
    reference : Reference
        The scene.
    estimate : PointEstimate
        Estimate for height * width pixels, R, G and B; row 0 of the picture is on top. Changed in place.
    camera : Camera
        The camera, in world space.
    width : int
        Width of the picture, pixels.
    height : int
        Height of the picture, pixels.
    options : PassOptions
        Estimator, limit of reflections, and seed. The reflection at the first surface that the camera sees is
        not counted.
    progress : Progress
        Called with stage, fraction and detail.

    Raises
    ------
    SettingsError
        If no estimator has the name `options.estimator`.
    Cancelled
        If `progress` returned a truthy value.
    """
    estimator = estimator_named(options.estimator)
    samples, number = estimate.samples, estimate.rounds
    sobol_points = sobol_reversed(samples, options.seed, 1 + number)
    settings = path_settings(estimator, estimator.strata, options, number)
    if estimator.both:
        # Import here, so that other estimators do not load these kernels.
        from baker.pathtracer.bidirectional_pass import picture_pass

        picture_pass(reference, estimate, camera, (width, height), sobol_points, settings, progress)
        return
    counted = np.zeros((-(-width * height // _TILE), 2), np.int64)
    eye = reference.local(camera.position)[None, None]

    def work(begin: int, end: int) -> None:
        pixel = np.arange(begin, end)
        direction = camera_rays(camera, width, height, pixel, samples, options.seed, number)
        out = np.zeros((end - begin, 3))
        cast = trace_paths(
            eye, direction, direction, begin, False, reference.surfaces, reference.lights, reference.shading,
            new_path_memory(reference.rays), sobol_points, settings, out,
        )  # fmt: skip
        counted[begin // _TILE] = cast
        add_pass(estimate, slice(begin, end), out / samples)

    run_tiles(
        width * height, _TILE, work, threads=reference.threads, stage=Stage.PATH_TRACING, progress=progress
    )
    estimate.rounds += 1
    estimate.rays += int(counted.sum())
    estimate.segments += int(counted[:, 0].sum())
