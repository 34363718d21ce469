"""The error that values have of their own, beside the known noise of the reference they are held against.

For a group of n places with values v, reference r and its standard error s let c = max((v + r) / 2, floor),
and a the median of (v - r) / c, weighed by 1 / max(s / c, 0.02). The own error b, relative, solves

    mean psi((v - r - a c)^2 / (b^2 c^2 + (f s)^2)) = E psi(z^2)      psi(x) = min(x, 4), z normal

so that b^2 is the variance of the values about the truth if both errors are normal: places of much noise
count less than those of little, and a few places that are far off (shadow edges, mouths of gaps) count as
being two standard deviations off. b is 0 where the noise of the reference explains all.

A shift a that all places have in common is not part of b. It is judged as bias; and in a group that light
reaches by rare paths the places that saw none of them are all off by what these bring, in one direction.

s is what passes show, times f: two independent halves of the reference, compared, tell how far that is from
what their difference shows, by the same equation with b = 0. It is at least 1.

psi is bounded, so its mean over n places is known to a standard error whatever the distribution of the errors
is, and b is between the solutions for E psi + and - that many standard errors.

Based on: Huber and Ronchetti, Robust Statistics, 2009, chapter 5 (M-estimators of scale).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Squares of errors, in variances, count up to this; what they then are on average for normal errors.
_MOST = 4.0
_EXPECTED = (
    math.erf(math.sqrt(_MOST / 2))
    - math.sqrt(2 * _MOST / math.pi) * math.exp(-_MOST / 2)
    + _MOST * math.erfc(math.sqrt(_MOST / 2))
)
_HALVINGS = 40
# Places known better than this weigh alike in the median.
_SHARP = 0.02
# No error is taken to be larger; a reference without noise is taken to have this much.
_LARGEST, _SMALLEST = 4.0, 1.0e-6


class Spread(NamedTuple):
    """An own error, relative; and between which values it lies."""

    own: float
    least: float
    most: float


def own_error(
    value: NDArray[np.float64],
    reference: NDArray[np.float64],
    noise: NDArray[np.float64],
    apart: NDArray[np.float64],
    floor: float,
    z: float,
) -> Spread:
    """Return the own error of a group of places.

    Parameters
    ----------
    value, reference : (n,)
    noise : (n,)
        Standard errors of the reference, as its passes show them.
    apart : (n,)
        Half of the difference of two halves of the reference: an error like that of their mean.
    floor : float
        Errors are relative to at least this light.
    z : float
        Half the width of the bounds, in standard errors.
    """
    scale = np.maximum(0.5 * (value + reference), max(floor, 1e-30))
    error = (value - reference) / scale
    known = np.maximum(noise / scale, _SMALLEST)
    error = error - _median(error, 1.0 / np.maximum(known, _SHARP))
    known = known * max(_root(apart / scale, known, 0.0, factor=True), 1.0)
    return Spread(*(max(_root(error, known, width), 0.0) for width in (0.0, z, -z)))


def _median(value: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    order = np.argsort(value, kind="stable")
    below = np.cumsum(weight[order])
    return float(value[order[np.searchsorted(below, 0.5 * below[-1])]])


def _root(error: NDArray[np.float64], known: NDArray[np.float64], z: float, *, factor: bool = False) -> float:
    """Return for which b the mean of psi is as expected, z standard errors of it less.

    With `factor` b multiplies the known errors (n,), else its square is added to theirs.
    """
    low, high = 0.0, _LARGEST

    def beyond(b: float) -> bool:
        variance = (b * known) ** 2 + 1e-30 if factor else b * b + known**2
        psi = np.minimum(error**2 / variance, _MOST)
        spread = float(psi.std()) / math.sqrt(len(psi))
        return float(psi.mean()) - z * spread > _EXPECTED

    if not beyond(low):
        return 0.0
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if beyond(middle) else (low, middle)
    return low
