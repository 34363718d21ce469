"""Figures of how far one set of values is from another, with what the reference's own noise adds.

For each place the mean over colours v of the value and r of the reference:

    relative error   |v - r| / max(r, floor)          floor = 0.1 median(r)
    bias             mean(v - r) / mean(r)
    rmse             sqrt(mean (v_c - r_c)^2)         over colours c, in the channel's unit
    nrmse            rmse / mean(r)
    relmse           mean (v - r)^2 / (r^2 + 0.01 mean(r)^2)
    z                (v_c - r_c) / standard error of r_c

`median`, `p95`, `p99`, `max` are of the relative error, whose floor keeps places in the dark from deciding:
an error there counts against a tenth of what is usual. `noise_floor` is the median relative error that the
reference alone would show: two independent halves of it are compared, and their difference is halved, since
the mean of both halves is nearer to the truth than either by that much.

Based on: Rousselle, Knaus and Zwicker, Adaptive sampling and reconstruction using greedy error minimization,
2011 (relMSE).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

FIGURES = (
    "texels", "bias", "rmse", "nrmse", "relmse", "median", "p95", "p99", "max", "noise_floor", "z_rms",
)  # fmt: skip
# Values below this share of the usual count as dark.
DARK = 0.1
_EPSILON = 0.01


def relative_error(
    value: NDArray[np.float64], reference: NDArray[np.float64], usual: float
) -> NDArray[np.float64]:
    """Return |v - r| / max(r, 0.1 usual) of colour means (n,); value, reference : (n, C)."""
    v, r = value.mean(axis=1), reference.mean(axis=1)
    error: NDArray[np.float64] = np.abs(v - r) / np.maximum(np.maximum(r, DARK * usual), 1e-12)
    return error


def usual_value(reference: NDArray[np.float64]) -> float:
    """Return the median of the colour means of (n, C), of those that are not black if most are."""
    mean = reference.mean(axis=1)
    lit = mean[mean > 0]
    if not len(lit):
        return 0.0
    middle = float(np.median(mean))
    return middle if middle > 0 else float(np.median(lit))


def figures(
    value: NDArray[np.float64],
    reference: NDArray[np.float64],
    *,
    standard_error: NDArray[np.float64] | None = None,
    halves: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    usual: float | None = None,
) -> dict[str, float | int | None]:
    """Return the figures of this file's head by name.

    Parameters
    ----------
    value, reference : (n, C)
    standard_error : (n, C), optional
        Of the reference; without it `z_rms` is None.
    halves : two (n, C), optional
        Independent halves of the reference; without them `noise_floor` is None.
    usual : float, optional
        What dark is measured against; by default `usual_value` of the reference.

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
    usual = usual_value(reference) if usual is None else usual
    error = relative_error(value, reference, usual)
    v, r = value.mean(axis=1), reference.mean(axis=1)
    mean = max(float(r.mean()), 1e-12)
    rmse = math.sqrt(float(((value - reference) ** 2).mean()))
    found["bias"] = float((v - r).mean()) / mean
    found["rmse"], found["nrmse"] = rmse, rmse / mean
    found["relmse"] = float(((v - r) ** 2 / (r**2 + _EPSILON * mean**2)).mean())
    found["median"] = float(np.median(error))
    found["p95"], found["p99"] = (float(np.percentile(error, q)) for q in (95, 99))
    found["max"] = float(error.max())
    if halves is not None:
        found["noise_floor"] = 0.5 * float(np.median(relative_error(halves[0], halves[1], usual)))
    if standard_error is not None:
        z = z_scores(value, reference, standard_error)
        found["z_rms"] = math.sqrt(float((z**2).mean())) if z.size else None
    return found


def z_scores(
    value: NDArray[np.float64], reference: NDArray[np.float64], standard_error: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the errors (m,) in standard errors of the reference, where that is known and not zero."""
    known = np.isfinite(standard_error) & (standard_error > 0)
    return np.asarray((value - reference)[known] / standard_error[known], np.float64)
