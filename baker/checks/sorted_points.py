"""Points sorted along one axis, to find those in a box without a test of all points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


class SortedPoints:
    """Points with an owner each, sorted along the axis of their largest extent.

    A query reads only the points in the range of the box on that axis.

    Parameters
    ----------
    position : (N, 3) float64
    owner : (N,) int64
        A number for each point, such as the object or part that it belongs to.
    """

    def __init__(self, position: NDArray[np.float64], owner: NDArray[np.int64]) -> None:
        self.axis = int(np.ptp(position, axis=0).argmax()) if len(position) else 0
        order = np.argsort(position[:, self.axis], kind="stable")
        self.position, self.owner = position[order], owner[order]
        self._along = np.ascontiguousarray(self.position[:, self.axis])

    def within(
        self, low: NDArray[np.float64], high: NDArray[np.float64], without: int
    ) -> NDArray[np.float64]:
        """Return the points in a box that have another owner than `without`.

        Parameters
        ----------
        low, high : (3,) float64
            Corners of the box, which belong to it.
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
