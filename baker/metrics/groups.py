"""Computes the deviations of a group of points from the reference, with standard errors.

A group is the set of points of an object, a chart or another region. Its deviations are ratios of sums over
the group. The value of a single point is known to a few percent, and the mean of a hundred points ten times
more accurately. Deviations of a whole group are therefore detected far below the noise of single texels.

For the n points of a group, v_c and r_c are the value and the reference value of colour c, and v and r their
means over colours. V, R, V_c and R_c are the sums of v, r, v_c and r_c over the group.

    bias       B = V / R - 1
    colour     S_c = (V_c / V - R_c / R) / max(R_c / R, 0.3)
    own error  relative spread b of v about the truth, without the reference's noise (`baker.metrics.spread`)
    typical    median of |v - r| / max(r, floor), with the floor `dark_floor` of the group
    noise      median of |d| / max(r, floor), where d is half the difference of two halves of the reference

Before a deviation is reported, its absolute value is reduced by `z_needed(m)` times its standard error. m is
the effective number of points, (sum w)^2 / sum w^2 with w = v + r. If m is below `MIN_POINTS`, no deviation
is significant.

The standard error of bias and colour is the largest of these:

- the standard error of the jackknife, from the change if one point is left out. This error contains the noise
  of bake and reference, and is large if one bright point dominates;
- for the bias, the standard error of the reference alone;
- half the difference between the two deviations that result if only one half of the reference is used.

The noise of colour shifts is small, because the colours of a path are correlated.

If the rms noise of a group's reference exceeds the share `_UNRELIABLE` of the group's mean light, the lower
bound of the own error is set to 0. The reason is that the light of rare paths is then missing at most points,
and too strong at a few points.

The bright light of a scene is the 95th percentile of its reference values r. If the summed reference of a
group is at most three times the standard error of this sum, differences are relative to at least a thousandth
of the bright light. The standard error then includes one missed path that carries the bright light.

Based on: Cochran, Sampling Techniques, 1977, chapter 6; Efron, The jackknife, the bootstrap and other
resampling plans, 1982.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.metrics.error_metrics import dark_floor
from baker.metrics.spread import Spread, own_error

# Effective number of points of a group below which no deviation is significant.
MIN_POINTS = 8
# A deviation of n points is significant if it exceeds _Z + _Z_FEW / n standard errors.
_Z, _Z_FEW = 3.0, 32.0
# Lower limit of R_c / R in the denominator of the colour shift.
_MIN_COLOUR_SHARE = 0.3
# Lower limit of the denominator of differences if the reference is black, as a share of the bright light.
_BLACK = 1.0e-3
# The reference of a group counts as black if its sum is at most this number times the standard error of the
# sum.
_LIT = 3.0
# Relative rms noise of the reference above which the lower bound of the own error is 0.
_UNRELIABLE = 0.4
# Lower limits of the denominator of the own error, as a share of the group's mean light and as a share of the
# scene's bright light.
_FAINT, _FAINTEST = 0.01, 1.0e-4


class ComparedPoints(NamedTuple):
    """Values and reference values of C colours at n points.

    Attributes
    ----------
    value, reference : (n, C) float64
        Values of the bake, and path-traced values.
    standard_error : (n, C) float64
        Standard error of the reference, including light that it may have missed.
    halves : two (n, C) float64
        Two independent estimates whose mean is the reference.
    samples : (n,) int64
        Number of samples of the reference.
    spread : (n, C) float64
        Standard error of the reference, estimated from the differences of its passes.
    """

    value: NDArray[np.float64]
    reference: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    halves: tuple[NDArray[np.float64], NDArray[np.float64]]
    samples: NDArray[np.int64]
    spread: NDArray[np.float64]

    def of(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> ComparedPoints:
        """Return the points that a mask (n,) or indices (m,) select."""
        halves = self.halves[0][which], self.halves[1][which]
        return ComparedPoints(
            self.value[which], self.reference[which], self.standard_error[which], halves,
            self.samples[which], self.spread[which],
        )  # fmt: skip


@dataclass(frozen=True)
class GroupMetrics:
    """Metrics of a group of points, as the docstring of this module defines them.

    Attributes
    ----------
    texels : int
        Number of points.
    effective : float
        Effective number of points, m.
    light : float
        Mean of the reference over points and colours.
    bias, bias_se : float
        Relative bias and its standard error.
    colour, colour_se : (C,) float64
        Relative shift of each colour, and the standard errors.
    typical, typical_noise : float
        Median relative error, and the median relative noise of the reference.
    spread : Spread
        The own error and its bounds, `z_needed(n)` standard errors below and above it.
    """

    texels: int
    effective: float
    light: float
    bias: float
    bias_se: float
    colour: NDArray[np.float64]
    colour_se: NDArray[np.float64]
    typical: float
    typical_noise: float
    spread: Spread

    @property
    def sure_bias(self) -> float:
        """Return the bias, with its absolute value reduced by `z_needed` standard errors, not below 0."""
        return float(self._sure(np.array(self.bias), np.array(self.bias_se)))

    @property
    def sure_colour(self) -> float:
        """Return the largest colour shift, with its absolute value reduced like that of the bias."""
        sure = self._sure(self.colour, self.colour_se)
        return float(sure[np.argmax(np.abs(sure))])

    @property
    def sure_noise(self) -> float:
        """Return the lower bound of the own error."""
        return self.spread.lower

    def _sure(self, deviation: NDArray[np.float64], error: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return deviations with absolute values reduced by `z_needed` standard errors, not below 0.

        All are 0 if the group has fewer than `MIN_POINTS` effective points.
        """
        if self.effective < MIN_POINTS:
            return np.zeros_like(deviation)
        left = np.maximum(np.abs(deviation) - z_needed(self.effective) * error, 0.0)
        return np.asarray(np.sign(deviation) * left, np.float64)

    def as_json(self) -> dict[str, float | int | list[float]]:
        """Return the metrics as values that JSON can represent."""
        return {
            "texels": self.texels,
            "effective": self.effective,
            "light": self.light,
            "bias": self.bias,
            "bias_se": self.bias_se,
            "colour": self.colour.tolist(),
            "colour_se": self.colour_se.tolist(),
            "typical": self.typical,
            "typical_noise": self.typical_noise,
            "own_error": self.spread.own,
            "own_error_least": self.spread.lower,
            "own_error_most": self.spread.upper,
        }


def z_needed(n: float) -> float:
    """Return the number of standard errors that a deviation of n points must exceed to be significant.

    This number is larger for small n, because the standard error itself is then uncertain.
    """
    return _Z + _Z_FEW / max(n, 1)


def bright_light(reference: NDArray[np.float64]) -> float:
    """Return the bright light of a scene: the 95th percentile over points of the mean over colours.

    Parameters
    ----------
    reference : (n, C) float64
        Reference values.

    Returns
    -------
    float
        In the unit of the channel; 0 without points.
    """
    return float(np.percentile(reference.mean(axis=1), 95)) if len(reference) else 0.0


def compare_group(points: ComparedPoints, bright: float, min_light: float = 0.0) -> GroupMetrics:
    """Compute the metrics of a group of at least two points.

    Parameters
    ----------
    points : ComparedPoints
        The points of the group.
    bright : float
        The bright light of the scene, see `bright_light`.
    min_light : float
        Lower limit of the mean light to which differences are relative.

    Returns
    -------
    GroupMetrics
        The metrics with their standard errors.
    """
    n = len(points.value)
    v, r = points.value.mean(axis=1), points.reference.mean(axis=1)
    noise = np.where(np.isfinite(points.standard_error), points.standard_error, 0.0).mean(axis=1)
    own = math.sqrt(float((noise**2).sum()))
    total = float(r.sum())
    if not total > _LIT * own:
        total = max(total, _BLACK * bright * n, 1e-30)
        own = math.hypot(own, n * bright / max(float(points.samples.sum()), 1.0))
    total = max(total, min_light * n)
    bias = float(v.sum() - r.sum()) / total
    spread = _jackknife((v.sum() - v - (r.sum() - r))[:, None] / np.maximum(total - r, total / n)[:, None])[0]
    colour, colour_se = _colour_shift(points)
    lowest = max(dark_floor(points.reference), min_light)
    scale = np.maximum(r, lowest) if lowest > 0 else np.full(n, total / n)
    apart = 0.5 * (points.halves[0] - points.halves[1]).mean(axis=1)
    shown = np.where(np.isfinite(points.spread), points.spread, 0.0).mean(axis=1)
    known = own_error(v, r, shown, apart, max(lowest, total / n * _FAINT, bright * _FAINTEST), z_needed(n))
    if math.sqrt(float((shown**2).mean())) * n > _UNRELIABLE * total:
        known = known._replace(lower=0.0)
    return GroupMetrics(
        texels=n,
        effective=float((v + r).sum()) ** 2 / max(float(((v + r) ** 2).sum()), 1e-30),
        light=float(r.mean()),
        bias=bias,
        bias_se=max(spread, own / total, abs(float(apart.sum())) / total),
        colour=colour,
        colour_se=colour_se,
        typical=float(np.median(np.abs(v - r) / scale)),
        typical_noise=float(np.median(np.abs(apart) / scale)),
        spread=known,
    )


def _colour_shift(points: ComparedPoints) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the relative shift of each colour's share of the light (C,), and its standard errors (C,).

    Both are 0 for a channel of one component, or if a sum of the light is black.
    """
    v, r = points.value.mean(axis=1), points.reference.mean(axis=1)
    all_sums = [a.sum(axis=0) for a in (points.value, points.reference, *points.halves)]
    if points.value.shape[1] == 1 or not all(a.mean() > 0 for a in all_sums):
        return np.zeros(points.value.shape[1]), np.zeros(points.value.shape[1])
    share_v, share_r, one, other = (a / a.mean() for a in all_sums)
    scale = np.maximum(share_r, _MIN_COLOUR_SHARE)
    left = [
        (total - each) / np.maximum(total.mean() - mean, 1e-9 * total.mean())[:, None]
        for total, each, mean in zip(all_sums[:2], (points.value, points.reference), (v, r), strict=True)
    ]
    error = np.maximum(_jackknife((left[0] - left[1]) / scale), 0.5 * np.abs(one - other) / scale)
    return (share_v - share_r) / scale, error


def _jackknife(left_out: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard errors (m,) of m statistics.

    Row i of `left_out` (n, m) contains the statistics of all points except point i.
    """
    n = len(left_out)
    error: NDArray[np.float64] = np.sqrt((n - 1) / n * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    return error
