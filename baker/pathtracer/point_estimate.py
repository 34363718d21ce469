"""Means over passes with their standard errors, for points that take different numbers of passes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SAMPLES_PER_PASS = 16


@dataclass
class PointEstimate:
    """Means over passes; points may have different numbers of passes, and passes may be added.

    Attributes
    ----------
    total, squares : (2, n, C) float64
        Sums of the passes' means and of their squares, of even and of odd passes.
    count : (2, n) int64
        Even and odd passes of each point.
    samples : int
        Samples of a point in each pass.
    rounds : int
        Number of the next pass.
    rays, segments : int
        All rays cast, and the closest-hit rays of paths alone.
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
        """Return the standard error (n, C) of the estimate; inf after less than two passes."""
        n = self.count.sum(axis=0)[:, None].astype(np.float64)
        variance = (self.squares.sum(axis=0) / np.maximum(n, 1) - self.mean**2) / np.maximum(n - 1, 1)
        error: NDArray[np.float64] = np.where(n > 1, np.sqrt(np.maximum(variance, 0.0)), np.inf)
        return error

    def half(self, which: int) -> NDArray[np.float64]:
        """Return the mean (n, C) of the even (0) or odd (1) passes: two independent references."""
        mean: NDArray[np.float64] = self.total[which] / np.maximum(self.count[which], 1)[:, None]
        return mean


def new_estimate(n: int, channels: int, samples: int = SAMPLES_PER_PASS) -> PointEstimate:
    """Return an estimate before its first pass.

    Parameters
    ----------
    n : int
        Points.
    channels : int
        C, numbers for each point.
    samples : int
        Samples of a point in each pass.

    Returns
    -------
    PointEstimate
        All sums are 0.
    """
    zero = np.zeros((2, n, channels))
    return PointEstimate(zero, zero.copy(), np.zeros((2, n), np.int64), samples)


def add_pass(estimate: PointEstimate, rows: NDArray[np.int64] | slice, mean: NDArray[np.float64]) -> None:
    """Add the means of a pass to an estimate; the caller increments `rounds` after all points.

    Parameters
    ----------
    estimate : PointEstimate
        Changed in place.
    rows : (m,) int64 or slice
        The points.
    mean : (m, C) float64
        Their means over this pass.
    """
    half = estimate.rounds % 2
    estimate.total[half, rows] += mean
    estimate.squares[half, rows] += mean**2
    estimate.count[half, rows] += 1
