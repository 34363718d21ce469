"""Sorts points along one axis, so that the points in a box are found without a test of all points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class SortedPoints:
    """N points, each with the number of its owner, sorted along the axis of their largest extent.

    A query for a box tests only the points whose coordinate on this axis is in the range of the box.

    Parameters
    ----------
    position : (N, 3) float64
    owner : (N,) int64
        A number for each point, such as the node of its object.
    """

    def __init__(self, position: NDArray[np.float64], owner: NDArray[np.int64]) -> None:
        self.axis = int(np.ptp(position, axis=0).argmax()) if len(position) else 0
        order = np.argsort(position[:, self.axis], kind="stable")
        self.position, self.owner = position[order], owner[order]
        self._along = np.ascontiguousarray(self.position[:, self.axis])

    def within(
        self, low: NDArray[np.float64], high: NDArray[np.float64], without: int
    ) -> NDArray[np.float64]:
        """Return the points in a box whose owner is not `without`.

        Parameters
        ----------
        low, high : (3,) float64
            Lowest and highest corner of the box. Points on its border are inside.
        without : int
            Owner of the points that are left out.

        Returns
        -------
        (n, 3) float64
            The points.
        """
        begin = int(np.searchsorted(self._along, low[self.axis], "left"))
        end = int(np.searchsorted(self._along, high[self.axis], "right"))
        near = self.position[begin:end]
        inside = ((near >= low) & (near <= high)).all(axis=1) & (self.owner[begin:end] != without)
        found: NDArray[np.float64] = near[inside]
        return found
