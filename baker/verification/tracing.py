"""Path-traces the chosen points until their standard errors reach a target or the time limit ends.

If only rare paths connect a dark point to a light, its first samples are all black and their variance is 0.
Such a point would get no further samples, and its reference would be 0. The standard error of n samples
therefore includes the mean light of the room divided by n, as if one further sample had that value.

Errors are relative to the light of the point. If this light is less than a floor, errors are relative to the
floor. The floor is `baker.metrics.error_metrics.dark_floor` of the points in the same room. Dim rooms
therefore reach the same relative error as bright rooms.
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
from baker.metrics.texel_area import SurfacePoints
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.irradiance import ambient_occlusion_pass, irradiance_pass
from baker.pathtracer.point_estimate import PointEstimate, new_estimate
from baker.pathtracer.scene import Reference

# Number of passes over all points before a point can be finished, and largest number of passes of AO.
_FIRST, _MAX_AO_PASSES = 8, 1024
# Share of the time limit during which all unfinished points are traced. After that, only the half of these
# points that needs the fewest samples is traced.
_ALL_POINTS_TIME = 0.4
# Target standard error of AO (absolute), and largest share of the time limit that AO may take.
AO_ERROR, _AO_TIME = 0.004, 0.25


@dataclass(frozen=True)
class Effort:
    """Conditions that end tracing, with the seed and the rooms of the points.

    Attributes
    ----------
    spp : int or None
        Fixed number of samples of each point; None to trace until `target` or `deadline`.
    target : float
        Relative standard error at which a point is finished.
    deadline : float or None
        Time at which tracing ends, on the clock of `time.monotonic`; None for no limit.
    seed : int
        Seed of the random numbers.
    room : (n,) int32
        Room of each point, -1 for none.
    """

    spp: int | None
    target: float
    deadline: float | None
    seed: int
    room: NDArray[np.int32]

    def passes(self, estimate: PointEstimate) -> int | None:
        """Return the number of passes for `spp` samples, at least 2, since one pass has no standard error."""
        return None if self.spp is None else max(-(-self.spp // estimate.samples), 2)


def standard_error(estimate: PointEstimate, room: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return (n, C) float64: the standard error as defined in the module docstring; inf before two passes."""
    samples = np.maximum(estimate.count.sum(axis=0), 1)[:, None] * estimate.samples
    mean = estimate.mean
    light = np.broadcast_to(mean.mean(axis=0), mean.shape).copy()
    for number in np.unique(room[room >= 0]):
        light[room == number] = mean[room == number].mean(axis=0)
    return np.asarray(np.hypot(estimate.standard_error, light / samples), np.float64)


def room_floor(mean: NDArray[np.float64], room: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return (n,) float64: for each point, the `dark_floor` of its room.

    mean : (n, C) float64, light of the points; room : (n,) int32, -1 uses the `dark_floor` of all points
    """
    floor = np.full(len(mean), dark_floor(mean))
    for number in np.unique(room[room >= 0]):
        floor[room == number] = dark_floor(mean[room == number])
    return floor


def _nearest_to_done(
    estimate: PointEstimate, error: NDArray[np.float64], chosen: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the half of the points `chosen` (m,) that needs the fewest samples to reach the target.

    error : (n,) float64, relative standard error of all points
    """
    need = estimate.count.sum(axis=0)[chosen] * error[chosen] ** 2
    return np.sort(chosen[np.argsort(need, kind="stable")[: -(-len(chosen) // 2)]])


def relative_standard_error(estimate: PointEstimate, room: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return (n,) float64: the mean standard error of the colours divided by the light of each point.

    If the light is below `room_floor`, the divisor is `room_floor`.
    """
    mean = estimate.mean
    error = standard_error(estimate, room).mean(axis=1)
    scale = np.maximum(mean.mean(axis=1), np.maximum(room_floor(mean, room), 1e-12))
    return np.asarray(error / scale, np.float64)


def first_rays(reference: Reference, geometry: Geometry, channels: list[str]) -> float:
    """Cast a few rays of each kind from one triangle; return the time that this took, seconds.

    On the first run, this compiles the kernels before the time limit starts. Otherwise compilation could use
    up the time limit, and a correct bake would fail because too few paths are traced.
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


def trace_ambient_occlusion(
    reference: Reference, points: SurfacePoints, distance: float, effort: Effort, progress: Progress
) -> PointEstimate:
    """Estimate the ambient occlusion within `distance`, metres, of n points with k surface points each."""
    estimate = new_estimate(len(points.position), 1)
    goal = effort.passes(estimate)
    started = time.monotonic()
    for number in range(goal or _MAX_AO_PASSES):
        ambient_occlusion_pass(
            reference, estimate, points.position, points.normal, points.face_normal,
            distance=distance, seed=effort.seed,
        )  # fmt: skip
        report(progress, Stage.AMBIENT_OCCLUSION, (number + 1) / (goal or _MAX_AO_PASSES))
        if goal is not None or number + 1 < _FIRST:
            continue
        late = effort.deadline is not None and time.monotonic() > started + _AO_TIME * (
            effort.deadline - started
        )
        if late or np.percentile(standard_error(estimate, effort.room), 95) < AO_ERROR:
            break
    return estimate


def trace_irradiance(
    reference: Reference, points: SurfacePoints, bounces: int | None, effort: Effort, progress: Progress
) -> PointEstimate:
    """Estimate the irradiance of n points with k surface points each; finished points get no more passes."""
    estimate = new_estimate(len(points.position), 3)
    chosen = np.arange(len(points.position))
    goal = effort.passes(estimate)
    started = time.monotonic()
    while True:
        irradiance_pass(
            reference, estimate, points.position, points.normal, points.face_normal,
            options=PassOptions(max_bounces=bounces, seed=effort.seed), chosen=chosen,
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
                if late > _ALL_POINTS_TIME:
                    chosen = _nearest_to_done(estimate, error, chosen)
            report(progress, Stage.PATH_TRACING, min(share, 1.0), f"{len(error) - len(chosen)} texels done")
            if not len(chosen):
                break
        if effort.deadline is not None and estimate.rounds >= 2 and time.monotonic() > effort.deadline:
            break
    return estimate
