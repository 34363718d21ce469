"""Tells if a map was rounded to few levels, or cut off at some value."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.metrics.groups import Compared

# Levels that must be there before their spacing says anything, and texels for each of them.
_LEVELS, _EACH = 16, 8
# Distances between levels of a rounded map change little from one to the next (logarithm, usually); those of
# other maps are those of random numbers, whose usual change is 1.1.
_EVEN = 0.2
# A rounded map's levels are coarser than half floats by this factor.
_COARSE = 4.0
_HALF = 2.0**-10
# Texels at the very largest value that say that it was a limit.
_AT_TOP = 8


def few_levels(maps: NDArray[np.float32], covered: NDArray[np.bool_]) -> bool:
    """Tell if any colour of a map (P, H, W, C) holds few, evenly spaced levels where most of it lies."""
    return any(_rounded(maps[..., c][covered]) for c in range(maps.shape[3]))


def _rounded(value: NDArray[np.float32]) -> bool:
    low, high = np.percentile(value, (10, 90)) if len(value) else (0.0, 0.0)
    middle = value[(value >= low) & (value <= high)]
    level = np.unique(middle).astype(np.float64)
    if len(level) < _LEVELS or len(middle) < _EACH * len(level):
        return False
    gap = np.diff(level)
    coarse = float(np.median(gap / np.maximum(np.abs(level[1:]), 1e-30))) > _COARSE * _HALF
    return coarse and float(np.median(np.abs(np.diff(np.log(gap))))) < _EVEN


def cut_off(
    maps: NDArray[np.float32], covered: NDArray[np.bool_], places: Compared, pixel: NDArray[np.int64]
) -> float:
    """Return by what share the reference lies above texels that hold the map's largest value; 0 if few do."""
    worst = 0.0
    for c in range(maps.shape[3]):
        flat = maps[..., c].reshape(-1)
        top = float(flat[covered.reshape(-1)].max())
        at_top = flat[pixel] >= top
        if top > 0 and at_top.sum() >= _AT_TOP:
            worst = max(worst, float(places.reference[at_top, c].mean()) / top - 1.0)
    return worst
