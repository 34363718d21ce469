"""Whether points lie inside a closed surface.

    winding number = sum of the solid angles of all faces / (4 pi)

Based on: Van Oosterom and Strackee, The solid angle of a plane triangle, 1983; Jacobson et al., Robust
inside-outside segmentation using generalized winding numbers, 2013.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def winding_number(corner: NDArray[np.float64], point: NDArray[np.float64]) -> float:
    """Return how often a surface goes round a point: 1 inside, 0 outside, -1 inside one that looks inwards.

    Parameters
    ----------
    corner : (F, 3, 3) float64
    point : (3,) float64
    """
    a, b, c = (corner[:, k] - point for k in range(3))
    la, lb, lc = (np.sqrt(np.einsum("fx,fx->f", v, v)) for v in (a, b, c))
    triple = np.einsum("fx,fx->f", a, np.cross(b, c))
    below = la * lb * lc
    below += np.einsum("fx,fx->f", a, b) * lc
    below += np.einsum("fx,fx->f", b, c) * la
    below += np.einsum("fx,fx->f", c, a) * lb
    return float(2.0 * np.arctan2(triple, below).sum() / (4.0 * np.pi))


def first_inside(corner: NDArray[np.float64], points: NDArray[np.float64]) -> int | None:
    """Return the number of the first of (N, 3) points that is inside a closed surface, or None."""
    if not len(corner):
        return None
    low, high = corner.min(axis=(0, 1)), corner.max(axis=(0, 1))
    for k in np.flatnonzero(((points > low) & (points < high)).all(axis=1)):
        if abs(winding_number(corner, points[k])) > 0.5:
            return int(k)
    return None
