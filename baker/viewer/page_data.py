"""Converts lightmap pages to arrays that the browser uploads to the GPU unchanged.

Values from a half-float EXR are sent as half floats, which need half the memory and are exact.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def page_numbers(page: NDArray[np.float32]) -> NDArray[Any]:
    """Return a page with one or four components per texel, as half floats if these store all values exactly.

    Parameters
    ----------
    page : (H, W, C) float32, C is 1 to 4

    Returns
    -------
    (H, W, 1) or (H, W, 4) float16 or float32
        Pages with two or three components get four components, because not all graphics hardware supports
        three-component float textures. Added components are 1.
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
