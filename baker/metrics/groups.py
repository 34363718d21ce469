"""Is a group of places wrong on the whole? Ratios of sums, with their standard errors.

For the places of a group with values v_c and reference r_c (v, r: means over colours c), n of them:

    bias       B = sum v / sum r - 1
    colour     S_c = (V_c / V - R_c / R) / max(R_c / R, 0.3)     V, R: sums of v, r; V_c, R_c: of one colour
    own error  b of `spread`: the spread of the values about the truth, relative, beside the reference's noise
    typical    median of |v - r| / max(r, floor), floor of the group (`error_metrics`); beside it what two
               halves of the reference, compared, show of it

A single place is known to some percent; a mean over a hundred of them to a tenth of that. So a deviation
of a whole object, colour or room is seen far below the noise of its texels. How much of it is sure is what is
left when `z_needed(m)` standard errors are taken off: a deviation is never reported larger than it is by
chance. m is the number of places that bring the light, (sum w)^2 / sum w^2 with w = v + r; where it is below
`LEAST` nothing is sure. The error is the largest of three: that of the jackknife (how the figure changes if
one place is left out: it holds the noise of the bake and of the reference, and where one bright place decides
it is large), that of the reference alone, and half the difference between the figures of two halves of the
reference. A group whose reference is off by more than `_UNKNOWN` of its mean light (rms over its places) has
no own error that is sure: light that rare paths bring is missing at most of its places, and too much at some.
A shift of colour is nearly free of noise where a path's colours rise and fall together.

Where the reference finds no light (less than three of its standard errors) differences are held against
a thousandth of the scene's bright light, and the error counts one unseen path that brings that light.

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

# Fewer places are not judged as a group.
LEAST = 8
_Z, _FEW = 3.0, 32.0
_LEAST_SHARE = 0.3
# Light of which this share may be found where there is none, before it is an error of its own size.
_BLACK = 1.0e-3
_LIT = 3.0
_UNKNOWN = 0.4
# Own errors are relative to at least these shares of a group's mean light and of the scene's bright light.
_FAINT, _FAINTEST = 0.01, 1.0e-4


class Compared(NamedTuple):
    """Values (n, C) beside a reference.

    value, reference : (n, C); standard_error : (n, C), of the reference, with what it may not have seen;
    halves : two (n, C), independent halves of it; samples : (n,); spread : (n, C), standard error that its
    passes show.
    """

    value: NDArray[np.float64]
    reference: NDArray[np.float64]
    standard_error: NDArray[np.float64]
    halves: tuple[NDArray[np.float64], NDArray[np.float64]]
    samples: NDArray[np.int64]
    spread: NDArray[np.float64]

    def of(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Compared:
        """Return some of the places."""
        halves = self.halves[0][which], self.halves[1][which]
        return Compared(
            self.value[which], self.reference[which], self.standard_error[which], halves,
            self.samples[which], self.spread[which],
        )  # fmt: skip


@dataclass(frozen=True)
class GroupFigures:
    """What this file's head defines.

    Attributes
    ----------
    texels : int
    effective : float
        How many places bring the light.
    light : float
        Mean of the reference.
    bias, bias_se : float
    colour, colour_se : (C,) float64
    typical, typical_noise : float
    spread : Spread
        Own error, and its bounds `z_needed(n)` standard errors from it.
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
        """Return by how much the group is off at least, 0 if that may be chance."""
        return float(self._sure(np.array(self.bias), np.array(self.bias_se)))

    @property
    def sure_colour(self) -> float:
        """Return by how much a colour is shifted at least, of the colour where that is most."""
        sure = self._sure(self.colour, self.colour_se)
        return float(sure[np.argmax(np.abs(sure))])

    @property
    def sure_noise(self) -> float:
        """Return the own error that the group has at least."""
        return self.spread.least

    def _sure(self, figure: NDArray[np.float64], error: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return figures with what may be chance taken off their size."""
        if self.effective < LEAST:
            return np.zeros_like(figure)
        left = np.maximum(np.abs(figure) - z_needed(self.effective) * error, 0.0)
        return np.asarray(np.sign(figure) * left, np.float64)

    def as_json(self) -> dict[str, float | int | list[float]]:
        """Return plain values."""
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
            "own_error_least": self.spread.least,
            "own_error_most": self.spread.most,
        }


def z_needed(n: float) -> float:
    """Return how many standard errors a figure may be off: more where few places tell the error itself."""
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
    apart = 0.5 * (places.halves[0] - places.halves[1]).mean(axis=1)
    shown = np.where(np.isfinite(places.spread), places.spread, 0.0).mean(axis=1)
    known = own_error(v, r, shown, apart, max(lowest, total / n * _FAINT, bright * _FAINTEST), z_needed(n))
    if math.sqrt(float((shown**2).mean())) * n > _UNKNOWN * total:
        known = known._replace(least=0.0)
    return GroupFigures(
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


def _colour_shift(places: Compared) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return how far each colour's share of the light is off, (C,), and the standard errors."""
    v, r = places.value.mean(axis=1), places.reference.mean(axis=1)
    all_sums = [a.sum(axis=0) for a in (places.value, places.reference, *places.halves)]
    if places.value.shape[1] == 1 or not all(a.mean() > 0 for a in all_sums):
        return np.zeros(places.value.shape[1]), np.zeros(places.value.shape[1])
    share_v, share_r, one, other = (a / a.mean() for a in all_sums)
    scale = np.maximum(share_r, _LEAST_SHARE)
    left = [
        (total - each) / np.maximum(total.mean() - mean, 1e-9 * total.mean())[:, None]
        for total, each, mean in zip(all_sums[:2], (places.value, places.reference), (v, r), strict=True)
    ]
    error = np.maximum(_jackknife((left[0] - left[1]) / scale), 0.5 * np.abs(one - other) / scale)
    return (share_v - share_r) / scale, error


def _jackknife(left_out: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the standard errors (m,) of figures whose values without each of n places are (n, m)."""
    n = len(left_out)
    error: NDArray[np.float64] = np.sqrt((n - 1) / n * ((left_out - left_out.mean(axis=0)) ** 2).sum(axis=0))
    return error
