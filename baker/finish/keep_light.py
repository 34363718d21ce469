"""Restores the light that the denoiser removed from a page.

If few rays hit the light, most texels are too dark, and a few are far too bright. The filter removes these
bright texels as outliers, so surfaces with much noise become too dark. The sum of the samples over many
texels is unbiased. The variance of this sum between seeds equals the variance of the sum of the filtered
values. Therefore, in windows of 40 x 40 texels, the filtered values are scaled so that their sum approaches
the sum of the samples. The correction is smaller in windows with few texels of the chart, because the sums
over such windows are noisy.

*Measured* differences between the mean of the filtered values and the mean of the samples:

    scene                                                      | not corrected  | corrected
    cellar behind one small window (64 and 256 rays, 5 seeds)  | -2.6 to -3.9 % | -0.3 to -2.1 %
    house of two storeys                                       | -1.2 %         | 0.0 %

The correction does not change RMS errors.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.finish.kernels.page_light import BLOCK, add_shares, group_blocks, missing_shares, sum_groups


def keep_light(
    noisy: NDArray[np.float32],
    filtered: NDArray[np.float32],
    chart: NDArray[np.int32],
    chosen: NDArray[np.bool_],
) -> NDArray[np.float32]:
    """Return (H, W, C) float32: the filtered page, scaled locally to the light of the noisy page.

    Parameters
    ----------
    noisy, filtered : (H, W, C) float32
        The page before and after denoising.
    chart : (H, W) int32
        Index of the chart of each texel. A window contains texels of one chart only.
    chosen : (H, W) bool
        Texels that are summed and scaled.
    """
    height, width, channels = noisy.shape
    down, across = -(-height // BLOCK), -(-width // BLOCK)
    label, first = np.full((height, width), -1, np.int32), np.zeros(down * across + 1, np.int64)
    owner = np.zeros(int(np.count_nonzero(chosen)), np.int32)
    n = int(group_blocks(chart, chosen, label, first, owner))
    light, sums = np.zeros((n, 2)), np.zeros((n, 2 * channels + 1))
    sum_groups(noisy, filtered, label, light, sums)
    share = np.zeros((n, channels))
    missing_shares(first, owner, across, sums, share)
    result = np.array(filtered)
    add_shares(label, first, owner, across, share, result)
    return result
