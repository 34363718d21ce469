"""Irradiance and openness at points of surfaces, pass by pass, with standard errors.

    E = pi mean(L of a white Lambertian point)    AO = share of cosine-weighted rays that meet nothing

A pass is a fixed number of samples of every point. Passes are independent, so their spread is the
error of their mean, however a pass spreads its own samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import run_tiles
from baker.core.progress import Progress, silent
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.reference.estimators import estimator_named
from baker.reference.occlusion import open_rays
from baker.reference.paths import trace_paths
from baker.reference.view import Reference
from baker.trace.packets import new_caster

SAMPLES_PER_PASS = 16
_TILE = 128


@dataclass
class PointEstimate:
    """Means over passes, which can be continued.

    Attributes
    ----------
    total, squares : (n, C) float64
        Sums of the passes' means and of their squares.
    halves : (2, n, C) float64
        The same sums apart for even and odd passes: two independent references.
    passes : int
    samples : int
        Samples of a point in each pass.
    rays : int
    """

    total: NDArray[np.float64]
    squares: NDArray[np.float64]
    halves: NDArray[np.float64]
    passes: int
    samples: int
    rays: int = 0

    @property
    def mean(self) -> NDArray[np.float64]:
        """Return the estimate (n, C)."""
        return self.total / max(self.passes, 1)

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """Return the standard error (n, C) of the estimate; inf after less than two passes."""
        if self.passes < 2:
            return np.full(self.total.shape, np.inf)
        variance = (self.squares / self.passes - self.mean**2) / (self.passes - 1)
        error: NDArray[np.float64] = np.sqrt(np.maximum(variance, 0.0))
        return error

    def half(self, which: int) -> NDArray[np.float64]:
        """Return the mean (n, C) of the even (0) or odd (1) passes."""
        count = (self.passes + 1 - which) // 2
        mean: NDArray[np.float64] = self.halves[which] / max(count, 1)
        return mean


def new_estimate(n: int, channels: int, samples: int = SAMPLES_PER_PASS) -> PointEstimate:
    """Return an estimate of n points before its first pass."""
    zero = np.zeros((n, channels))
    return PointEstimate(zero, zero.copy(), np.zeros((2, n, channels)), 0, samples)


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
        Only these points. Their passes must be counted by the caller: the estimate's own count goes up by one.
    """
    how = estimator_named(estimator)
    number, samples = estimate.passes, estimate.samples
    picked = np.arange(len(position)) if chosen is None else chosen
    net = sobol_reversed(samples, seed, 1 + number)
    setting = np.array(
        [
            how.hemisphere,
            how.aim,
            int(how.strata or stratify),
            how.power,
            -1 if max_bounces is None else max_bounces,
            seed,
            number,
        ],
        np.int64,
    )
    counted = np.zeros(-(-len(picked) // _TILE), np.int64)

    def work(begin: int, end: int) -> None:
        rows = picked[begin:end]
        out = np.zeros((end - begin, 3))
        places = (position[rows], normal[rows], face_normal[rows])
        cast = trace_paths(
            *places, begin, True, reference.surfaces, reference.lamps, reference.shading,
            new_caster(reference.rays.tracer), net, setting, out,
        )  # fmt: skip
        counted[begin // _TILE] = sum(cast)
        _add(estimate, rows, out * (math.pi / samples))

    run_tiles(len(picked), _TILE, work, threads=reference.threads, stage="path tracing", progress=progress)
    estimate.passes += 1
    estimate.rays += int(counted.sum())


def openness_pass(
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
    number, samples = estimate.passes, estimate.samples
    net = sobol_reversed(samples, seed, 1 + number)
    shared = shared_bits_mask(samples)
    reach = np.float32(min(distance, 1.0e30))
    least = reference.surfaces.least

    def work(begin: int, end: int) -> None:
        rows = np.arange(begin, end)
        out = np.zeros((end - begin, 1))
        open_rays(
            position[rows], normal[rows], face_normal[rows], begin, new_caster(reference.rays.tracer), net, shared,
            reach, least, seed, number, out,
        )  # fmt: skip
        _add(estimate, rows, out / samples)

    run_tiles(len(position), 4 * _TILE, work, threads=reference.threads, stage="openness", progress=progress)
    estimate.passes += 1
    estimate.rays += len(position) * samples


def _add(estimate: PointEstimate, rows: NDArray[np.int64], mean: NDArray[np.float64]) -> None:
    estimate.total[rows] += mean
    estimate.squares[rows] += mean**2
    estimate.halves[estimate.passes % 2, rows] += mean
