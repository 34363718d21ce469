"""Estimates a page's noise from its values, for callers without standard errors.

The page is filtered with a high-pass filter whose result is 0 on planes. The noise of a block is computed
from the median of the absolute results, on which the few texels at a shadow edge have little influence.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.finish.kernels.page_guard import high_pass
from baker.finish.tiles import over_rows

# Side of a block, texels.
BLOCK = 16
# Smallest number of filtered texels from which a median is computed. With fewer texels, the median of a block
# is replaced by the median of the chart, and the median of a chart by the median of the page.
FEWEST = 12
# Median of |x| of a standard normal variable.
NORMAL_MEDIAN = 0.6744898


def estimate_error(
    luminance: NDArray[np.float32], chart: NDArray[np.int32], covered: NDArray[np.bool_], *, threads: int = 1
) -> NDArray[np.float32]:
    """Estimate the standard deviation of the noise of each covered texel.

    Parameters
    ----------
    luminance : (H, W) float32
        Luminance of each texel of the page.
    chart : (H, W) int32
        Index of the chart of each covered texel.
    covered : (H, W) bool
        Texels of charts.
    threads : int
        Number of threads.

    Returns
    -------
    error : (H, W) float32
        Standard deviations, equal for all texels of one chart in one block of 16 x 16; 0 where not covered.
    """
    passed = np.full(luminance.shape, np.nan, np.float32)
    over_rows(
        lambda first, end: high_pass(luminance, chart, covered, passed, first, end), len(luminance), threads
    )
    error = np.zeros(luminance.shape, np.float32)
    if not covered.any():
        return error
    size = np.abs(passed[covered])
    known = np.isfinite(size)
    everywhere = np.full(1, float(np.median(size[known])) if known.any() else 0.0)
    by_chart = _grouped_median(chart[covered], size, known, everywhere)
    by_block = _grouped_median(_chart_blocks(chart, covered), size, known, by_chart)
    error[covered] = (by_block / NORMAL_MEDIAN).astype(np.float32)
    return error


def _chart_blocks(chart: NDArray[np.int32], covered: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return (n,) int64: for each covered texel, a number of its chart in its block of 16 x 16 texels."""
    rows, columns = np.nonzero(covered)
    rows //= BLOCK
    columns //= BLOCK
    n_across = covered.shape[1] // BLOCK + 1
    rows *= n_across
    rows += columns
    rows += chart[covered].astype(np.int64) * (n_across * (covered.shape[0] // BLOCK + 1))
    return rows


def _grouped_median(
    group: NDArray[np.integer],
    size: NDArray[np.float32],
    known: NDArray[np.bool_],
    otherwise: NDArray[np.float64],
) -> NDArray[np.float64]:
    # Return (n,) float64: for each texel, the upper median of `size` over the texels of its group where
    # `known` is set. If `known` is set at fewer than FEWEST texels of the group, return the texel's item of
    # `otherwise`, which has 1 or n items. All other arguments are (n,).
    index = np.unique(group, return_inverse=True)[1]
    kept, own = size[known], index[known]
    count = np.bincount(own, minlength=int(index.max()) + 1)
    ordered = np.append(kept[np.lexsort((kept, own))], np.float32(0.0))
    start = np.concatenate(([0], np.cumsum(count)[:-1]))
    median = ordered[np.minimum(start + count // 2, len(ordered) - 1)].astype(np.float64)
    del kept, own, ordered
    return np.where(count[index] >= FEWEST, median[index], otherwise)
