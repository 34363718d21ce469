"""Fills invalid texels from the valid texels of the same chart.

An invalid texel lies inside geometry with all its points, so its value is meaningless. Bilinear lookups on
the visible surface beside the texel nevertheless read this value.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.finish.page import check_page

# Weights of the 8 neighbours in the order of `_neighbours`, row by row.
_RING_WEIGHTS = (0.5, 1.0, 0.5, 1.0, 1.0, 0.5, 1.0, 0.5)


def fill_invalid(
    value: NDArray[np.float32], chart: NDArray[np.int32], valid: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], int]:
    """Replace the values of covered but invalid texels by values from valid texels of the same chart.

    Values are propagated from the valid texels outwards, ring by ring. If an invalid strip of a chart lies
    between two rooms, each half of the strip therefore gets the values of the room next to it.

    Parameters
    ----------
    value : (H, W, C) float32
        The page.
    chart : (H, W) int32
        Index of the chart of each covered texel, -1 for empty texels.
    valid : (H, W) bool
        Covered texels with a valid point.

    Returns
    -------
    value : (H, W, C) float32
        A new page; valid and empty texels are unchanged.
    n_hopeless : int
        Number of texels in charts without any valid texel. These texels keep their values. If a component of
        such a texel is not finite, all components of the texel become 0.

    Raises
    ------
    ValueError
        If shapes or types of the arrays do not match.
    """
    check_page(value, chart, valid=valid)
    filled = np.array(value, order="C")
    covered = chart >= 0
    known = np.ascontiguousarray(valid & covered)
    if bool((known == covered).all()):
        return filled, 0
    # Keep the values of charts without any valid texel, because the solid around them may be misclassified.
    n_charts = int(chart.max()) + 1
    some = np.bincount(chart[known], minlength=n_charts) > 0
    hopeless = covered & ~known & ~some[chart]
    filled[hopeless & ~np.isfinite(filled).all(axis=2)] = 0.0
    n_hopeless = int(hopeless.sum())
    if n_hopeless:
        chart, covered = np.where(hopeless, -1, chart), covered & ~hopeless
    # Discard the values of all other invalid texels, which may be NaN.
    filled[covered & ~known] = 0.0
    _grow_rings(filled, chart, known)
    left = covered & ~known
    if not left.any():
        return filled, n_hopeless
    # Fill texels that no ring reached with the mean of their chart's valid texels.
    trusted = valid & covered
    count = np.bincount(chart[trusted], minlength=n_charts)
    owner = chart[left]
    for channel in range(value.shape[2]):
        total = np.bincount(chart[trusted], weights=value[..., channel][trusted], minlength=n_charts)
        mean = total / np.maximum(count, 1)
        filled[..., channel][left] = mean[owner]
    return filled, n_hopeless


def _grow_rings(value: NDArray[np.float32], chart: NDArray[np.int32], known: NDArray[np.bool_]) -> None:
    """Fill the texels of each chart that are not `known`, ring by ring from the known texels, in place.

    A texel of the next ring gets the weighted mean of its known 8-neighbours of the same chart. The weight is
    1 for neighbours that share an edge, and 1/2 for diagonal neighbours. The values of a ring are used only
    after the whole ring is computed, so the result does not depend on the order of texels.

    value : (H, W, C) float32, known : (H, W) bool, both changed at the texels that are filled
    chart : (H, W) int32, -1 for empty texels
    """
    flat_chart, flat_known = chart.reshape(-1), known.reshape(-1)
    flat_value = value.reshape(-1, value.shape[2])
    queued = np.zeros(chart.size, np.bool_)
    ring = np.flatnonzero((flat_chart >= 0) & ~flat_known)
    beside, inside = _neighbours(ring, chart.shape)
    ring = ring[(inside & flat_known[beside] & (flat_chart[beside] == flat_chart[ring])).any(axis=0)]
    queued[ring] = True
    while len(ring):
        beside, inside = _neighbours(ring, chart.shape)
        own = inside & (flat_chart[beside] == flat_chart[ring])
        total, weight_sum = np.zeros((len(ring), value.shape[2])), np.zeros(len(ring))
        for texel, use, weight in zip(beside, own & flat_known[beside], _RING_WEIGHTS, strict=True):
            weight_sum[use] += weight
            total[use] += weight * flat_value[texel[use]].astype(np.float64)
        flat_value[ring] = total / weight_sum[:, None]
        flat_known[ring] = True
        ring = np.unique(beside[own & ~flat_known[beside] & ~queued[beside]])
        queued[ring] = True


def _neighbours(
    texel: NDArray[np.int64], shape: tuple[int, int]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return indices (8, n) int64 of the 8 neighbours of n texels, and (8, n) bool: which are on the page.

    texel : (n,) int64, row * W + column; shape : (H, W) of the page
    """
    row, column = np.divmod(texel, shape[1])
    down = row + np.array([-1, -1, -1, 0, 0, 1, 1, 1])[:, None]
    right = column + np.array([-1, 0, 1, -1, 1, -1, 0, 1])[:, None]
    inside = (down >= 0) & (down < shape[0]) & (right >= 0) & (right < shape[1])
    return np.where(inside, down * shape[1] + right, 0), inside
