"""Computes means over passes and their standard errors; points may have different numbers of passes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

# Default number of samples of a point in a pass.
SAMPLES_PER_PASS = 16


@dataclass
class PointEstimate:
    """Sums over passes of C values at n points. Points may have different numbers of passes.

    A pass computes the mean of `samples` samples at some or all points. Along the first axis of the arrays,
    index 0 is for even passes and index 1 for odd passes.

    Attributes
    ----------
    total : (2, n, C) float64
        Sum over passes of the means.
    squares : (2, n, C) float64
        Sum over passes of the squared means.
    count : (2, n) int64
        Number of passes of each point.
    samples : int
        Number of samples of a point in each pass.
    rounds : int
        Number of the next pass.
    rays : int
        Number of all rays cast.
    segments : int
        Number of closest-hit rays of paths.
    """

    total: NDArray[np.float64]
    squares: NDArray[np.float64]
    count: NDArray[np.int64]
    samples: int
    rounds: int = 0
    rays: int = 0
    segments: int = 0

    @property
    def mean(self) -> NDArray[np.float64]:
        """Return the estimate (n, C); 0 before the first pass."""
        mean: NDArray[np.float64] = self.total.sum(axis=0) / np.maximum(self.count.sum(axis=0), 1)[:, None]
        return mean

    @property
    def standard_error(self) -> NDArray[np.float64]:
        """Return the standard error (n, C) of the estimate; inf with fewer than two passes."""
        n = self.count.sum(axis=0)[:, None].astype(np.float64)
        variance = (self.squares.sum(axis=0) / np.maximum(n, 1) - self.mean**2) / np.maximum(n - 1, 1)
        error: NDArray[np.float64] = np.where(n > 1, np.sqrt(np.maximum(variance, 0.0)), np.inf)
        return error

    def half(self, which: int) -> NDArray[np.float64]:
        """Return the mean (n, C) of the even passes (`which` = 0) or of the odd passes (`which` = 1)."""
        mean: NDArray[np.float64] = self.total[which] / np.maximum(self.count[which], 1)[:, None]
        return mean


def new_estimate(n: int, channels: int, samples: int = SAMPLES_PER_PASS) -> PointEstimate:
    """Return an estimate before its first pass.

    Parameters
    ----------
    n : int
        Number of points.
    channels : int
        C, number of values at each point.
    samples : int
        Number of samples of a point in each pass.

    Returns
    -------
    PointEstimate
        All sums are 0.
    """
    zero = np.zeros((2, n, channels))
    return PointEstimate(zero, zero.copy(), np.zeros((2, n), np.int64), samples)


def add_pass(estimate: PointEstimate, rows: NDArray[np.int64] | slice, mean: NDArray[np.float64]) -> None:
    """Add the means of a pass at some points to an estimate.

    The caller increments `estimate.rounds` after it has added all points of the pass.

    Parameters
    ----------
    estimate : PointEstimate
        Changed in place.
    rows : (m,) int64 or slice
        Indices of the points.
    mean : (m, C) float64
        Means of the points' samples in this pass.
    """
    half = estimate.rounds % 2
    estimate.total[half, rows] += mean
    estimate.squares[half, rows] += mean**2
    estimate.count[half, rows] += 1
