"""Moves the values of partly covered texels from where they were measured to the texel centre.

A texel on a chart's border holds the mean over its covered part, that is the value at that part's centroid,
up to 0.7 texels away from the centre that a bilinear lookup takes it to stand for.
Best done before denoising, which then meets a picture without steps along slanted borders. *Measured* within
half a texel of the border, contact shadow of 6 texels: RMS error 5.0 to 1.1 % with 1 % noise; with 5 % noise
and denoising 5.7 to 2.5 %; where there is no steep slope it neither gains nor costs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.finish.page import check_page
from baker.finish.tiles import over_rows
from baker.kernels.page_slope import move_to_centre

# Sub-positions place a fully covered texel's centroid only so well; below this nothing is gained.
SMALLEST_OFFSET = 0.02


def recentre(
    value: NDArray[np.float32],
    chart: NDArray[np.int32],
    centroid_offset: NDArray[np.float32],
    *,
    valid: NDArray[np.bool_] | None = None,
    threads: int = 1,
) -> NDArray[np.float32]:
    """Correct each covered texel to first order: value - slope . (centroid - centre).

    The slope is fitted inside the chart. The result stays within the range of the 5 x 5 texels around it,
    widened by half, and light never turns negative.

    Parameters
    ----------
    value : (H, W, C) float32
        Means over the covered part of each texel.
    chart : (H, W) int32
        -1 = empty.
    centroid_offset : (H, W, 2) float32
        Centroid of the covered part minus texel centre: (column, row), texels.
    valid : (H, W) bool, optional
        Texels to correct and to fit slopes from; default all covered ones.
    threads : int

    Returns
    -------
    value : (H, W, C) float32
        A new page.

    Raises
    ------
    ValueError
        If the arrays do not belong together.
    """
    used = chart >= 0 if valid is None else valid & (chart >= 0)
    check_page(value, chart, centroid_offset=centroid_offset, valid=used)
    out = np.array(value)
    over_rows(
        lambda first, end: move_to_centre(
            value, chart, used, centroid_offset, SMALLEST_OFFSET, out, first, end
        ),
        len(value),
        threads,
    )
    return out
