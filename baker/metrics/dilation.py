"""Computes the share of dilated texels whose values differ strongly from their covered neighbours."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

# Values are means over colours. Let high and low be the largest and the smallest value of the covered
# neighbours. A dilated value is wrong if it is above `_FACTOR` high + s or below low / `_FACTOR` - s. s is
# `_SLACK` times the mean of the page's covered texels.
_FACTOR = 4.0
_SLACK = 0.02


def misfilled_share(
    maps: NDArray[np.float32], covered: NDArray[np.bool_], dilated: NDArray[np.bool_]
) -> float:
    """Return the share of wrong texels among the dilated texels that have a covered neighbour.

    A dilated texel is wrong if its value is far outside the range of its covered neighbours (3 x 3 texels).

    Parameters
    ----------
    maps : (P, H, W, C) float32
        Pages of a channel.
    covered : (P, H, W) bool
        Texels whose values were computed, not filled by dilation.
    dilated : (P, H, W) bool
        Texels filled by dilation.

    Returns
    -------
    float, 0 to 1
        0 if no dilated texel has a covered neighbour.
    """
    wrong = total = 0
    for page, on, beyond in zip(maps.mean(axis=3, dtype=np.float64), covered, dilated, strict=True):
        if not on.any():
            continue
        slack = _SLACK * float(page[on].mean())
        high = maximum_filter(np.where(on, page, -np.inf), 3)
        low = minimum_filter(np.where(on, page, np.inf), 3)
        near = beyond & np.isfinite(high)
        far = (page > _FACTOR * high + slack) | (page < low / _FACTOR - slack)
        wrong, total = wrong + int((far & near).sum()), total + int(near.sum())
    return wrong / max(total, 1)
