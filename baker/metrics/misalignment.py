"""Detects maps that are shifted against their surface, blurred, or changed by a gamma curve.

A map is shifted if moving it by one texel makes its difference from the reference significantly smaller. The
error metrics of such a map may be small, because the error is small in smooth areas. A gamma curve was
applied to a map if its values are a power of the reference with an exponent other than 1.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Shifts that are tested, (rows, columns).
_STEPS = [(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)]
# Distance between the samples from which curvature is computed, texels.
_CURVATURE_STEP = 2
# Coefficient of the regression of error on curvature above which a map is blurred.
_BLUR = 0.2
# A shift is detected if it multiplies the misfit by less than this factor.
_BETTER = 0.9
# Number of standard errors that a difference must exceed to be significant.
_Z = 4.0
# Number of usable texels below which no decision is made.
_MIN_TEXELS = 32
# Relative error of a correct map, and upper limit of a texel's misfit. The misfit of a texel is its squared
# relative error, divided by `_TOLERANCE`^2 + s^2. s is the relative standard error of the reference.
# Misfits are clipped at `_CLIP`, so that a few texels with large errors do not dominate.
_TOLERANCE, _CLIP = 0.03, 9.0
# Exponents that are tested, from 0.30 to 3.3; the middle one is 1.
_POWERS = np.exp(np.linspace(-1.2, 1.2, 241))
# Largest residual of a texel, as a difference of natural logarithms. Larger residuals are clipped to it.
_MAX_RESIDUAL = 0.1


def best_shift(
    page: NDArray[np.float64],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    truth: NDArray[np.float64],
    noise: NDArray[np.float64] | None = None,
    better: float = _BETTER,
) -> tuple[int, int]:
    """Return the shift by one texel with which the map fits the reference better than without a shift.

    Parameters
    ----------
    page : (P, H, W) float64
        Colour means of the map.
    covered : (P, H, W) bool
        Texels whose values were computed, not filled by dilation. Only texels whose four neighbours are
        covered are used.
    pixel : (n,) int64
        (page * H + row) * W + column of the compared texels.
    truth : (n,) float64
        Path-traced values of these texels.
    noise : (n,) float64, optional
        Standard errors of the path-traced values. Their contribution to the misfit is subtracted.
    better : float
        A shift is detected if it multiplies the misfit by less than this factor.

    Returns
    -------
    rows, columns : int
        Row and column of the texel that fits, relative to the compared texel. (0, 0) if no shift fits better
        or if fewer than 32 texels can be used.
    """
    misfit = _misfits(page, covered, pixel, truth, noise)
    if misfit is None:
        return 0, 0
    error, excess = misfit
    best = int(np.argmin(excess))
    gain = error[0] - error[best]
    # Require a significant gain, because in a constant map the misfits of all shifts differ only by noise.
    significant = gain.mean() > _Z * gain.std() / np.sqrt(len(gain))
    return _STEPS[best] if excess[best] < better * excess[0] and significant else (0, 0)


def is_blurred(
    page: NDArray[np.float64],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    truth: NDArray[np.float64],
) -> bool:
    """Return whether the map is blurred.

    A Gaussian blur with standard deviation s texels adds s^2 / 2 times the Laplacian to a map. The error of a
    blurred map is therefore proportional to its curvature, with a positive coefficient. Noise of the map
    makes the coefficient negative.

    Parameters
    ----------
    page : (P, H, W) float64
        Colour means of the map.
    covered : (P, H, W) bool
        Texels whose values were computed, not filled by dilation.
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
    """Return the normalised squared errors of the map after each of the k shifts `_STEPS`.

    The first result is (k, m), for m usable texels. The second is the mean over texels (k,), from which the
    contribution of the reference's noise is subtracted. None if too few texels are usable.
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
    """Fit a power of the reference to the values of a map, and return the exponent.

    Parameters
    ----------
    value : (n,) float64
        Colour means of the map.
    truth : (n,) float64
        Path-traced values.

    Returns
    -------
    float or None
        The best exponent if its mean residual is less than half that of exponent 1, otherwise 1. None if
        fewer than 32 texels can be used or the reference hardly varies.
    """
    # Leave dark texels out, because small errors there are large ratios.
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
