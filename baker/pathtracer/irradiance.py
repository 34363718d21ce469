"""Estimates irradiance and ambient occlusion at surface points, in passes, with standard errors.

    E  = pi mean(L)                        AO = share of cosine-weighted rays without a hit

Each sample L estimates the radiance of a white Lambertian surface at the point. A pass is a fixed number of
samples at every point. The samples of one pass may be stratified, but different passes are independent. So
the variance between passes gives the standard error of their mean.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import run_tiles
from baker.core.progress import Progress, silent
from baker.core.stage import Stage
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.pathtracer.estimators import DEFAULT_OPTIONS, PassOptions, estimator_named
from baker.pathtracer.occlusion import alike_within, are_dense, near_together, open_rays
from baker.pathtracer.path_blocks import new_path_memory
from baker.pathtracer.path_settings import path_settings
from baker.pathtracer.paths import trace_paths
from baker.pathtracer.point_estimate import PointEstimate, add_pass
from baker.pathtracer.rng import seed_salt
from baker.pathtracer.scene import Reference
from baker.trace.packets import arguments_of

# Number of points of a tile of `irradiance_pass`.
_TILE = 128


def irradiance_pass(
    reference: Reference,
    estimate: PointEstimate,
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    face_normal: NDArray[np.float64],
    *,
    options: PassOptions = DEFAULT_OPTIONS,
    chosen: NDArray[np.int64] | None = None,
    progress: Progress = silent,
) -> None:
    """Add one pass of path tracing to an estimate of the irradiance, lx, of n points.

    Parameters
    ----------
    reference : Reference
        The scene.
    estimate : PointEstimate
        Estimate for n points, R, G and B; changed in place. The number of the pass is `estimate.rounds`.
    position : (n, k, 3) float64
        For each point, k positions, for example points in the area of a texel; metres, relative to
        `reference.geometry.origin`. With S samples per pass, sample s of pass p starts at position (p S + s)
        modulo k.
    normal : (n, k, 3) float64
        Shading normals at the positions, unit, world.
    face_normal : (n, k, 3) float64
        Geometric normals at the positions, unit, world, on the side at which light arrives.
    options : PassOptions
        Estimator, stratification, limit of reflections and seed.
    chosen : (m,) int64, optional
        Indices of the points to sample; by default all points.
    progress : Progress
        Called with stage, fraction and detail.
    """
    estimator = estimator_named(options.estimator)
    number, samples = estimate.rounds, estimate.samples
    picked = np.arange(len(position)) if chosen is None else chosen
    sobol_points = sobol_reversed(samples, options.seed, 1 + number)
    settings = path_settings(estimator, estimator.strata or options.stratify, options, number)
    counted = np.zeros((-(-len(picked) // _TILE), 2), np.int64)

    def work(begin: int, end: int) -> None:
        rows = picked[begin:end]
        out = np.zeros((end - begin, 3))
        points = (position[rows], normal[rows], face_normal[rows])
        if estimator.both:
            # Import here, so that other estimators do not load these kernels.
            from baker.pathtracer.bidirectional_pass import surface_tile

            counted[begin // _TILE] = surface_tile(reference, points, begin, sobol_points, settings, out)
        else:
            cast = trace_paths(
                *points, begin, True, reference.surfaces, reference.lights, reference.shading,
                new_path_memory(reference.rays), sobol_points, settings, out,
            )  # fmt: skip
            counted[begin // _TILE] = cast
        add_pass(estimate, rows, out * (math.pi / samples))

    run_tiles(
        len(picked), _TILE, work, threads=reference.threads, stage=Stage.PATH_TRACING, progress=progress
    )
    estimate.rounds += 1
    estimate.rays += int(counted.sum())
    estimate.segments += int(counted[:, 0].sum())


def ambient_occlusion_pass(
    reference: Reference,
    estimate: PointEstimate,
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    face_normal: NDArray[np.float64],
    *,
    distance: float,
    seed: int = 0,
    progress: Progress = silent,
) -> None:
    """Add one pass of rays to an estimate of the ambient occlusion, 0 to 1, of n points.

    Parameters
    ----------
    reference : Reference
        The scene.
    estimate : PointEstimate
        Estimate for n points, 1 channel (1: no ray has a hit); changed in place. The number of the pass is
        `estimate.rounds`.
    position : (n, k, 3) float64
        Positions of each point, see `irradiance_pass`.
    normal : (n, k, 3) float64
        Shading normals, see `irradiance_pass`.
    face_normal : (n, k, 3) float64
        Geometric normals, see `irradiance_pass`.
    distance : float
        Length of the rays, metres; may be inf.
    seed : int
        Seed of all random numbers.
    progress : Progress
        Called with stage, fraction and detail.
    """
    number, samples = estimate.rounds, estimate.samples
    sobol_points = sobol_reversed(samples, seed, 1 + number)
    shared = shared_bits_mask(samples)
    max_distance = np.float32(min(distance, 1.0e30))
    min_offset_scale = np.float32(reference.surfaces.min_offset_scale)
    alike = alike_within(max_distance, min_offset_scale)
    sizes = (min_offset_scale, np.float32(reference.surfaces.default_size))
    dense = are_dense(position[:, 0], float(alike))
    salt = seed_salt(seed)
    arguments = np.stack([arguments_of(coherent=coherent) for coherent in (False, True)])

    def work(begin: int, end: int) -> None:
        name = np.arange(begin, end)
        rows: NDArray[np.int64] | slice = slice(begin, end)
        if dense:
            name = rows = begin + near_together(position[begin:end, 0])
        found = np.zeros((end - begin, 1))
        open_rays(
            position[rows], normal[rows], face_normal[rows], name, new_path_memory(reference.occluders),
            arguments, sobol_points, shared, max_distance, alike, sizes, number, salt, found,
        )  # fmt: skip
        add_pass(estimate, rows, found / samples)

    # If points are dense, use tiles of up to 4096 points, so that more neighbours of a point are in its tile.
    # A tile of more than 512 points contains at most 1/32 of all points, so that threads rarely wait for the
    # last tile.
    tile = min(max(4 * _TILE, len(position) // 32), 32 * _TILE) if dense else 4 * _TILE
    run_tiles(
        len(position), tile, work, threads=reference.threads, stage=Stage.AMBIENT_OCCLUSION, progress=progress
    )
    estimate.rounds += 1
    estimate.rays += len(position) * samples
