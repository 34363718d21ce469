"""Path-traces the chosen texels until they are known well enough, or time is up.

A texel in the dark that only rare paths reach shows no spread at first: all its samples are black. Taken at
its word it would be left alone, and found to be black. Each texel therefore counts as if one more of its
samples had brought the mean light of its room: what was not seen in n samples is known to that mean / n at
best. Errors are relative to a texel's own light, or a tenth of its room's median: a dim room is traced as
long as a bright one.
"""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.core.progress import Progress, report
from baker.core.stage import Stage
from baker.metrics.error_metrics import dark_floor
from baker.metrics.texel_area import TexelPlaces
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.irradiance import ambient_occlusion_pass, irradiance_pass
from baker.pathtracer.point_estimate import PointEstimate, new_estimate
from baker.pathtracer.scene import Reference

# Passes of all texels before some are called good enough; passes beyond which AO is not followed.
_FIRST, _MOST_OPENNESS = 8, 1024
# Share of the time in which all texels get the same.
_EVEN = 0.4
# Standard error of AO that is good enough, and the share of the time that AO may take; it seldom needs it.
OPENNESS_ERROR, _OPENNESS_TIME = 0.004, 0.25


@dataclass(frozen=True)
class Effort:
    """How long to trace.

    Attributes
    ----------
    spp : int or None
        Samples of each texel, whatever its error.
    target : float
        Relative standard error at which a texel is good enough.
    deadline : float or None
        Of `time.monotonic`.
    seed : int
    room : (n,) int32
        Room of each texel, -1 for none.
    """

    spp: int | None
    target: float
    deadline: float | None
    seed: int
    room: NDArray[np.int32]

    def passes(self, estimate: PointEstimate) -> int | None:
        """Return the passes asked for, two at least: there is no error of one."""
        return None if self.spp is None else max(-(-self.spp // estimate.samples), 2)


def standard_error(estimate: PointEstimate, room: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the standard error (n, C), inf before two passes; see the head of this file."""
    samples = np.maximum(estimate.count.sum(axis=0), 1)[:, None] * estimate.samples
    mean = estimate.mean
    light = np.broadcast_to(mean.mean(axis=0), mean.shape).copy()
    for number in np.unique(room[room >= 0]):
        light[room == number] = mean[room == number].mean(axis=0)
    return np.asarray(np.hypot(estimate.standard_error, light / samples), np.float64)


def room_floor(mean: NDArray[np.float64], room: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return for points (n,) with light (n, C) below what it is dark in their room."""
    floor = np.full(len(mean), dark_floor(mean))
    for number in np.unique(room[room >= 0]):
        floor[room == number] = dark_floor(mean[room == number])
    return floor


def _nearest_to_done(
    estimate: PointEstimate, error: NDArray[np.float64], chosen: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the half of the chosen texels that needs the fewest samples: others would not get there."""
    need = estimate.count.sum(axis=0)[chosen] * error[chosen] ** 2
    return np.sort(chosen[np.argsort(need, kind="stable")[: -(-len(chosen) // 2)]])


def relative_standard_error(estimate: PointEstimate, room: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the standard error (n,) of the colour mean, relative as errors are (colours taken as one)."""
    mean = estimate.mean
    error = standard_error(estimate, room).mean(axis=1)
    scale = np.maximum(mean.mean(axis=1), np.maximum(room_floor(mean, room), 1e-12))
    return np.asarray(error / scale, np.float64)


def first_rays(reference: Reference, geometry: Geometry, channels: list[str]) -> float:
    """Cast a few rays of each kind from a triangle, before any time limit runs; return the seconds it took.

    On a machine's first run this compiles the kernels. That may take as long as the limit: a good bake would
    be judged by hardly any path, and fail.
    """
    started = time.monotonic()
    middle = geometry.position[geometry.triangle[:1]].astype(np.float64).mean(axis=1)
    face = geometry.face_normal[:1].astype(np.float64)
    one = middle[:, None], face[:, None], face[:, None]
    first_hits(reference, middle, face)
    if "ao" in channels:
        ambient_occlusion_pass(reference, new_estimate(1, 1), *one, distance=1.0)
    if "irradiance" in channels:
        irradiance_pass(reference, new_estimate(1, 3), *one, chosen=np.arange(1))
    return time.monotonic() - started


def trace_openness(
    reference: Reference, places: TexelPlaces, distance: float, effort: Effort, progress: Progress
) -> PointEstimate:
    """Estimate AO."""
    estimate = new_estimate(len(places.position), 1)
    goal = effort.passes(estimate)
    started = time.monotonic()
    for number in range(goal or _MOST_OPENNESS):
        ambient_occlusion_pass(
            reference, estimate, places.position, places.normal, places.face_normal,
            distance=distance, seed=effort.seed,
        )  # fmt: skip
        report(progress, Stage.AMBIENT_OCCLUSION, (number + 1) / (goal or _MOST_OPENNESS))
        if goal is not None or number + 1 < _FIRST:
            continue
        late = effort.deadline is not None and time.monotonic() > started + _OPENNESS_TIME * (
            effort.deadline - started
        )
        if late or np.percentile(standard_error(estimate, effort.room), 95) < OPENNESS_ERROR:
            break
    return estimate


def trace_irradiance(
    reference: Reference, places: TexelPlaces, bounces: int | None, effort: Effort, progress: Progress
) -> PointEstimate:
    """Estimate irradiance; texels that are good enough are left alone."""
    estimate = new_estimate(len(places.position), 3)
    chosen = np.arange(len(places.position))
    goal = effort.passes(estimate)
    started = time.monotonic()
    while True:
        irradiance_pass(
            reference, estimate, places.position, places.normal, places.face_normal,
            max_bounces=bounces, seed=effort.seed, chosen=chosen,
        )  # fmt: skip
        if goal is not None:
            report(progress, Stage.PATH_TRACING, estimate.rounds / goal)
            if estimate.rounds >= goal:
                break
        elif estimate.rounds >= _FIRST:
            error = relative_standard_error(estimate, effort.room)
            chosen = np.flatnonzero(error > effort.target)
            share = 1.0 - len(chosen) / len(error)
            if effort.deadline is not None:
                late = (time.monotonic() - started) / max(effort.deadline - started, 1e-9)
                share = max(share, late)
                if late > _EVEN:
                    chosen = _nearest_to_done(estimate, error, chosen)
            report(progress, Stage.PATH_TRACING, min(share, 1.0), f"{len(error) - len(chosen)} texels done")
            if not len(chosen):
                break
        if effort.deadline is not None and estimate.rounds >= 2 and time.monotonic() > effort.deadline:
            break
    return estimate
