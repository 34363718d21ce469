"""Irradiance and openness at points of surfaces, pass by pass, with standard errors.

    E = pi mean(L of a white Lambertian point)    AO = share of cosine-weighted rays that meet nothing

A pass is a fixed number of samples of every point. Passes are independent, so their spread is the
error of their mean, however a pass spreads its own samples.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import run_tiles
from baker.core.progress import Progress, silent
from baker.core.stage import Stage
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.pathtracer.estimators import Estimator, estimator_named
from baker.pathtracer.occlusion import alike_within, are_dense, near_together, open_rays
from baker.pathtracer.path_blocks import new_path_memory
from baker.pathtracer.paths import trace_paths
from baker.pathtracer.point_estimate import PointEstimate, add_pass
from baker.pathtracer.rng import seed_salt
from baker.pathtracer.scene import Reference
from baker.trace.packets import arguments_of

_TILE = 128


def irradiance_pass(
    reference: Reference,
    estimate: PointEstimate,
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    face_normal: NDArray[np.float64],
    *,
    estimator: str = "mis",
    stratify: bool = True,
    max_bounces: int | None = None,
    seed: int = 0,
    chosen: NDArray[np.int64] | None = None,
    progress: Progress = silent,
) -> None:
    """Add one pass of path-traced irradiance, lx, to an estimate.

    Parameters
    ----------
    estimate : PointEstimate
        Of (n, 3); changed in place. The number of its next pass is the pass traced.
    position, normal, face_normal : (n, k, 3) float64, metres and unit, world
        k places of each point, used in turn by its samples: a texel's own area, for instance. `normal` is the
        shading normal, `face_normal` the side that the light arrives on.
    stratify : bool
        Spread a pass's first directions evenly, whatever the estimator.
    max_bounces : int, optional
        Reflections before light arrives; None is unlimited.
    chosen : (m,) int64, optional
        Only these points, all by default.
    """
    how = estimator_named(estimator)
    number, samples = estimate.rounds, estimate.samples
    picked = np.arange(len(position)) if chosen is None else chosen
    sobol_points = sobol_reversed(samples, seed, 1 + number)
    setting = path_settings(how, how.strata or stratify, max_bounces, seed, number)
    counted = np.zeros((-(-len(picked) // _TILE), 2), np.int64)

    def work(begin: int, end: int) -> None:
        rows = picked[begin:end]
        out = np.zeros((end - begin, 3))
        places = (position[rows], normal[rows], face_normal[rows])
        if how.both:
            # Here: other estimators need not load its kernels.
            from baker.pathtracer.bidirectional_pass import surface_tile

            counted[begin // _TILE] = surface_tile(reference, places, begin, sobol_points, setting, out)
        else:
            cast = trace_paths(
                *places, begin, True, reference.surfaces, reference.lights, reference.shading,
                new_path_memory(reference.rays), sobol_points, setting, out,
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
    """Add one pass of ambient occlusion (1 = open) to an estimate of (n, 1); see `irradiance_pass`.

    Parameters
    ----------
    distance : float
        Metres, may be inf.
    """
    number, samples = estimate.rounds, estimate.samples
    sobol_points = sobol_reversed(samples, seed, 1 + number)
    shared = shared_bits_mask(samples)
    max_distance = np.float32(min(distance, 1.0e30))
    min_offset_scale = np.float32(reference.surfaces.min_offset_scale)
    alike = alike_within(max_distance, min_offset_scale)
    sizes = (min_offset_scale, np.float32(reference.surfaces.most))
    dense = are_dense(position[:, 0], float(alike))
    setting = np.array([number, seed_salt(seed)], np.int64)
    arguments = np.stack([arguments_of(coherent=coherent) for coherent in (False, True)])

    def work(begin: int, end: int) -> None:
        name = np.arange(begin, end)
        rows: NDArray[np.int64] | slice = slice(begin, end)
        if dense:
            name = rows = begin + near_together(position[begin:end, 0])
        found = np.zeros((end - begin, 1))
        open_rays(
            position[rows], normal[rows], face_normal[rows], name, new_path_memory(reference.rays),
            arguments, sobol_points, shared, max_distance, alike, sizes, setting, found,
        )  # fmt: skip
        add_pass(estimate, rows, found / samples)

    # Large tiles hold more neighbours, but few of them keep threads waiting at the end.
    tile = min(max(4 * _TILE, len(position) // 32), 32 * _TILE) if dense else 4 * _TILE
    run_tiles(
        len(position), tile, work, threads=reference.threads, stage=Stage.AMBIENT_OCCLUSION, progress=progress
    )
    estimate.rounds += 1
    estimate.rays += len(position) * samples


def path_settings(
    how: Estimator, strata: int | bool, max_bounces: int | None, seed: int, number: int
) -> NDArray[np.int64]:
    """Return what `trace_paths` calls `how`."""
    bounces = -1 if max_bounces is None else max_bounces
    values = [how.hemisphere, how.aim, int(strata), how.power, bounces, seed, number, seed_salt(seed)]
    return np.array(values, np.int64)
