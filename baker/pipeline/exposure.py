"""Computes the exposure that `bake.json` and the exports suggest for showing a bake on a display."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import LUMINANCE_WEIGHTS

# Display level, linear, 1 = white, at which the median of the lit texels is shown: mid grey. With a higher
# quantile, rooms would be too dark, because many texels may be on outer walls in the sun.
LEVEL = 0.18
# Number of significant digits of the result, and its upper limit, which a 32-bit float can represent.
_DIGITS = 4
_LARGEST = 1e30
# Number of texels that are processed at a time, to limit memory.
_BLOCK = 1 << 20


def suggested_exposure(
    irradiance: NDArray[np.float32], pixel: NDArray[np.int64], albedo: NDArray[np.floating]
) -> float:
    """Return the factor on radiance (cd/m2) with which the median of the lit texels is mid grey.

    The radiance of a texel is the luminance of albedo x E / pi. A texel is lit if its radiance is above 0.

    Parameters
    ----------
    irradiance : (P, H, W, 3) float32, lx
        Finished pages.
    pixel : (n,) int64
        Valid texels, (page * H + row) * W + column.
    albedo : (n, 3) floating
        Albedo of these texels, linear Rec.709.

    Returns
    -------
    float
        `LEVEL` divided by the median of the radiance, rounded to four significant digits; 1 if no texel is
        lit.
    """
    flat = irradiance.reshape(-1, 3)
    weights = np.array(LUMINANCE_WEIGHTS, np.float32) / np.float32(math.pi)
    radiance = np.zeros(len(pixel), np.float32)
    for start in range(0, len(pixel), _BLOCK):
        block = slice(start, start + _BLOCK)
        # A sum in a fixed order instead of a matrix product, whose last bits depend on the library.
        red, green, blue = (flat[pixel[block]] * albedo[block] * weights).T
        radiance[block] = red + green + blue
    lit = radiance[radiance > 0.0]
    if not lit.size:
        return 1.0
    return min(float(f"{LEVEL / float(np.median(lit)):.{_DIGITS}g}"), _LARGEST)
