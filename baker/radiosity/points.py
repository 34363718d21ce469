"""Points of texels for the ray kernels, made tile by tile so that memory stays small."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.kernels.surface import N_POINTS, Surface, place_points

_NOWHERE, _NO_BARY = np.zeros((0, 1), np.int32), np.zeros((0, 1, 2), np.float32)
_EVERY = np.arange(N_POINTS, dtype=np.uint8)[None]


def points_of(
    surface: Surface, mask: NDArray[np.uint16], chosen: NDArray[np.int64], wanted: NDArray[np.uint8] = _EVERY
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return ray origins and shading normals (m, w, 3) float32, world, of points of texel entries.

    Parameters
    ----------
    mask : (n,) uint16
        Bit k is set where point k of a texel is not buried; buried points are replaced by free ones.
    chosen : (m,) int64
        Texel entries.
    wanted : (m or 1, w) uint8
        Which of a texel's 16 points; all by default.
    """
    shape = (len(chosen), wanted.shape[1])
    origin, normal = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    place_points(surface, mask, chosen, wanted, origin, normal, _NOWHERE, _NO_BARY)
    return origin, normal
