"""Figures of how far one set of values is from another, with what the reference's own noise adds.

For each place the mean over colours v of the value and r of the reference:

    relative error   |v - r| / max(r, floor)          floor = max(0.1 median(r), 0.01 mean(r))
    bias             mean(v - r) / mean(r)
    rmse             sqrt(mean (v_c - r_c)^2)         over colours c, in the channel's unit
    nrmse            rmse / mean(r)
    relmse           mean (v - r)^2 / (r^2 + 0.01 mean(r)^2)
    z                (v_c - r_c) / standard error of r_c
    colour error     |v_c - r_c| / max(r_c, 0.1 r, floor)
    energy ratio     R = sum w v / sum w r            w: the surface, m2, that a place stands for
    its error        sqrt(sum w^2 (v - R r)^2) / sum w r

`median`, `p95`, `p99`, `max` are of the relative error, whose floor keeps places in the dark from deciding:
an error there counts against a tenth of the median light, or a hundredth of the mean, if that is more.
`colour_median` and `colour_p95` are of the colour error, each in the colour where it is largest: a mean over
colours does not see that red and blue are swapped. `colour_bias` is mean(v_c - r_c) / mean(r_c) of the
colour where that is furthest from 0 (over a tenth of mean(r), if that is more).
`noise_floor` is the median relative error that the reference alone would show, `noise_p95` its 95th
percentile: two independent halves of it are compared, and their difference is halved, since the mean of both
halves is nearer to the truth than either by that much.
`energy_ratio` tells, as a furnace does, whether light is gained or lost on the whole: all that the maps hold
over all that the reference finds. `bias` weighs places alike, and small objects have more of them than their
area would give. `energy_ratio_se` is the standard error of such a ratio: it holds the reference's noise and
which places were picked, since both move v - R r.

Based on: Rousselle, Knaus and Zwicker, Adaptive sampling and reconstruction using greedy error minimization,
2011 (relMSE); Cochran, Sampling Techniques, 1977, chapter 6 (ratios).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FIGURES = (
    "texels", "bias", "rmse", "nrmse", "relmse", "median", "p95", "p99", "max", "noise_floor", "noise_p95",
    "z_rms", "energy_ratio", "energy_ratio_se", "colour_bias", "colour_median", "colour_p95",
)  # fmt: skip
# Values below this share of the median, or of the mean, count as dark.
_DARK_MEDIAN, _DARK_MEAN = 0.1, 0.01
_EPSILON = 0.01
# A colour is held against at least this share of the colours' mean: one that is hardly there tells nothing.
_LEAST_COLOUR = 0.1


def relative_error(
    value: NDArray[np.float64], reference: NDArray[np.float64], floor: float
) -> NDArray[np.float64]:
    """Return |v - r| / max(r, floor) of colour means (n,); value, reference : (n, C)."""
    v, r = value.mean(axis=1), reference.mean(axis=1)
    error: NDArray[np.float64] = np.abs(v - r) / np.maximum(r, max(floor, 1e-12))
    return error


def dark_floor(reference: NDArray[np.float64]) -> float:
    """Return what values of (n, C) below which count as dark; 0 if all are black."""
    mean = reference.mean(axis=1)
    if not len(mean):
        return 0.0
    return max(_DARK_MEDIAN * float(np.median(mean)), _DARK_MEAN * float(mean.mean()))


def figures(
    value: NDArray[np.float64],
    reference: NDArray[np.float64],
    *,
    standard_error: NDArray[np.float64] | None = None,
    halves: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    floor: float | None = None,
    weight: NDArray[np.float64] | None = None,
) -> dict[str, float | int | None]:
    """Return the figures of this file's head by name.

    Parameters
    ----------
    value, reference : (n, C)
    standard_error : (n, C), optional
        Of the reference; without it `z_rms` is None.
    halves : two (n, C), optional
        Independent halves of the reference; without them its noise is None.
    floor : float, optional
        See above; by default `dark_floor` of the reference.
    weight : (n,), m2, optional
        Surface that each place stands for; without it the energy ratio is None.

    Returns
    -------
    dict
        Keys are `FIGURES`; without any place only `texels`, 0, is a number.
    """
    found: dict[str, float | int | None] = dict.fromkeys(FIGURES)
    found["texels"] = len(value)
    if not len(value):
        return found
    value, reference = value.astype(np.float64), reference.astype(np.float64)
    floor = dark_floor(reference) if floor is None else floor
    error = relative_error(value, reference, floor)
    v, r = value.mean(axis=1), reference.mean(axis=1)
    mean = max(float(r.mean()), 1e-12)
    rmse = math.sqrt(float(((value - reference) ** 2).mean()))
    found["bias"] = float((v - r).mean()) / mean
    found["rmse"], found["nrmse"] = rmse, rmse / mean
    found["relmse"] = float(((v - r) ** 2 / (r**2 + _EPSILON * mean**2)).mean())
    found["median"] = float(np.median(error))
    found["p95"], found["p99"] = (float(np.percentile(error, q)) for q in (95, 99))
    found["max"] = float(error.max())
    found.update(_colour_figures(value, reference, floor))
    if halves is not None:
        apart = 0.5 * np.abs((halves[0] - halves[1]).mean(axis=1)) / np.maximum(r, max(floor, 1e-12))
        found["noise_floor"], found["noise_p95"] = (float(np.percentile(apart, q)) for q in (50, 95))
    if standard_error is not None:
        z = z_scores(value, reference, standard_error)
        found["z_rms"] = math.sqrt(float((z**2).mean())) if z.size else None
    if weight is not None:
        found["energy_ratio"], found["energy_ratio_se"] = energy_ratio(v, r, weight)
    return found


def _colour_figures(
    value: NDArray[np.float64], reference: NDArray[np.float64], floor: float
) -> dict[str, float]:
    mean = reference.mean(axis=1, keepdims=True)
    scale = np.maximum(np.maximum(reference, _LEAST_COLOUR * mean), max(floor, 1e-12))
    error = np.abs(value - reference) / scale
    whole = np.maximum(np.maximum(reference.mean(axis=0), _LEAST_COLOUR * mean.mean()), 1e-12)
    bias = (value - reference).mean(axis=0) / whole
    return {
        "colour_bias": float(bias[np.argmax(np.abs(bias))]),
        "colour_median": float(np.median(error, axis=0).max()),
        "colour_p95": float(np.percentile(error, 95, axis=0).max()),
    }


def beyond_noise(error: float, noise: float) -> float:
    """Return what an error holds beside independent noise: sqrt(error^2 - noise^2), at least 0."""
    return math.sqrt(max(error**2 - noise**2, 0.0))


def energy_ratio(
    value: NDArray[np.float64], reference: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[float | None, float | None]:
    """Return the ratio of this file's head for colour means (n,), and its standard error.

    Both are None where the reference holds no light; the error also for a single place.
    """
    total = float((weight * reference).sum())
    if not total > 0:
        return None, None
    ratio = float((weight * value).sum()) / total
    if len(value) < 2:
        return ratio, None
    return ratio, math.sqrt(float(((weight * (value - ratio * reference)) ** 2).sum())) / total


def z_scores(
    value: NDArray[np.float64], reference: NDArray[np.float64], standard_error: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the errors (m,) in standard errors of the reference, where that saw any light."""
    known = np.isfinite(standard_error) & (standard_error > 0) & (reference > 0)
    return np.asarray((value - reference)[known] / standard_error[known], np.float64)
