"""Tests whether points lie inside a closed surface.

    winding number = sum of the solid angles of all faces / (4 pi)

Based on: Van Oosterom and Strackee, The solid angle of a plane triangle, 1983; Jacobson et al., Robust
inside-outside segmentation using generalized winding numbers, 2013.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Limit of the number of faces of a surface. Above this limit, `Enclosure` does not sum solid angles, because
# this would take too long.
MANY = 4096
# An approximate rotation matrix. `Enclosure` casts lines along its third row, which is parallel to no
# direction that is usual in models, so that lines rarely hit edges and vertices.
_TURN = np.array(
    [
        [0.6363961031, 0.7071067812, 0.3082207001],
        [-0.7506937524, 0.4821762049, 0.4516937524],
        [0.1707805518, -0.5188374523, 0.8376339127],
    ]
)


def winding_number(corner: NDArray[np.float64], point: NDArray[np.float64]) -> float:
    """Return the winding number of a surface about a point.

    It is 0 outside a closed surface, 1 inside, and -1 inside if the faces are wound inwards.

    Parameters
    ----------
    corner : (F, 3, 3) float64, metres
        Corners of the faces.
    point : (3,) float64, metres
        The point.

    Returns
    -------
    float
        Sum of the solid angles of all faces / (4 pi).
    """
    a, b, c = (corner[:, k] - point for k in range(3))
    la, lb, lc = (np.sqrt(np.einsum("fx,fx->f", v, v)) for v in (a, b, c))
    triple = np.einsum("fx,fx->f", a, np.cross(b, c))
    below = la * lb * lc
    below += np.einsum("fx,fx->f", a, b) * lc
    below += np.einsum("fx,fx->f", b, c) * la
    below += np.einsum("fx,fx->f", c, a) * lb
    return float(2.0 * np.arctan2(triple, below).sum() / (4.0 * np.pi))


class Enclosure:
    """A closed surface, prepared for winding numbers about many points.

    If the surface has more than `MANY` faces, the winding number is computed from the faces that a half line
    from the point crosses. This takes less time than summing solid angles, but is not reliable for points on
    the surface or near large holes.

    Parameters
    ----------
    corner : (F, 3, 3) float64, metres
        Corners of the faces.
    """

    def __init__(self, corner: NDArray[np.float64]) -> None:
        self.corner = corner
        self.many = len(corner) > MANY
        if self.many:
            self._turned = corner @ _TURN.T
            low, high = self._turned.min(axis=1), self._turned.max(axis=1)
            self._bounds = tuple(
                np.ascontiguousarray(a) for a in (low[:, 0], high[:, 0], low[:, 1], high[:, 1])
            )

    def winding(self, point: NDArray[np.float64]) -> float:
        """Return the winding number of the surface about a point (3,) float64, metres."""
        if not self.many:
            return winding_number(self.corner, point)
        x, y, z = _TURN @ point
        west, east, south, north = self._bounds
        near = np.flatnonzero((west <= x) & (east >= x) & (south <= y) & (north >= y))
        offset = self._turned[near] - [x, y, z]
        a, b, c = (offset[:, k] for k in range(3))
        share = np.stack([_cross(b, c), _cross(c, a), _cross(a, b)], axis=1)
        whole = share.sum(axis=1)
        hit = ((share > 0).all(axis=1) | (share < 0).all(axis=1)) & (whole != 0)
        height = np.einsum("fk,fk->f", share[hit], offset[hit, :, 2]) / whole[hit]
        return float(np.sign(whole[hit][height > 0]).sum())


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the z component (n,) of the cross products of vectors a and b (n, 2 or more)."""
    found: NDArray[np.float64] = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    return found


def first_inside(corner: NDArray[np.float64], points: NDArray[np.float64]) -> int | None:
    """Return the index of the first point that is inside a closed surface.

    Parameters
    ----------
    corner : (F, 3, 3) float64, metres
        Corners of the faces.
    points : (N, 3) float64, metres
        Points to test.

    Returns
    -------
    int or None
        Index of the point; None if no point is inside.
    """
    if not len(corner):
        return None
    low, high = corner.min(axis=(0, 1)), corner.max(axis=(0, 1))
    for k in np.flatnonzero(((points > low) & (points < high)).all(axis=1)):
        if abs(winding_number(corner, points[k])) > 0.5:
            return int(k)
    return None
