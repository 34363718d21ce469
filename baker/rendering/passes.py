"""The passes whose mean is a picture, and the layers that need first hits only.

Pixels are computed in blocks, so that temporary memory does not grow with the picture.
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

# Samples of a pixel in one pass.
_PASS, _OPENNESS_PASS = 4, 16
# Samples per second of a slow machine, for the size of passes under a time limit.
_RATE, _OPENNESS_RATE = 2.0e4, 2.0e5
_BLOCK = 1 << 14
_AOV_SAMPLES = 4


@dataclass
class Run:
    """One picture being rendered.

    Attributes
    ----------
    reference : Reference
    camera : Camera
    settings : RenderSettings
    start : float
        When it began, by `time.monotonic`.
    progress : Progress
    passed : float
        When the last pass ended, 0 before the first.
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
        """Return the samples of a pass: `most`, or less so that there are two passes, or time is short."""
        goal, limit = self.settings.goal, self.settings.time_limit
        if goal is not None:
            most = min(most, goal // 2)
        if limit is not None:
            most = min(most, int(limit * rate / self.pixels))
        return max(most, 1)

    def enough(self, estimate: PointEstimate) -> bool:
        """Return whether rendering may end: all samples are made, or another pass would take too long."""
        now = time.monotonic()
        last, self.passed = now - self.passed, now
        self.show(estimate, 0.0)
        # At least two passes: the variance needs two.
        if estimate.rounds < 2:
            return False
        goal, limit = self.settings.goal, self.settings.time_limit
        if goal is not None and estimate.rounds * estimate.samples >= goal:
            return True
        return limit is not None and now - self.start + last > limit

    def show(self, estimate: PointEstimate, part: float) -> None:
        """Report the progress of the picture; `part` of the next pass is done."""
        goal, limit = self.settings.goal, self.settings.time_limit
        done = estimate.rounds * estimate.samples
        by_samples = 0.0 if goal is None else (done + part * estimate.samples) / goal
        by_time = 0.0 if limit is None else (time.monotonic() - self.start) / limit
        report(self.progress, Stage.RENDERING, min(max(by_samples, by_time), 1.0), f"{done} samples a pixel")

    def within(self, estimate: PointEstimate) -> Progress:
        """Return a progress callback for one pass: its fraction is scaled to that of the picture."""

        def scaled(_: str, fraction: float, __: str = "", /) -> None:
            self.show(estimate, fraction)

        return scaled

    def hits(self, begin: int, end: int, number: int) -> FirstHits:
        """Return the first hits of one ray through each pixel from `begin` to `end` in pass `number`."""
        settings, camera = self.settings, self.camera
        pixel = np.arange(begin, end)
        direction = camera_rays(camera, settings.width, settings.height, pixel, 1, settings.seed, number)
        return first_hits(self.reference, self.reference.local(camera.position), direction.reshape(-1, 3))

    def blocks(self, work: Callable[[int, int], None], progress: Progress) -> None:
        """Call `work(begin, end)` for all pixels, on all threads."""
        run_tiles(
            self.pixels,
            _BLOCK,
            work,
            threads=self.reference.threads,
            stage=Stage.RENDERING,
            progress=progress,
        )


def traced(run: Run) -> PointEstimate:
    """Return the radiance (H * W, 3), cd/m2, that path tracing finds."""
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


def ambient_occlusion(run: Run, distance: float) -> PointEstimate:
    """Return ambient occlusion (H * W, 1), 0 to 1; 1 where a camera ray hits nothing."""
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
            # Points are numbered from 0 in each block: with one seed all blocks would draw the same numbers.
            seed = (run.settings.seed + 7919 * (begin // _BLOCK)) & 0x7FFFFFFF
            ambient_occlusion_pass(run.reference, one, *where, distance=distance, seed=seed)
            share = np.ones((end - begin, 1))
            share[met] = one.mean
            add_pass(estimate, np.arange(begin, end), share)
            cast += one.rays
        estimate.rounds += 1
        estimate.rays += cast
    return estimate


def lit_by(run: Run, baked: BakedLight, sky: tuple[float, float, float]) -> PointEstimate:
    """Return the radiance an engine shows (H * W, 3), cd/m2: albedo x map / pi + emission, or the sky."""
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


def first_layers(run: Run) -> dict[str, NDArray[np.float32]]:
    """Return albedo and normal of first hits, means over a few samples, and the depth of the first sample."""
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
