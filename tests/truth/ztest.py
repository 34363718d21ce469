"""Compares Monte Carlo estimates with their truth, by Student's t over fixed seeds with a Sidak bound.

A whole bake is one sample, because texels of one patch have the same error and are not independent.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

# Probability that a correct program fails one call of `assert_unbiased`. Seeds are fixed, so a call fails
# always or never. The tests make about a hundred calls.
LEVEL = 0.001


def critical(n_tests: int, degrees: float = np.inf) -> float:
    """Return the two-sided bound of n_tests independent t values, with LEVEL as total significance."""
    alpha = 1.0 - (1.0 - LEVEL) ** (1.0 / n_tests)
    return float(stats.norm.isf(alpha / 2) if np.isinf(degrees) else stats.t.isf(alpha / 2, degrees))


def assert_unbiased(sample: Any, truth: Any, *, least: float, slack: float = 0.0) -> None:
    """Check that the mean of the estimates (seeds, ...) over seeds equals the truth (...).

    least : largest permitted standard error, relative to the truth, so that the test is significant
    slack : relative difference that is not noise (discretisation), given with its reason by the caller
    """
    sample = np.asarray(sample, np.float64)
    truth = np.broadcast_to(np.asarray(truth, np.float64), sample.shape[1:])
    n = len(sample)
    error = sample.std(axis=0, ddof=1) / np.sqrt(n)
    size = max(float(np.abs(truth).max()), 1e-30)
    assert float(error.max()) <= least * size, f"too noisy to tell: {error.max() / size:.3g} of the truth"
    away = np.maximum(np.abs(sample.mean(axis=0) - truth) - slack * np.abs(truth), 0.0)
    # The second term allows for float32 rounding where there is no noise.
    z = away / (error + 1e-6 * size)
    worst = np.unravel_index(z.argmax(), z.shape) if z.ndim else ()
    bound = critical(truth.size, n - 1)
    assert z[worst] < bound, (
        f"{worst}: mean {sample.mean(axis=0)[worst]:.6g} +- {error[worst]:.2g}, truth {truth[worst]:.6g}, "
        f"z {z[worst]:.2f} >= {bound:.2f}"
    )
