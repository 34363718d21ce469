"""Fills buried texels from the valid ones of their own chart.

A texel inside other geometry sees only back faces; its own value means nothing, yet bilinear lookups of the
visible surface beside it read it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.finish.page import check_page
from baker.kernels.page_fill import grow_rings


def fill_invalid(
    value: NDArray[np.float32], chart: NDArray[np.int32], valid: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], int]:
    """Replace covered but invalid texels by values grown from their chart's valid texels.

    Grown ring by ring, nearest first: the two sides of a buried strip keep their own light, where a smooth
    membrane between them would carry light from one room into the next.

    Parameters
    ----------
    value : (H, W, C) float32
    chart : (H, W) int32
        Chart of each covered texel, -1 = empty.
    valid : (H, W) bool
        Covered and not buried.

    Returns
    -------
    value : (H, W, C) float32
        A new page; valid and empty texels are unchanged.
    n_hopeless : int
        Texels of charts without any valid texel; they get 0.

    Raises
    ------
    ValueError
        If the arrays do not belong together.
    """
    check_page(value, chart, valid=valid)
    filled = np.array(value)
    covered = chart >= 0
    known = valid & covered
    if bool((known == covered).all()):
        return filled, 0
    # Whatever a buried texel holds (even NaN) must not survive.
    filled[covered & ~known] = 0.0
    grow_rings(filled, chart, known)
    left = covered & ~known
    if not left.any():
        return filled, 0
    # Pieces of a chart cut off from its valid texels take the mean of these, if there are any.
    n_charts = int(chart.max()) + 1
    trusted = valid & covered
    count = np.bincount(chart[trusted], minlength=n_charts)
    owner = chart[left]
    for channel in range(value.shape[2]):
        total = np.bincount(chart[trusted], weights=value[..., channel][trusted], minlength=n_charts)
        mean = total / np.maximum(count, 1)
        filled[..., channel][left] = mean[owner]
    return filled, int((count[owner] == 0).sum())
