"""Finds slivers: triangles whose height is far smaller than their longest side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Limit of the height of a triangle divided by its longest side. Below this limit, the triangle is a sliver. A
# sliver up to 50 texels long is less than one texel high, so no texel lies completely inside the sliver. The
# smallest angle of a sliver is under 2.3 degrees (tan = 2 x 0.02). `baker check` reports slivers, and
# `--repair` remeshes a mesh if a tenth of its faces are slivers. Both use this limit, so that only meshes
# that the check reports are remeshed.
SLIVER = 0.02


def find_slivers(corner: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which triangles have a height below `SLIVER` times their longest side.

    Parameters
    ----------
    corner : (T, 3, 3) float64
        Positions of the three corners of each triangle, in any unit.

    Returns
    -------
    (T,) bool
        True for slivers. False for triangles whose three corners are equal.
    """
    a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
    longest = np.max([np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c)], axis=0)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(longest, 1e-300)
    return np.asarray(height < SLIVER * longest)
