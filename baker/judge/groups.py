"""Is a group of places wrong on the whole? Ratios of sums, with their standard errors.

For the places of a group with values v_c and reference r_c (v, r: means over colours c), n of them:

    bias       B = sum v / sum r - 1
    colour     S_c = (V_c / V - R_c / R) / max(R_c / R, 0.3)     V, R: sums of v, r; V_c, R_c: of one colour
    typical    median of |v - r| / max(r, floor), floor as in `figures` but of the group; beside it what two
               halves of the reference, compared, show of it

A single place is known to some percent; a mean over a hundred of them to a tenth of that. So a deviation
of a whole object, colour or room is seen far below the noise of its texels. It is believed if it lies more
than `z_needed(n)` standard errors from 0. The error is that of the jackknife: how the figure changes if one
place is left out. So it holds the noise of the bake and of the reference, and where one bright place decides
it is large. A shift of colour is nearly free of noise, as a path's colours rise and fall together.

A typical error is believed to exceed the reference's noise if the lower bound of the one median lies above
the upper bound of the other. The bounds are order statistics, which hold for any distribution: in a group of
bright places and dark ones, whose errors differ by a factor of ten, a median may be anywhere between both.

Where the reference finds no light (less than three of its standard errors) differences are held against
a thousandth of the scene's bright light, and the error counts one unseen path that brings that light.

Based on: Cochran, Sampling Techniques, 1977, chapter 6; Efron, The jackknife, the bootstrap and other
resampling plans, 1982; David and Nagaraja, Order statistics, 2003, section 7.1 (bounds of a median).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.judge.figures import dark_floor

# Fewer places are not judged as a group.
LEAST = 8
_Z, _FEW = 4.0, 16.0
_LEAST_SHARE = 0.3
# Half the width of a median's bounds, in standard errors of its rank: both medians have bounds, so that
# for two like normal distributions they part at `_Z` standard errors of the ratio of the medians.
_RANKS = _Z / math.sqrt(2.0)
# Light of which this share may be found where there is none, before it is an error of its own size.
_BLACK = 1.0e-3
_LIT = 3.0


class Compared(NamedTuple):
    """Values (n, C) beside a reference, its standard error, two halves of it, and its samples (n,)."""

    value: NDArray[np.float64]
    reference: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    halves: tuple[NDArray[np.float64], NDArray[np.float64]]
    samples: NDArray[np.int64]

    def of(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Compared:
        """Return some of the places."""
        halves = self.halves[0][which], self.halves[1][which]
        return Compared(
            self.value[which], self.reference[which], self.standard_error[which], halves, self.samples[which]
        )


@dataclass(frozen=True)
class GroupFigures:
    """What this file's head defines.

    Attributes
    ----------
    texels : int
    light : float
        Mean of the reference.
    bias, bias_se : float
    colour, colour_se : (C,) float64
    typical, typical_noise : float
    typical_least, typical_noise_most : float
        Lower bound of the one median, upper bound of the other.
    """

    texels: int
    light: float
    bias: float
    bias_se: float
    colour: NDArray[np.float64]
    colour_se: NDArray[np.float64]
    typical: float
    typical_noise: float
    typical_least: float
    typical_noise_most: float

    @property
    def sure_bias(self) -> float:
        """Return the bias, 0 if it may be chance."""
        return self.bias if abs(self.bias) > z_needed(self.texels) * self.bias_se else 0.0

    @property
    def sure_colour(self) -> float:
        """Return the largest shift of a colour that is not chance, 0 if none."""
        sure = np.where(np.abs(self.colour) > z_needed(self.texels) * self.colour_se, self.colour, 0.0)
        return float(sure[np.argmax(np.abs(sure))])

    @property
    def sure_noise(self) -> float:
        """Return the typical error beyond what the reference's noise shows, 0 if it may be chance."""
        if self.typical_least <= self.typical_noise_most:
            return 0.0
        return math.sqrt(self.typical**2 - self.typical_noise**2)

    def as_json(self) -> dict[str, float | int | list[float]]:
        """Return plain values."""
        return {
            "texels": self.texels,
            "light": self.light,
            "bias": self.bias,
            "bias_se": self.bias_se,
            "colour": self.colour.tolist(),
            "colour_se": self.colour_se.tolist(),
            "typical": self.typical,
            "typical_noise": self.typical_noise,
            "typical_least": self.typical_least,
            "typical_noise_most": self.typical_noise_most,
        }


def z_needed(n: int) -> float:
    """Return how many standard errors make a deviation sure: more where few places tell the error itself."""
    return _Z + _FEW / max(n, 1)


def bright_light(reference: NDArray[np.float64]) -> float:
    """Return what counts as the bright light of a scene: the 95th percentile of (n, C)."""
    return float(np.percentile(reference.mean(axis=1), 95)) if len(reference) else 0.0


def compare_group(places: Compared, bright: float, least: float = 0.0) -> GroupFigures:
    """Return the figures of a group of at least two places.

    Parameters
    ----------
    places : Compared
    bright : float
        Of `bright_light`.
    least : float
        Differences are held against at least this mean light.
    """
    n = len(places.value)
    v, r = places.value.mean(axis=1), places.reference.mean(axis=1)
    noise = np.where(np.isfinite(places.standard_error), places.standard_error, 0.0).mean(axis=1)
    own = math.sqrt(float((noise**2).sum()))
    total = float(r.sum())
    if not total > _LIT * own:
        total = max(total, _BLACK * bright * n, 1e-30)
        own = math.hypot(own, n * bright / max(float(places.samples.sum()), 1.0))
    total = max(total, least * n)
    bias = float(v.sum() - r.sum()) / total
    spread = _jackknife((v.sum() - v - (r.sum() - r))[:, None] / np.maximum(total - r, total / n)[:, None])[0]
    colour, colour_se = _colour_shift(places)
    lowest = max(dark_floor(places.reference), least)
    scale = np.maximum(r, lowest) if lowest > 0 else np.full(n, total / n)
    apart = 0.5 * np.abs((places.halves[0] - places.halves[1]).mean(axis=1)) / scale
    error = np.abs(v - r) / scale
    return GroupFigures(
        texels=n,
        light=float(r.mean()),
        bias=bias,
        bias_se=max(spread, own / total),
        colour=colour,
        colour_se=colour_se,
        typical=float(np.median(error)),
        typical_noise=float(np.median(apart)),
        typical_least=median_bounds(error)[0],
        typical_noise_most=median_bounds(apart)[1],
    )


def median_bounds(sample: NDArray[np.float64]) -> tuple[float, float]:
    """Return between which values the median of the distribution lies that n numbers were drawn from."""
    half = 0.5 * _RANKS / math.sqrt(len(sample))
    low, high = np.quantile(sample, [max(0.5 - half, 0.0), min(0.5 + half, 1.0)])
    return float(low), float(high)


def _colour_shift(places: Compared) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far each colour's share of the light is off, (C,), and the standard errors."""
    v, r = places.value.mean(axis=1), places.reference.mean(axis=1)
    sums = [a.sum(axis=0) for a in (places.value, places.reference)]
    if places.value.shape[1] == 1 or not all(a.mean() > 0 for a in sums):
        return np.zeros(places.value.shape[1]), np.zeros(places.value.shape[1])
    share_v, share_r = (a / a.mean() for a in sums)
    scale = np.maximum(share_r, _LEAST_SHARE)
    left = [
        (total - each) / np.maximum(total.mean() - mean, 1e-9 * total.mean())[:, None]
        for total, each, mean in zip(sums, (places.value, places.reference), (v, r), strict=True)
    ]
    return (share_v - share_r) / scale, _jackknife((left[0] - left[1]) / scale)


def _jackknife(left_out: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard errors (m,) of figures whose values without each of n places are (n, m)."""
    n = len(left_out)
    error: NDArray[np.float64] = np.sqrt((n - 1) / n * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    return error
