"""The own error of values: their spread about the truth, without the known noise of the reference.

For a group of n points with values v, reference r and its standard error s let c = max((v + r) / 2, floor),
and a the median of (v - r) / c, weighted by 1 / max(s / c, 0.02). The own error b, relative, solves

    mean psi((v - r - a c)^2 / (b^2 c^2 + (f s)^2)) = E psi(z^2)      psi(x) = min(x, 4), z normal

so that b^2 is the variance of the values about the truth if both errors are normal. Points with more noise
have smaller weights, and points with large errors (shadow edges, entrances of gaps) are limited to two
standard deviations. b is 0 where the noise of the reference explains all differences.

A common shift a of all points is bias and not part of b. In a group that is lit by rare paths, the points
without such a path all have the same negative error, the light of these paths.

s is the standard error that passes show. The factor f, at least 1, corrects it: f solves the same equation
with b = 0 for half the difference of two independent halves of the reference.

psi is bounded, so the mean over n points has a known standard error for any distribution of the errors. The
bounds of b solve the equation for E psi plus and minus z of these standard errors.

Based on: Huber and Ronchetti, Robust Statistics, 2009, chapter 5 (M-estimators of scale).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Bound of psi, and E psi(z^2) for normal z.
_PSI_BOUND = 4.0
_EXPECTED = (
    math.erf(math.sqrt(_PSI_BOUND / 2))
    - math.sqrt(2 * _PSI_BOUND / math.pi) * math.exp(-_PSI_BOUND / 2)
    + _PSI_BOUND * math.erfc(math.sqrt(_PSI_BOUND / 2))
)
_BISECTIONS = 40
# Points with less relative noise have equal weights in the median.
_SHARP = 0.02
# Largest own error, and smallest relative noise of a reference.
_LARGEST, _SMALLEST = 4.0, 1.0e-6


class Spread(NamedTuple):
    """An own error, relative, with its lower and upper bound."""

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
        Half the difference of two halves of the reference, a sample of the error of their mean.
    floor : float
        Smallest light that errors are relative to.
    z : float
        Half the width of the bounds, in standard errors.

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
    """Return the weighted median of (n,)."""
    order = np.argsort(value, kind="stable")
    below = np.cumsum(weight[order])
    return float(value[order[np.searchsorted(below, 0.5 * below[-1])]])


def _root(error: NDArray[np.float64], known: NDArray[np.float64], z: float, *, factor: bool = False) -> float:
    """Return the b at which the mean of psi less z of its standard errors equals its expectation.

    With `factor` b multiplies the known errors (n,), otherwise b^2 is added to their squares.
    """
    low, high = 0.0, _LARGEST

    def beyond(b: float) -> bool:
        variance = (b * known) ** 2 + 1e-30 if factor else b * b + known**2
        psi = np.minimum(error**2 / variance, _PSI_BOUND)
        spread = float(psi.std()) / math.sqrt(len(psi))
        return float(psi.mean()) - z * spread > _EXPECTED

    if not beyond(low):
        return 0.0
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if beyond(middle) else (low, middle)
    return low
