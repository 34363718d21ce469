"""Converts sRGB to linear Rec.709, the colour space of all colours in baker.

Based on: IEC 61966-2-1 (the sRGB curve).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Weights of red, green and blue in the luminance of a linear Rec. 709 colour (ITU-R BT.709, item 3.2).
LUMINANCE_WEIGHTS = (0.2126, 0.7152, 0.0722)


def linear_from_srgb(value: NDArray[Any]) -> NDArray[np.float32]:
    """Decode sRGB values.

    Parameters
    ----------
    value : array of any shape, 0 to 1
        sRGB-encoded values.

    Returns
    -------
    array of the same shape, float32, 0 to 1
        Linear Rec.709 values.
    """
    value = np.asarray(value, np.float64)
    high = ((np.maximum(value, 0.0) + 0.055) / 1.055) ** 2.4
    return np.where(value <= 0.04045, value / 12.92, high).astype(np.float32)
