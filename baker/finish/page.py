"""Checks the shapes of page arrays, and computes the largest values of charts, for all finishing stages."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.finish.kernels.page_charts import chart_maxima


def check_page(value: NDArray[np.float32], chart: NDArray[np.int32], **masks: NDArray[Any]) -> None:
    """Check that page arrays have matching shapes and types.

    Parameters
    ----------
    value : (H, W, C) float32
    chart : (H, W) int32, -1 for empty texels
    masks : (H, W) or (H, W, n) arrays by name

    Raises
    ------
    ValueError
        If a shape or type differs. This means a bug in the calling code, not a defect of the scene.
    """
    if value.ndim != 3 or value.dtype != np.float32:
        raise ValueError(f"value must be (H, W, C) float32, it is {value.shape} {value.dtype}")
    if chart.shape != value.shape[:2] or chart.dtype != np.int32:
        raise ValueError(f"chart must be {value.shape[:2]} int32, it is {chart.shape} {chart.dtype}")
    for name, mask in masks.items():
        if mask.shape[:2] != value.shape[:2]:
            raise ValueError(f"{name} must cover {value.shape[:2]} texels, it covers {mask.shape[:2]}")


def highest_of_charts(
    value: NDArray[np.float32], chart: NDArray[np.int32], covered: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return (n_charts, C) float32: the largest value of each chart's covered texels, -inf if there are none.

    value : (H, W, C) float32; chart : (H, W) int32; covered : (H, W) bool
    """
    highest = np.full((int(chart.max(initial=-1)) + 1, value.shape[2]), -np.inf, np.float32)
    chart_maxima(value, chart, covered, highest)
    return highest
