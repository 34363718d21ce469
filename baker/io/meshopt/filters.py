"""Applies the filters of meshopt to decoded elements.

All operations are in float32 and in the order of the SIMD decoder of meshoptimizer, so that the results are
equal bit by bit. Values that the specification leaves undefined give any value, without warnings.

Based on: Khronos Group, KHR_meshopt_compression, appendix B; meshoptimizer 1.3.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Adding this number rounds a float32 to an integer, which is then in the lowest bits of the sum.
_ROUND = np.float32(3 << 22)
_QUATERNION = np.float32(32767.0) / np.sqrt(np.float32(2.0))


def _octahedral(data: NDArray[np.uint8], stride: int) -> None:
    """Replace the octahedral coordinates of unit vectors by x, y and z; the fourth component is kept."""
    element = data.view(np.int8 if stride == 4 else np.int16).reshape(-1, 4)
    x, y, one = (element[:, k].astype(np.float32) for k in range(3))
    z = one - (np.abs(x) + np.abs(y))
    t = np.minimum(z, np.float32(0.0))
    x += np.copysign(np.float32(1.0), x) * t
    y += np.copysign(np.float32(1.0), y) * t
    scale = np.float32(127 if stride == 4 else 32767) / np.sqrt(x * x + (y * y + z * z))
    for k, value in enumerate((x, y, z)):
        element[:, k] = _rounded(value * scale)


def _quaternion(data: NDArray[np.uint8], stride: int) -> None:
    """Compute the largest component of unit quaternions from the others, and put all in their places."""
    element = data.view(np.int16).reshape(-1, 4)
    last = element[:, 3].astype(np.int32)
    # `one` is the stored value of 1 / sqrt(2). Therefore x^2 + y^2 + z^2 + w^2 = 2 one^2.
    one = (last | 3).astype(np.float32)
    x, y, z = (element[:, k].astype(np.float32) for k in range(3))
    w = np.sqrt(np.maximum(one * (one + one) - (x * x + (y * y + z * z)), np.float32(0.0)))
    scale = _QUATERNION / one
    rounded = np.stack([_rounded(part * scale) for part in (w, x, y, z)], axis=1)
    source = (np.arange(4) - (last[:, None] & 3)) % 4
    element[:] = np.take_along_axis(rounded, source, axis=1)


def _exponential(data: NDArray[np.uint8], stride: int) -> None:
    """Replace integers of 8 bits of exponent and 24 bits of mantissa by floats."""
    word = data.view(np.int32)
    exponent = ((word >> 24) + 127) << 23
    data.view(np.float32)[:] = exponent.view(np.float32) * ((word << 8) >> 8).astype(np.float32)


def _colour(data: NDArray[np.uint8], stride: int) -> None:
    """Replace luma, two chroma components and alpha by red, green, blue and alpha."""
    element = data.view(np.uint8 if stride == 4 else np.uint16).reshape(-1, 4)
    signed = element.view(np.int8 if stride == 4 else np.int16)
    y, alpha = element[:, 0].astype(np.int32), element[:, 3].astype(np.int32)
    orange, green = signed[:, 1].astype(np.int32), signed[:, 2].astype(np.int32)
    # Set all bits below the highest set bit of alpha, which marks the number of bits of the components.
    full = alpha.copy()
    for shift in (1, 2, 4, 8):
        full |= full >> shift
    scale = np.float32(255 if stride == 4 else 65535) / full.astype(np.float32)
    alpha = ((alpha << 1) & full) | (alpha & 1)
    for k, value in enumerate((y + (orange - green), y + green, y - (orange + green), alpha)):
        element[:, k] = _rounded(value.astype(np.float32) * scale)


def _rounded(value: NDArray[np.float32]) -> NDArray[Any]:
    """Return the nearest integer, as int16 that wraps around."""
    return (value + _ROUND).view(np.int32).astype(np.int16)


# Names of the filters, with the sizes of an element in bytes that they accept; () accepts all.
FILTERS: dict[str, tuple[Callable[[NDArray[np.uint8], int], None], tuple[int, ...]]] = {
    "OCTAHEDRAL": (_octahedral, (4, 8)),
    "QUATERNION": (_quaternion, (8,)),
    "EXPONENTIAL": (_exponential, ()),
    "COLOR": (_colour, (4, 8)),
}


def apply_filter(name: str, data: NDArray[np.uint8], stride: int) -> None:
    """Apply a filter to decoded elements, in place.

    Parameters
    ----------
    name : str
        A name in `FILTERS`.
    data : (count x stride,) uint8
        The elements; aligned to four bytes.
    stride : int
        Bytes of an element, one of the sizes that the filter accepts.
    """
    with np.errstate(all="ignore"):
        FILTERS[name][0](data, stride)
