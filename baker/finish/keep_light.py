"""Restores the light that the denoiser removed from a page.

Where few samples find the light, most texels are too dark and a few far too bright. A filter removes such
bright texels as outliers, so rooms become too dark, the noisier the darker. Over many texels the sum of the
samples has the same variance between seeds as the sum of the filtered values, and it is unbiased. So the
filtered values in windows of 40 x 40 texels are scaled towards the sum of the samples; by less in windows of
few texels, whose sums are noisy. *Measured* on light levels of a cellar behind one small window (256, 64
rays, 5 seeds), filtered against samples, without and with: -2.7 and -0.3, -2.6 and -0.9, -3.9 and -2.1 %; two
storeys: -1.2 and 0.0 %. RMS errors do not change.
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
    """Return the filtered page, scaled locally to the light of the noisy one.

    Parameters
    ----------
    noisy, filtered : (H, W, C) float32
    chart : (H, W) int32
        Windows end at charts.
    chosen : (H, W) bool
        Texels to count and to change.
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
