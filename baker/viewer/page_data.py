"""Lightmap pages as numbers that a browser uploads unchanged.

Halves stay halves, so that what the page shows of a texel is what the EXR holds, bit by bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def page_numbers(page: NDArray[np.float32]) -> NDArray[Any]:
    """Return a page as one or four numbers a texel, as halves if that loses nothing.

    Parameters
    ----------
    page : (H, W, C) float32, C is 1 to 4

    Returns
    -------
    (H, W, 1) or (H, W, 4) float16 or float32
        Channels that `page` lacks are 1 (graphics hardware has no three-number textures that all draw).
    """
    height, width, channels = page.shape
    wide = page
    if 1 < channels < 4:
        wide = np.ones((height, width, 4), np.float32)
        wide[:, :, :channels] = page
    with np.errstate(over="ignore"):
        half = wide.astype(np.float16)
    same = np.array_equal(half.astype(np.float32), wide, equal_nan=True)
    return np.ascontiguousarray(half if same else wide)
