"""Detects maps whose values were quantised to few levels, or clamped at a maximum."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.metrics.groups import ComparedPoints

# Smallest number of distinct levels, and of texels per level, for which a map is tested.
_MIN_LEVELS, _TEXELS_PER_LEVEL = 16, 8
# Limit of the median of |log(d2 / d1)|, where d1 and d2 are successive differences of sorted levels. Below
# this limit, the levels count as evenly spaced. For random values the median is about 1.1.
_EVEN = 0.2
# Quantised levels are spaced more coarsely than half floats by at least this factor.
_COARSE = 4.0
# Largest relative spacing of half floats.
_HALF_SPACING = 2.0**-10
# Smallest number of texels at exactly the largest value that indicates clamping.
_MIN_CLAMPED = 8


def few_levels(maps: NDArray[np.float32], covered: NDArray[np.bool_]) -> bool:
    """Return whether any component of a map has few, evenly spaced levels.

    Values between the quantiles 10 % and 90 % are tested.

    Parameters
    ----------
    maps : (P, H, W, C) float32
        Pages of a channel.
    covered : (P, H, W) bool
        Texels whose values were computed, not filled by dilation.

    Returns
    -------
    bool
        True if the map was quantised.
    """
    return any(_quantised(maps[..., c][covered]) for c in range(maps.shape[3]))


def _quantised(value: NDArray[np.float32]) -> bool:
    low, high = np.percentile(value, (10, 90)) if len(value) else (0.0, 0.0)
    middle = value[(value >= low) & (value <= high)]
    level = np.unique(middle).astype(np.float64)
    if len(level) < _MIN_LEVELS or len(middle) < _TEXELS_PER_LEVEL * len(level):
        return False
    gap = np.diff(level)
    coarse = float(np.median(gap / np.maximum(np.abs(level[1:]), 1e-30))) > _COARSE * _HALF_SPACING
    return coarse and float(np.median(np.abs(np.diff(np.log(gap))))) < _EVEN


def cut_off(
    maps: NDArray[np.float32],
    covered: NDArray[np.bool_],
    compared: ComparedPoints,
    pixel: NDArray[np.int64],
) -> float:
    """Return the relative excess of the reference over the map's largest value.

    The reference is averaged over the texels at which the map has its largest value.

    Parameters
    ----------
    maps : (P, H, W, C) float32
        Pages of a channel.
    covered : (P, H, W) bool
        Texels whose values were computed, not filled by dilation.
    compared : ComparedPoints
        Reference values of n compared texels.
    pixel : (n,) int64
        (page * H + row) * W + column of the compared texels.

    Returns
    -------
    float
        Mean reference / largest value - 1, the maximum over components, at least 0. Components whose largest
        value occurs at fewer than eight compared texels are skipped.
    """
    worst = 0.0
    for c in range(maps.shape[3]):
        flat = maps[..., c].reshape(-1)
        top = float(flat[covered.reshape(-1)].max())
        at_top = flat[pixel] >= top
        if top > 0 and at_top.sum() >= _MIN_CLAMPED:
            worst = max(worst, float(compared.reference[at_top, c].mean()) / top - 1.0)
    return worst
