"""Gives a denoised page back the light that the filter took from it.

Where few samples find the light, most texels are too dark and a few far too bright. A filter takes such
bright texels for outliers: rooms came out too dark, by more the noisier they were. Over many texels the
samples' own sum is as sure as that of the filtered ones (their spread from seed to seed is the same), and it
is right on average. So windows of 40 x 40 texels get the sum of their samples, each texel by the same share
of its light; windows of few texels get less of it, since their samples tell less.
*Measured* on light levels of a cellar behind one small window (256, 64 rays, 5 seeds), filtered against
samples, without and with: -2.7 and -0.3, -2.6 and -0.9, -3.9 and -2.1 %; two storeys: -1.2 and 0.0 %. RMS
errors stay as they are.
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
    """Return the filtered page with the light of the noisy one.

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
