"""Lightmap pages as numbers that a browser uploads unchanged.

Half floats stay half floats, so that the values in the page are those of the EXR, bit by bit.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def page_numbers(page: NDArray[np.float32]) -> NDArray[Any]:
    """Return a page with one or four components per texel, as half floats if they are exact.

    Parameters
    ----------
    page : (H, W, C) float32, C is 1 to 4

    Returns
    -------
    (H, W, 1) or (H, W, 4) float16 or float32
        Added components are 1: not all graphics hardware can draw from three-component float textures.
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
