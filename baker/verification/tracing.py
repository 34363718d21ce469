"""Path tracing of the chosen points, until their standard errors reach a target or the time limit.

At a dark point that only rare paths connect to a light, the first samples are all black, so their variance is
0. With the standard error of these samples only, the point would get no further samples and a reference of 0.
Therefore the standard error of n samples includes the mean light of the room divided by n, as if one further
sample had that value. Errors are relative to the light of the point, or to a tenth of the median of its room:
a dim room is traced as long as a bright one.
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

# Passes over all points before any may be finished; largest number of passes of AO.
_FIRST, _MAX_AO_PASSES = 8, 1024
# Share of the time limit in which all unfinished points get passes; then only the half nearest to the target.
_ALL_POINTS_TIME = 0.4
# Target standard error of AO, and the largest share of the time limit that AO takes.
AO_ERROR, _AO_TIME = 0.004, 0.25


@dataclass(frozen=True)
class Effort:
    """When to stop tracing.

    Attributes
    ----------
    spp : int or None
        Samples of each point, regardless of its error.
    target : float
        Relative standard error at which a point is finished.
    deadline : float or None
        Time of `time.monotonic` at which tracing ends.
    seed : int
    room : (n,) int32
        Room of each point, -1 for none.
    """

    spp: int | None
    target: float
    deadline: float | None
    seed: int
    room: NDArray[np.int32]

    def passes(self, estimate: PointEstimate) -> int | None:
        """Return the number of passes for `spp`, at least two: one pass has no standard error."""
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
    """Return the `dark_floor` (n,) of each point's room, from the light (n, C) and rooms (n,) of points."""
    floor = np.full(len(mean), dark_floor(mean))
    for number in np.unique(room[room >= 0]):
        floor[room == number] = dark_floor(mean[room == number])
    return floor


def _nearest_to_done(
    estimate: PointEstimate, error: NDArray[np.float64], chosen: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Return the half of the chosen points (m,) that needs the fewest samples to reach the target."""
    need = estimate.count.sum(axis=0)[chosen] * error[chosen] ** 2
    return np.sort(chosen[np.argsort(need, kind="stable")[: -(-len(chosen) // 2)]])


def relative_standard_error(estimate: PointEstimate, room: NDArray[np.int32]) -> NDArray[np.float64]:
    """Return the standard error (n,), mean over colours, relative to the light or the floor of the room."""
    mean = estimate.mean
    error = standard_error(estimate, room).mean(axis=1)
    scale = np.maximum(mean.mean(axis=1), np.maximum(room_floor(mean, room), 1e-12))
    return np.asarray(error / scale, np.float64)


def first_rays(reference: Reference, geometry: Geometry, channels: list[str]) -> float:
    """Cast a few rays of each kind from a triangle, and return the seconds that this took.

    The first run on a machine compiles the kernels here, before the time limit starts. Compilation may take
    as long as the limit; few paths would be left, and a correct bake would fail.
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
    """Estimate ambient occlusion within `distance` metres at points (n, k)."""
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
    """Estimate irradiance at points (n, k); finished points get no further passes."""
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
