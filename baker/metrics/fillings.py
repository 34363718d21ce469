"""Tells if the texels beyond the borders of charts hold light like that at the borders."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

# A filled texel may go beyond its covered neighbours by this factor, and by this share of the map's mean.
_FACTOR, _SLACK = 4.0, 0.02


def misfilled_share(
    maps: NDArray[np.float32], covered: NDArray[np.bool_], filled: NDArray[np.bool_]
) -> float:
    """Return the share of filled texels next to covered ones that hold far more or less than all of these.

    Parameters
    ----------
    maps : (P, H, W, C) float32
    covered, filled : (P, H, W) bool
    """
    wrong = total = 0
    for page, on, beyond in zip(maps.mean(axis=3, dtype=np.float64), covered, filled, strict=True):
        if not on.any():
            continue
        slack = _SLACK * float(page[on].mean())
        high = maximum_filter(np.where(on, page, -np.inf), 3)
        low = minimum_filter(np.where(on, page, np.inf), 3)
        near = beyond & np.isfinite(high)
        far = (page > _FACTOR * high + slack) | (page < low / _FACTOR - slack)
        wrong, total = wrong + int((far & near).sum()), total + int(near.sum())
    return wrong / max(total, 1)
