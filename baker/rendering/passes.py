"""Computes the passes of a picture, and the layers from first hits.

A pass estimates the value of every pixel, and a picture is the mean of its passes. Pixels are computed in
blocks, so that temporary memory does not grow with the picture.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import run_tiles
from baker.core.progress import Progress, report, silent
from baker.core.scene import Camera
from baker.core.stage import Stage
from baker.pathtracer.camera import camera_rays
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.first_hit import FirstHits, first_hits
from baker.pathtracer.irradiance import ambient_occlusion_pass
from baker.pathtracer.point_estimate import PointEstimate, add_pass, new_estimate
from baker.pathtracer.radiance import radiance_pass
from baker.pathtracer.scene import Reference
from baker.rendering.baked import BakedLight
from baker.rendering.settings import RenderSettings

# Largest number of samples of a pixel in one pass: for radiance, and for ambient occlusion.
_PASS, _OPENNESS_PASS = 4, 16
# Samples per second on a slow machine, for radiance and for ambient occlusion. If there is a time limit,
# these rates limit the number of samples in a pass.
_RATE, _OPENNESS_RATE = 2.0e4, 2.0e5
# Number of pixels of a block.
_BLOCK = 1 << 14
# Number of camera rays through a pixel for the layers of `first_layers`.
_AOV_SAMPLES = 4


@dataclass
class RenderRun:
    """A picture while it is rendered.

    Attributes
    ----------
    reference : Reference
        The scene.
    camera : Camera
        The camera, in world space.
    settings : RenderSettings
        Settings of the picture.
    start : float
        Time at which rendering started, by `time.monotonic`, seconds.
    progress : Progress
        Called with stage, fraction and detail.
    passed : float
        Time at which the last pass ended, by `time.monotonic`, seconds; 0 before the first pass.
    """

    reference: Reference
    camera: Camera
    settings: RenderSettings
    start: float
    progress: Progress = silent
    passed: float = 0.0

    @property
    def pixels(self) -> int:
        """Return the number of pixels."""
        return self.settings.width * self.settings.height

    def samples(self, most: int, rate: float) -> int:
        """Return the number of samples of a pixel in a pass, from 1 to `most`.

        It is at most half the requested samples, so that there are at least two passes. If there is a time
        limit, a pass at `rate` samples per second takes at most that time.
        """
        goal, limit = self.settings.goal, self.settings.time_limit
        if goal is not None:
            most = min(most, goal // 2)
        if limit is not None:
            most = min(most, int(limit * rate / self.pixels))
        return max(most, 1)

    def enough(self, estimate: PointEstimate) -> bool:
        """Return whether to end: all samples are done, or one more pass would exceed the time limit.

        At least two passes are made.
        """
        now = time.monotonic()
        last, self.passed = now - self.passed, now
        self.show(estimate, 0.0)
        # The variance needs at least two passes.
        if estimate.rounds < 2:
            return False
        goal, limit = self.settings.goal, self.settings.time_limit
        if goal is not None and estimate.rounds * estimate.samples >= goal:
            return True
        return limit is not None and now - self.start + last > limit

    def show(self, estimate: PointEstimate, part: float) -> None:
        """Report the progress of the picture; `part` is the fraction of the current pass that is done."""
        goal, limit = self.settings.goal, self.settings.time_limit
        done = estimate.rounds * estimate.samples
        by_samples = 0.0 if goal is None else (done + part * estimate.samples) / goal
        by_time = 0.0 if limit is None else (time.monotonic() - self.start) / limit
        report(self.progress, Stage.RENDERING, min(max(by_samples, by_time), 1.0), f"{done} samples a pixel")

    def within(self, estimate: PointEstimate) -> Progress:
        """Return a callback that takes the progress of one pass and reports the progress of the picture."""

        def scaled(_: str, fraction: float, __: str = "", /) -> None:
            self.show(estimate, fraction)

        return scaled

    def hits(self, begin: int, end: int, number: int) -> FirstHits:
        """Return first hits of one ray through each pixel from `begin` to `end` - 1, in pass `number`."""
        settings, camera = self.settings, self.camera
        pixel = np.arange(begin, end)
        direction = camera_rays(camera, settings.width, settings.height, pixel, 1, settings.seed, number)
        return first_hits(self.reference, self.reference.local(camera.position), direction.reshape(-1, 3))

    def blocks(self, work: Callable[[int, int], None], progress: Progress) -> None:
        """Call `work(begin, end)` for each block of pixels, on all threads."""
        run_tiles(
            self.pixels,
            _BLOCK,
            work,
            threads=self.reference.threads,
            stage=Stage.RENDERING,
            progress=progress,
        )


def traced(run: RenderRun) -> PointEstimate:
    """Return the path-traced radiance (H * W, 3), cd/m2."""
    settings = run.settings
    estimate = new_estimate(run.pixels, 3, run.samples(_PASS, _RATE))
    bounces = None if settings.max_depth is None else settings.max_depth - 1
    options = PassOptions(settings.estimator, max_bounces=bounces, seed=settings.seed)
    while not run.enough(estimate):
        radiance_pass(
            run.reference, estimate, run.camera, settings.width, settings.height,
            options=options, progress=run.within(estimate),
        )  # fmt: skip
    return estimate


def ambient_occlusion(run: RenderRun, distance: float) -> PointEstimate:
    """Return ambient occlusion (H * W, 1), 0 to 1. Camera rays without a hit contribute 1."""
    estimate = new_estimate(run.pixels, 1, run.samples(_OPENNESS_PASS, _OPENNESS_RATE))
    while not run.enough(estimate):
        cast = run.pixels
        for begin in range(0, run.pixels, _BLOCK):
            run.show(estimate, begin / run.pixels)
            end = min(begin + _BLOCK, run.pixels)
            hits = run.hits(begin, end, estimate.rounds)
            met = np.flatnonzero(hits.triangle >= 0)
            one = new_estimate(len(met), 1, estimate.samples)
            one.rounds = estimate.rounds
            where = (a[met][:, None] for a in (hits.position, hits.normal, hits.face_normal))
            # Points are numbered from 0 in each block, so each block needs a different seed to get different
            # random numbers.
            seed = (run.settings.seed + 7919 * (begin // _BLOCK)) & 0x7FFFFFFF
            ambient_occlusion_pass(run.reference, one, *where, distance=distance, seed=seed)
            share = np.ones((end - begin, 1))
            share[met] = one.mean
            add_pass(estimate, np.arange(begin, end), share)
            cast += one.rays
        estimate.rounds += 1
        estimate.rays += cast
    return estimate


def lit_by(run: RenderRun, baked: BakedLight, sky: tuple[float, float, float]) -> PointEstimate:
    """Return the radiance (H * W, 3), cd/m2, that an engine shows with the bake.

    At first hits on sides that reflect light, it is albedo x irradiance / pi + emission. For rays without a
    hit, it is `sky`. Both are multiplied by `FirstHits.kept`, for the `BLEND` surfaces that the ray passed.
    At all other hits, it is 0.
    """
    estimate = new_estimate(run.pixels, 3, 1)

    def work(begin: int, end: int) -> None:
        hits = run.hits(begin, end, estimate.rounds)
        light = baked.radiance(run.reference, hits)
        light[hits.triangle < 0] = sky
        add_pass(estimate, np.arange(begin, end), light * hits.kept)

    while not run.enough(estimate):
        run.blocks(work, run.within(estimate))
        estimate.rounds += 1
        estimate.rays += run.pixels
    return estimate


def first_layers(run: RenderRun) -> dict[str, NDArray[np.float32]]:
    """Return the layers of first hits: "albedo", "normal" (H, W, 3) and "depth" (H, W, 1), metres.

    Albedo and normal are means over `_AOV_SAMPLES` camera rays. Depth is the distance of the hit of the first
    camera ray, 0 without a hit.
    """
    n = run.pixels
    total: dict[str, NDArray[Any]] = {
        "albedo": np.zeros((n, 3)), "normal": np.zeros((n, 3)), "depth": np.zeros((n, 1))
    }  # fmt: skip

    def work(begin: int, end: int) -> None:
        for number in range(_AOV_SAMPLES):
            hits = run.hits(begin, end, number)
            total["albedo"][begin:end] += hits.albedo / _AOV_SAMPLES
            total["normal"][begin:end] += hits.normal / _AOV_SAMPLES
            if number == 0:
                total["depth"][begin:end, 0] = np.where(np.isfinite(hits.depth), hits.depth, 0.0)

    run.blocks(work, run.progress)
    shape = (run.settings.height, run.settings.width, -1)
    return {name: value.astype(np.float32).reshape(shape) for name, value in total.items()}
