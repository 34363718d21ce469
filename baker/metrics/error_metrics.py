"""Computes error metrics of a set of values against reference values.

v_c and r_c are the value and the reference value of colour c at a point, and v and r their means over
colours. Means and medians are over all points, unless stated otherwise:

    relative error   |v - r| / max(r, floor)          floor = max(0.1 median(r), 0.01 mean(r))
    bias             mean(v - r) / mean(r)
    rmse             sqrt(mean((v_c - r_c)^2))        over points and colours, in the channel's unit
    nrmse            rmse / mean(r)
    relmse           mean((v - r)^2 / (r^2 + 0.01 mean(r)^2))
    z                (v_c - r_c) / standard error of r_c
    colour error     |v_c - r_c| / max(r_c, 0.1 r, floor)
    energy ratio     R = sum w v / sum w r            w: surface area, m2, that a point represents
    std. error of R  sqrt(sum w^2 (v - R r)^2) / sum w r

`median`, `p95`, `p99` and `max` are statistics of the relative error. Without the floor in the denominator,
dark points would dominate them. `z_rms` is the root mean square of z over points and colours.

`colour_median` and `colour_p95` are the median and the 95th percentile of the colour error. Both are computed
for each colour, and the largest values are returned. A mean over colours would not detect that red and blue
are swapped. `colour_bias` is mean(v_c - r_c) / mean(r_c) of the colour where this ratio is farthest from 0.
The denominator is at least a tenth of mean(r).

`noise_floor` and `noise_p95` are the median and the 95th percentile of the relative error that the noise of
the reference causes. The reference is the mean of two independent halves. The noise of this mean is estimated
as half the difference of the halves, because both have the same variance.

`energy_ratio` is the ratio R of the total light of the bake to that of the reference. This ratio detects gain
or loss of energy, as a furnace test does. The points are weighted by area, unlike in `bias`, because small
objects have more points per area. `energy_ratio_se` is the standard error of R as a ratio estimator. This
standard error includes the noise of the reference and the random choice of points, because both change
v - R r.

Based on: Rousselle, Knaus and Zwicker, Adaptive sampling and reconstruction using greedy error minimization,
2011 (relMSE); Cochran, Sampling Techniques, 1977, chapter 6 (ratios).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

# Names of the metrics, in the order of reports.
METRICS = (
    "texels", "bias", "rmse", "nrmse", "relmse", "median", "p95", "p99", "max", "noise_floor", "noise_p95",
    "z_rms", "energy_ratio", "energy_ratio_se", "colour_bias", "colour_median", "colour_p95",
)  # fmt: skip
# The level below which values count as dark is the larger of `_DARK_MEDIAN` x median and `_DARK_MEAN` x mean.
_DARK_MEDIAN, _DARK_MEAN = 0.1, 0.01
# Share of mean(r)^2 in the denominator of relmse.
_EPSILON = 0.01
# Lower limit of the denominator of the colour error and of `colour_bias`, as a share of the mean over
# colours.
_MIN_COLOUR = 0.1


def relative_error(
    value: NDArray[np.float64], reference: NDArray[np.float64], floor: float
) -> NDArray[np.float64]:
    """Return |v - r| / max(r, floor), where v and r are means over colours.

    Parameters
    ----------
    value, reference : (n, C) float64
        Values and reference values.
    floor : float
        Lower limit of the denominator, usually `dark_floor`.

    Returns
    -------
    (n,) float64
        Relative errors.
    """
    v, r = value.mean(axis=1), reference.mean(axis=1)
    error: NDArray[np.float64] = np.abs(v - r) / np.maximum(r, max(floor, 1e-12))
    return error


def dark_floor(reference: NDArray[np.float64]) -> float:
    """Return the level below which light counts as dark: max(0.1 median, 0.01 mean) of means over colours.

    Parameters
    ----------
    reference : (n, C) float64
        Reference values.

    Returns
    -------
    float
        In the unit of the channel; 0 without points, or if all are black.
    """
    mean = reference.mean(axis=1)
    if not len(mean):
        return 0.0
    return max(_DARK_MEDIAN * float(np.median(mean)), _DARK_MEAN * float(mean.mean()))


def error_metrics(
    value: NDArray[np.float64],
    reference: NDArray[np.float64],
    *,
    standard_error: NDArray[np.float64] | None = None,
    halves: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    floor: float | None = None,
    weight: NDArray[np.float64] | None = None,
) -> dict[str, float | int | None]:
    """Compute the metrics that the docstring of this module defines.

    Parameters
    ----------
    value, reference : (n, C) float64
        Values and reference values.
    standard_error : (n, C) float64, optional
        Standard error of the reference. Without it, `z_rms` is None.
    halves : two (n, C) float64, optional
        Two independent estimates whose mean is the reference. Without them, `noise_floor` and `noise_p95` are
        None.
    floor : float, optional
        Lower limit of the denominator of relative errors. The default is `dark_floor` of the reference.
    weight : (n,) float64, m2, optional
        Surface area that each point represents. Without it, `energy_ratio` and `energy_ratio_se` are None.

    Returns
    -------
    dict of str to number or None
        Keys are `METRICS`. Without points, `texels` is 0 and all other metrics are None.
    """
    found: dict[str, float | int | None] = dict.fromkeys(METRICS)
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
    found.update(_colour_metrics(value, reference, floor))
    if halves is not None:
        apart = 0.5 * np.abs((halves[0] - halves[1]).mean(axis=1)) / np.maximum(r, max(floor, 1e-12))
        found["noise_floor"], found["noise_p95"] = (float(np.percentile(apart, q)) for q in (50, 95))
    if standard_error is not None:
        z = z_scores(value, reference, standard_error)
        found["z_rms"] = math.sqrt(float((z**2).mean())) if z.size else None
    if weight is not None:
        found["energy_ratio"], found["energy_ratio_se"] = energy_ratio(v, r, weight)
    return found


def colour_error(
    value: NDArray[np.float64], reference: NDArray[np.float64], floor: float
) -> NDArray[np.float64]:
    """Return the colour error of each colour, |v_c - r_c| / max(r_c, 0.1 r, floor).

    Parameters
    ----------
    value, reference : (n, C) float64
        Values and reference values.
    floor : float
        Lower limit of the denominator, usually `dark_floor`.

    Returns
    -------
    (n, C) float64
        Colour errors.
    """
    mean = reference.mean(axis=1, keepdims=True)
    scale = np.maximum(np.maximum(reference, _MIN_COLOUR * mean), max(floor, 1e-12))
    return np.asarray(np.abs(value - reference) / scale, np.float64)


def _colour_metrics(
    value: NDArray[np.float64], reference: NDArray[np.float64], floor: float
) -> dict[str, float]:
    mean = reference.mean(axis=1, keepdims=True)
    error = colour_error(value, reference, floor)
    whole = np.maximum(np.maximum(reference.mean(axis=0), _MIN_COLOUR * mean.mean()), 1e-12)
    bias = (value - reference).mean(axis=0) / whole
    return {
        "colour_bias": float(bias[np.argmax(np.abs(bias))]),
        "colour_median": float(np.median(error, axis=0).max()),
        "colour_p95": float(np.percentile(error, 95, axis=0).max()),
    }


def beyond_noise(error: float, noise: float) -> float:
    """Subtract independent noise from an error: sqrt(max(error^2 - noise^2, 0)).

    Parameters
    ----------
    error : float
        Error that includes the noise.
    noise : float
        Standard deviation of the noise, in the same unit.

    Returns
    -------
    float
        Error without the noise.
    """
    return math.sqrt(max(error**2 - noise**2, 0.0))


def energy_ratio(
    value: NDArray[np.float64], reference: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[float | None, float | None]:
    """Return the energy ratio R and its standard error.

    `value` and `reference` (n,) are means over colours, and `weight` (n,) are areas, m2. Both results are
    None if the reference is black. The standard error is also None for a single point.
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
    """Return (value - reference) / standard_error, the errors in units of the reference's standard error.

    Parameters
    ----------
    value, reference, standard_error : (n, C) float64
        Values, reference values and the standard errors of the reference values.

    Returns
    -------
    (m,) float64
        The errors of all components whose reference is above 0 and whose standard error is finite and above
        0.
    """
    known = np.isfinite(standard_error) & (standard_error > 0) & (reference > 0)
    return np.asarray((value - reference)[known] / standard_error[known], np.float64)
