"""Slivers: triangles far longer than high."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Height over longest side. A face as long as 50 texels of its lightmap is then less than one texel high, so
# that no texel lies in it alone; its smallest angle is under 2.3 degrees (tan = 2 x 0.02). `baker check`
# reports these faces, and `--repair` remeshes a mesh if a tenth of its faces are such: one limit for both, so
# that nothing is remeshed that the check does not report.
SLIVER = 0.02


def find_slivers(corner: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which triangles are less than `SLIVER` times as high as long.

    Parameters
    ----------
    corner : (T, 3, 3) float64
        Positions of the three corners, any unit.

    Returns
    -------
    (T,) bool
        False for triangles without length, which have no shape.
    """
    a, b, c = corner[:, 0], corner[:, 1], corner[:, 2]
    longest = np.max([np.linalg.norm(side, axis=1) for side in (b - a, c - b, a - c)], axis=0)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(longest, 1e-300)
    return np.asarray(height < SLIVER * longest)
