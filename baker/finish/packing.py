"""Packs chosen charts of a page on a smaller page, so that a filter processes few texels of other charts."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.finish.kernels.page_charts import chart_boxes

# Number of empty texels between packed charts. The denoiser fills them by reflection.
_GAP = 8


@dataclass(frozen=True)
class PackedCharts:
    """Positions of n chosen texels on a page of shape (H, W) and on a smaller page of shape (h, w).

    Attributes
    ----------
    source : (n,) int64
        Row * W + column of each texel on the page.
    target : (n,) int64
        Row * w + column of each texel on the smaller page.
    shape : (int, int)
        (h, w).
    """

    source: NDArray[np.int64]
    target: NDArray[np.int64]
    shape: tuple[int, int]

    def take(self, page: NDArray[Any], fill: float = 0) -> NDArray[Any]:
        """Copy the chosen texels of a page (H, W, ...) to a new page (h, w, ...), with `fill` elsewhere."""
        rest = page.shape[2:]
        packed = np.full((self.shape[0] * self.shape[1], *rest), fill, page.dtype)
        packed[self.target] = page.reshape(-1, *rest)[self.source]
        return packed.reshape(*self.shape, *rest)

    def put(self, packed: NDArray[Any], page: NDArray[Any]) -> None:
        """Copy the texels of the smaller page (h, w, ...) to the chosen texels of `page` (H, W, ...)."""
        rest = page.shape[2:]
        page.reshape(-1, *rest)[self.source] = packed.reshape(-1, *rest)[self.target]


def pack_charts(chart: NDArray[np.int32], chosen: NDArray[np.bool_]) -> PackedCharts:
    """Pack the bounding boxes of the chosen texels of each chart in rows, in order of decreasing height.

    Parameters
    ----------
    chart : (H, W) int32
        Index of the chart of each texel.
    chosen : (H, W) bool
        Texels to pack. All chosen texels of a chart are moved by the same offset.
    """
    n = int(chart.max()) + 1
    low, high = np.full((n, 2), max(chart.shape), np.int64), np.full((n, 2), -1, np.int64)
    chart_boxes(chart, chosen, low, high)
    size = np.where(high >= 0, high - low + 1 + _GAP, 0)
    width = max(int(np.sqrt(1.2 * size.prod(axis=1).sum())), int(size[:, 1].max()))
    corner = np.zeros((n, 2), np.int64)
    x = y = shelf = 0
    for k in np.argsort(-size[:, 0], kind="stable")[: np.count_nonzero(size[:, 0])]:
        if x + size[k, 1] > width:
            x, y, shelf = 0, y + shelf, 0
        corner[k] = y, x
        x, shelf = x + int(size[k, 1]), max(shelf, int(size[k, 0]))
    source = np.flatnonzero(chosen)
    row, column = np.divmod(source, chart.shape[1])
    shift = (corner - low)[chart.reshape(-1)[source]]
    target = (row + shift[:, 0]) * width + column + shift[:, 1]
    return PackedCharts(source, target, (y + shelf, width))
