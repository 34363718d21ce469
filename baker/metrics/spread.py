"""Computes the own error of values: their relative spread about the truth, without the reference's noise.

A group has n points with values v, reference values r, and standard errors s of the reference. Let
c = max((v + r) / 2, floor), and let a be the median of (v - r) / c, weighted by 1 / max(s / c, 0.02). The own
error b is the solution of

    mean psi((v - r - a c)^2 / (b^2 c^2 + (f s)^2)) = E psi(t^2)      psi(x) = min(x, 4), t normal

where the mean is over the points, and E is the expectation. If the errors of values and reference are normal,
b^2 is the relative variance of the values about the truth. If the noise of the reference explains all
differences, b is 0. Points with more noise have smaller weights. Because psi is bounded, points with large
errors, such as those at shadow edges and at entrances of gaps, count only as errors of two standard
deviations.

The common shift a of all points is part of the bias and not of b. (If rare paths light a group, most points
receive no such path. All these points have the same negative error, the missing light.)

s is estimated from the passes of the reference. The factor f, at least 1, corrects s. f is the solution of
the same equation with b = 0 and a = 0. In this equation, v - r is replaced by half the difference of two
halves of the reference.

psi is bounded, so the mean of psi over n points has a finite standard error for any distribution of the
errors. The lower and upper bounds of b solve the equation after z times this standard error is subtracted
from, or added to, the mean of psi.

Based on: Huber and Ronchetti, Robust Statistics, 2009, chapter 5 (M-estimators of scale).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Bound of psi, and the expectation E psi(t^2) for a standard normal t.
_PSI_BOUND = 4.0
_EXPECTED = (
    math.erf(math.sqrt(_PSI_BOUND / 2))
    - math.sqrt(2 * _PSI_BOUND / math.pi) * math.exp(-_PSI_BOUND / 2)
    + _PSI_BOUND * math.erfc(math.sqrt(_PSI_BOUND / 2))
)
# Number of bisection steps with which the equation is solved.
_BISECTIONS = 40
# Lower limit of s / c in the weights of the median.
_SHARP = 0.02
# Upper limit of the own error (and of the factor f), and lower limit of s / c in the equation.
_LARGEST, _SMALLEST = 4.0, 1.0e-6


class Spread(NamedTuple):
    """A relative own error with its lower and upper bound."""

    own: float
    lower: float
    upper: float


def own_error(
    value: NDArray[np.float64],
    reference: NDArray[np.float64],
    noise: NDArray[np.float64],
    apart: NDArray[np.float64],
    floor: float,
    z: float,
) -> Spread:
    """Return the own error of a group of points.

    Parameters
    ----------
    value, reference : (n,) float64
        Values and reference values.
    noise : (n,) float64
        Standard errors of the reference, estimated from its passes.
    apart : (n,) float64
        Half the difference of two independent halves of the reference. This half difference has the variance
        of the mean of the halves.
    floor : float
        Lower limit of the light to which errors are relative.
    z : float
        Distance of the bounds from the own error, in standard errors.

    Returns
    -------
    Spread
        The own error b and its bounds.
    """
    scale = np.maximum(0.5 * (value + reference), max(floor, 1e-30))
    error = (value - reference) / scale
    known = np.maximum(noise / scale, _SMALLEST)
    error = error - _median(error, 1.0 / np.maximum(known, _SHARP))
    known = known * max(_root(apart / scale, known, 0.0, factor=True), 1.0)
    return Spread(*(max(_root(error, known, width), 0.0) for width in (0.0, z, -z)))


def _median(value: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    """Return the weighted median of `value` (n,); `weight` (n,) are the weights."""
    order = np.argsort(value, kind="stable")
    below = np.cumsum(weight[order])
    return float(value[order[np.searchsorted(below, 0.5 * below[-1])]])


def _root(error: NDArray[np.float64], known: NDArray[np.float64], z: float, *, factor: bool = False) -> float:
    """Return the b for which the mean of psi minus z of its standard errors equals the expectation of psi.

    psi is evaluated at error^2 / variance. The variance is b^2 + known^2, or with `factor` b^2 known^2.
    `error` and `known` (n,) are relative errors and standard errors.
    """
    low, high = 0.0, _LARGEST
    n, square, known_square = len(error), error**2, known**2

    def beyond(b: float) -> bool:
        variance = (b * known) ** 2 + 1e-30 if factor else b * b + known_square
        psi = np.minimum(square / variance, _PSI_BOUND)
        # Sums take a third of the time of the methods `mean` and `std`, and give the same bits.
        mean = float(np.add.reduce(psi)) / n
        if z == 0.0:
            return mean > _EXPECTED
        apart = psi - mean
        return mean - z * (math.sqrt(float(np.add.reduce(apart * apart)) / n) / math.sqrt(n)) > _EXPECTED

    if not beyond(low):
        return 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if beyond(middle) else (low, middle)
    return low
