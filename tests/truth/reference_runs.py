"""Runs the reference path tracer on scenes with closed forms, and compares its results and standard errors.

Each point is traced as several copies with independent random numbers. The standard deviation over the copies
must match the standard errors that the reference reports.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from baker.core.scene import Scene
from baker.pathtracer.estimators import PassOptions
from baker.pathtracer.irradiance import ambient_occlusion_pass, irradiance_pass
from baker.pathtracer.point_estimate import PointEstimate, new_estimate
from baker.pathtracer.scene import Reference, build_reference

UP = (0.0, 0.0, 1.0)
WITHIN = 0.002
COPIES = 256
# Seed of the reference path tracer. About 190 points are tested, and by chance one in 370 points deviates
# from its truth by more than three standard errors. With seed 0, one point deviated by 3.2 standard errors.
# The mean error of this point over 200 other seeds is 0.003 % +- 0.003 %.
SEED = 1


def copies_of(point: Any, normal: Any = UP, copies: int = COPIES) -> tuple[np.ndarray, np.ndarray]:
    """Return position and normal, each (n * copies, 1, 3), of n points (n, 3) with normals (3,) or (n, 3)."""
    point = np.atleast_2d(np.asarray(point, float))
    normal = np.broadcast_to(np.asarray(normal, float), point.shape)
    return np.repeat(point, copies, axis=0)[:, None], np.repeat(normal, copies, axis=0)[:, None]


def spread_over(triangle: Any, samples: int, seed: int = 0, copies: int = COPIES) -> tuple[Any, Any]:
    """Return position and normal, each (copies, samples, 3), of random points, stratified by area.

    triangle : (t, 3, 3), triangles of the surface
    """
    rng = np.random.default_rng(seed)
    corner = np.asarray(triangle, float)
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = np.linalg.norm(cross, axis=1)
    share = (np.arange(samples) + rng.random((copies, samples))) / samples
    chosen = np.minimum(np.searchsorted(np.cumsum(area) / area.sum(), share), len(corner) - 1)
    u, v = np.sqrt(rng.random((copies, samples))), rng.random((copies, samples))
    weight = np.stack([1 - u, u * (1 - v), u * v], axis=-1)
    return (weight[..., None] * corner[chosen]).sum(axis=2), (cross / area[:, None])[chosen]


def traced(
    scene: Scene,
    where: Any,
    *,
    passes: int = 8,
    samples: int = 64,
    sky: Any = (0, 0, 0),
    threads: int = 2,
    **how: Any,
) -> PointEstimate:
    """Return path-traced irradiance at `where`.

    `where` is (position, normal), or a function that takes a pass number and returns (position, normal).
    """
    with build_reference(scene, sky=sky, lambertian=True, threads=threads) as reference:
        options = PassOptions(**{"seed": SEED, **how})
        return _passes(irradiance_pass, reference, where, 3, passes, samples, {"options": options})


def traced_ao(
    scene: Scene, where: Any, distance: float, *, passes: int = 8, samples: int = 64
) -> PointEstimate:
    """Return the ambient occlusion that the reference path tracer computes, 1 = unoccluded."""
    with build_reference(scene, threads=2) as reference:
        return _passes(
            ambient_occlusion_pass, reference, where, 1, passes, samples, {"seed": SEED, "distance": distance}
        )


def _passes(
    trace: Any, reference: Reference, where: Any, channels: int, passes: int, samples: int, how: Any
) -> PointEstimate:
    estimate = None
    for k in range(passes):
        position, normal = where(k) if callable(where) else where
        if estimate is None:
            estimate = new_estimate(len(position), channels, samples)
        trace(reference, estimate, position, normal, normal, **how)
    assert estimate is not None
    return estimate


def assert_closed_form(found: PointEstimate, truth: Any, *, channel: int = 0, rounding: float = 1e-5) -> None:
    """Compare n points, each traced as the same number of copies, with their truth (n,).

    Asserts for each point that

    - its error is at most three reported standard errors plus `rounding`, and at most 0.2 %;
    - three standard errors are less than 0.2 %;
    - the standard errors match the standard deviation of the copies.

    `rounding` is a relative error that is not noise. It comes from float32 and from ray origins, which are
    offset by 1e-5 of the scene's size. Seeds are fixed. After a change of random numbers, a point may by
    chance deviate by more than three standard errors. Its result is incorrect only if it deviates that much
    with other seeds, too.
    """
    truth = np.atleast_1d(np.asarray(truth, float))
    mean = found.mean[:, channel].reshape(len(truth), -1)
    error = found.standard_error[:, channel].reshape(len(truth), -1)
    copies = mean.shape[1]
    reported = np.sqrt((error**2).sum(axis=1)) / copies
    value = mean.mean(axis=1)
    away, noise = value / truth - 1, reported / truth
    report = "\n".join(
        f"point {k}: found {v:.6g}, truth {t:.6g}: {100 * a:+.4f} %, standard error {100 * s:.4f} %"
        for k, (v, t, a, s) in enumerate(zip(value, truth, away, noise, strict=True))
    )
    print(report)  # noqa: T201, shown by pytest -rP
    assert (3 * noise < WITHIN).all(), f"too noisy to tell\n{report}"
    assert (np.abs(away) <= 3 * noise + rounding).all(), f"more than three standard errors away\n{report}"
    assert (np.abs(away) <= WITHIN).all(), f"more than 0.2 % away\n{report}"
    _assert_believable(mean, error, report)


def _assert_believable(mean: Any, error: Any, report: str) -> None:
    """Check by an F-test over all points that the variance of the copies matches their standard errors."""
    real, reported = mean.var(axis=1, ddof=1), (error**2).mean(axis=1)
    noisy = reported > 0
    if not noisy.any():
        return
    n = mean.shape[1]
    ratio = float((real[noisy] / reported[noisy]).mean())
    degrees = noisy.sum() * (n - 1)
    # The reported variance is estimated from the passes of each copy, so both variances have about equally
    # many degrees of freedom.
    low, high = stats.f.ppf([5e-5, 1 - 5e-5], degrees, degrees)
    assert low < ratio < high, (
        f"copies vary {ratio:.3f} times as reported (from {low:.3f} to {high:.3f})\n{report}"
    )
