"""Tests of Monte Carlo estimates against truth: Student's t over fixed seeds, with a Sidak bound.

A whole bake is one sample, since its texels share their patches' errors and are not independent.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

# Chance that a right program fails one call (seeds are fixed, so it does so always or never). The tests
# make some hundred calls.
LEVEL = 0.001


def critical(n_tests: int, degrees: float = np.inf) -> float:
    """Return the two-sided bound on n_tests independent t values at LEVEL in all."""
    alpha = 1.0 - (1.0 - LEVEL) ** (1.0 / n_tests)
    return float(stats.norm.isf(alpha / 2) if np.isinf(degrees) else stats.t.isf(alpha / 2, degrees))


def assert_unbiased(sample: Any, truth: Any, *, least: float, slack: float = 0.0) -> None:
    """Check that the mean over axis 0 of (seeds, ...) estimates is the truth (...).

    least : relative standard error that a sample must reach, so that the test can see anything
    slack : relative difference that is not noise (discretisation), given with its reason by the caller
    """
    sample = np.asarray(sample, np.float64)
    truth = np.broadcast_to(np.asarray(truth, np.float64), sample.shape[1:])
    n = len(sample)
    error = sample.std(axis=0, ddof=1) / np.sqrt(n)
    size = max(float(np.abs(truth).max()), 1e-30)
    assert float(error.max()) <= least * size, f"too noisy to tell: {error.max() / size:.3g} of the truth"
    away = np.maximum(np.abs(sample.mean(axis=0) - truth) - slack * np.abs(truth), 0.0)
    # Float32 results differ by rounding even where there is no noise at all.
    z = away / (error + 1e-6 * size)
    worst = np.unravel_index(z.argmax(), z.shape) if z.ndim else ()
    bound = critical(truth.size, n - 1)
    assert z[worst] < bound, (
        f"{worst}: mean {sample.mean(axis=0)[worst]:.6g} +- {error[worst]:.2g}, truth {truth[worst]:.6g}, "
        f"z {z[worst]:.2f} >= {bound:.2f}"
    )
