"""Tells if a map is shifted or turned against its surface, blurred, or bent by a curve.

A map that fits better one texel further is shifted, however small its error is in smooth places. A map whose
values follow a power of the truth other than 1 went through a gamma curve.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_STEPS = [(0, 0), (0, 1), (0, -1), (1, 0), (-1, 0)]
# Texels over which curvature is measured; its share of the error that says blur.
_WIDE, _BLUR = 2, 0.2
# A shifted map must fit this much better before it is believed, and so many texels must tell.
_BETTER = 0.9
# By so many standard errors, too.
_SURE = 4.0
_ENOUGH = 32
# What a sound map may be off, relative; errors are told in this and the noise of the truth, their squares up
# to a limit: a few texels of large error must not decide, nor those of large noise.
_OFF, _CLIP = 0.03, 9.0
# Powers that are tried, 1 in the middle; a texel further from all is no further than this (log scale).
_POWERS = np.exp(np.linspace(-1.2, 1.2, 241))
_FAR = 0.1


def best_shift(
    page: NDArray[np.float64],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    truth: NDArray[np.float64],
    noise: NDArray[np.float64] | None = None,
    better: float = _BETTER,
) -> tuple[int, int]:
    """Return the shift (rows, columns) by which the map would fit the truth better, (0, 0) if none does.

    Parameters
    ----------
    page : (P, H, W) float64, colour means of the map
    covered : (P, H, W) bool
        Only texels whose four neighbours are covered, too, take part.
    pixel : (n,) int64, texels judged
    truth : (n,) float64, their path-traced values
    noise : (n,) float64, optional
        Standard errors of these: what they add to the misfit says nothing about a shift.
    better : float
        A shifted map is believed if its misfit is less than this share of what it is without.
    """
    misfit = _misfits(page, covered, pixel, truth, noise)
    if misfit is None:
        return 0, 0
    error, excess = misfit
    best = int(np.argmin(excess))
    gain = error[0] - error[best]
    # Where a map is even every shift fits alike but for noise.
    sure = gain.mean() > _SURE * gain.std() / np.sqrt(len(gain))
    return _STEPS[best] if excess[best] < better * excess[0] and sure else (0, 0)


def is_blurred(
    page: NDArray[np.float64],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    truth: NDArray[np.float64],
) -> bool:
    """Tell whether the map's error follows its curvature, as a blur's does; parameters of `best_shift`.

    A Gaussian blur of s texels adds s^2 / 2 times the Laplacian; noise of the map makes the slope negative.
    """
    height, width = page.shape[1:]
    number, rest = np.divmod(pixel, height * width)
    row, column = np.divmod(rest, width)
    inside = np.ones(len(pixel), bool)
    around = np.zeros(len(pixel))
    for down, right in _STEPS:
        y, x = row + _WIDE * down, column + _WIDE * right
        within = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        at = (number, np.clip(y, 0, height - 1), np.clip(x, 0, width - 1))
        inside &= within & covered[at]
        around += page[at]
    if inside.sum() < _ENOUGH:
        return False
    value = page[number, row, column]
    scale = np.maximum(np.maximum(truth, value), 0.1 * np.median(truth)) + 1e-12
    curvature = (np.clip(((around - value) / 4 - value) / scale, -0.5, 0.5))[inside]
    error = np.clip((value - truth) / scale, -0.5, 0.5)[inside]
    square = float((curvature**2).sum())
    if not square > 0:
        return False
    slope = float((curvature * error).sum()) / square
    spread = float(np.sqrt((curvature**2 * (error - slope * curvature) ** 2).sum())) / square
    return slope > _BLUR and slope > _SURE * spread


def _misfits(
    page: NDArray[np.float64],
    covered: NDArray[np.bool_],
    pixel: NDArray[np.int64],
    truth: NDArray[np.float64],
    noise: NDArray[np.float64] | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
    """Return squared errors (k, m) of the map shifted by each of `_STEPS`, in variances, and their means.

    From the means (k,) the reference's noise is taken off. None if too few texels tell.
    """
    height, width = page.shape[1:]
    number, rest = np.divmod(pixel, height * width)
    row, column = np.divmod(rest, width)
    inside = (row > 0) & (row < height - 1) & (column > 0) & (column < width - 1)
    for down, right in _STEPS:
        at = (number, np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1))
        inside &= covered[at]
    if inside.sum() < _ENOUGH:
        return None
    number, row, column, truth = number[inside], row[inside], column[inside], truth[inside]
    scale = np.maximum(truth, 0.1 * np.median(truth)) + 1e-12
    found = [page[number, row + down, column + right] for down, right in _STEPS]
    own = np.zeros(len(truth)) if noise is None else (noise[inside] / scale) ** 2
    variance = own + _OFF**2
    error = np.array([np.minimum(((value - truth) / scale) ** 2 / variance, _CLIP) for value in found])
    return error, error.mean(axis=1) - (own / variance).mean()


def exponent(value: NDArray[np.float64], truth: NDArray[np.float64]) -> float | None:
    """Return the power of the truth that values follow, 1 if they are true; None if too few texels tell.

    Another power than 1 is believed if values lie nearer to it by half: a few wrong texels say nothing.
    """
    # In the dark small errors are large ratios.
    lit = (value > 0) & (truth > 0.1 * np.median(truth))
    if lit.sum() < _ENOUGH:
        return None
    x, y = np.log(truth[lit]), np.log(value[lit])
    if np.ptp(x) < 0.5:
        return None
    left = []
    for power in _POWERS:
        rest = y - power * x
        left.append(float(np.minimum(np.abs(rest - np.median(rest)), _FAR).mean()))
    best = int(np.argmin(left))
    true = len(_POWERS) // 2
    return float(_POWERS[best]) if left[best] < 0.5 * left[true] else 1.0
