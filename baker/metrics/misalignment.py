"""Detects maps that are shifted against their surface, blurred, or changed by a gamma curve.

A map is shifted if its difference from the reference is smaller after a shift by one texel; its error in
smooth areas may be small. A gamma curve was applied to a map if its values are a power of the reference with
an exponent other than 1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Tested shifts (rows, columns).
_STEPS = [(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)]
# Distance in texels over which curvature is measured.
_CURVATURE_STEP = 2
# Smallest coefficient of the curvature in the error that indicates blur.
_BLUR = 0.2
# Largest ratio of the misfits with and without a shift that indicates a shift.
_BETTER = 0.9
# Standard errors that a difference must exceed.
_Z = 4.0
# Fewest texels of a decision.
_MIN_TEXELS = 32
# Relative error of a correct map. Squared errors are in variances of this and the noise of the reference, and
# clipped, so that few texels with a large error or much noise do not dominate.
_TOLERANCE, _CLIP = 0.03, 9.0
# Tested exponents, 1 in the middle.
_POWERS = np.exp(np.linspace(-1.2, 1.2, 241))
# Largest residual of a texel, natural logarithm.
_MAX_RESIDUAL = 0.1


def best_shift(
    page: NDArray[np.float64],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    truth: NDArray[np.float64],
    noise: NDArray[np.float64] | None = None,
    better: float = _BETTER,
) -> tuple[int, int]:
    """Return the shift by which the map would fit the reference better.

    Parameters
    ----------
    page : (P, H, W) float64
        Colour means of the map.
    covered : (P, H, W) bool
        Texels with a measured value. Only texels whose four neighbours are covered are used.
    pixel : (n,) int64
        (page * H + row) * W + column of the compared texels.
    truth : (n,) float64
        Path-traced values of these texels.
    noise : (n,) float64, optional
        Standard errors of the path-traced values; their part of the misfit is subtracted.
    better : float
        Largest ratio of the misfits with and without a shift that indicates a shift.

    Returns
    -------
    rows, columns : int
        (0, 0) if no shift fits better.
    """
    misfit = _misfits(page, covered, pixel, truth, noise)
    if misfit is None:
        return 0, 0
    error, excess = misfit
    best = int(np.argmin(excess))
    gain = error[0] - error[best]
    # Require a significant gain: where a map is constant, all shifts have the same misfit except for noise.
    significant = gain.mean() > _Z * gain.std() / np.sqrt(len(gain))
    return _STEPS[best] if excess[best] < better * excess[0] and significant else (0, 0)


def is_blurred(
    page: NDArray[np.float64],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    truth: NDArray[np.float64],
) -> bool:
    """Return whether the map is blurred: its error is proportional to its curvature.

    A Gaussian blur of s texels adds s^2 / 2 times the Laplacian; noise of the map makes the coefficient
    negative.

    Parameters
    ----------
    page : (P, H, W) float64
        Colour means of the map.
    covered : (P, H, W) bool
        Texels with a measured value.
    pixel : (n,) int64
        (page * H + row) * W + column of the compared texels.
    truth : (n,) float64
        Path-traced values of these texels.

    Returns
    -------
    bool
        False if fewer than 32 texels can be used.
    """
    height, width = page.shape[1:]
    number, rest = np.divmod(pixel, height * width)
    row, column = np.divmod(rest, width)
    inside = np.ones(len(pixel), bool)
    around = np.zeros(len(pixel))
    for down, right in _STEPS:
        y, x = row + _CURVATURE_STEP * down, column + _CURVATURE_STEP * right
        within = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        at = (number, np.clip(y, 0, height - 1), np.clip(x, 0, width - 1))
        inside &= within & covered[at]
        around += page[at]
    if inside.sum() < _MIN_TEXELS:
        return False
    value = page[number, row, column]
    scale = np.maximum(np.maximum(truth, value), 0.1 * np.median(truth)) + 1e-12
    curvature = (np.clip(((around - value) / 4 - value) / scale, -0.5, 0.5))[inside]
    error = np.clip((value - truth) / scale, -0.5, 0.5)[inside]
    square = float((curvature**2).sum())
    if not square > 0:
        return False
    coefficient = float((curvature * error).sum()) / square
    spread = float(np.sqrt((curvature**2 * (error - coefficient * curvature) ** 2).sum())) / square
    return coefficient > _BLUR and coefficient > _Z * spread


def _misfits(
    page: NDArray[np.float64],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    truth: NDArray[np.float64],
    noise: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return squared errors (k, m) of the map shifted by `_STEPS`, in variances, and their means (k,).

    The noise of the reference is subtracted from the means. None if too few texels can be used.
    """
    height, width = page.shape[1:]
    number, rest = np.divmod(pixel, height * width)
    row, column = np.divmod(rest, width)
    inside = (row > 0) & (row < height - 1) & (column > 0) & (column < width - 1)
    for down, right in _STEPS:
        at = (number, np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1))
        inside &= covered[at]
    if inside.sum() < _MIN_TEXELS:
        return None
    number, row, column, truth = number[inside], row[inside], column[inside], truth[inside]
    scale = np.maximum(truth, 0.1 * np.median(truth)) + 1e-12
    found = [page[number, row + down, column + right] for down, right in _STEPS]
    own = np.zeros(len(truth)) if noise is None else (noise[inside] / scale) ** 2
    variance = own + _TOLERANCE**2
    error = np.array([np.minimum(((value - truth) / scale) ** 2 / variance, _CLIP) for value in found])
    return error, error.mean(axis=1) - (own / variance).mean()


def exponent(value: NDArray[np.float64], truth: NDArray[np.float64]) -> float | None:
    """Fit values by a power of the truth.

    Parameters
    ----------
    value : (n,) float64
        Colour means of the map.
    truth : (n,) float64
        Path-traced values.

    Returns
    -------
    float or None
        The exponent; 1 unless another one halves the mean residual. None if fewer than 32 texels can be used
        or the truth hardly varies.
    """
    # Leave dark texels out: small errors there are large ratios.
    lit = (value > 0) & (truth > 0.1 * np.median(truth))
    if lit.sum() < _MIN_TEXELS:
        return None
    x, y = np.log(truth[lit]), np.log(value[lit])
    if np.ptp(x) < 0.5:
        return None
    residual = []
    for power in _POWERS:
        rest = y - power * x
        residual.append(float(np.minimum(np.abs(rest - np.median(rest)), _MAX_RESIDUAL).mean()))
    best = int(np.argmin(residual))
    one = len(_POWERS) // 2
    return float(_POWERS[best]) if residual[best] < 0.5 * residual[one] else 1.0
