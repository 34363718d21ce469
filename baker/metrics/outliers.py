"""Finds texels of a map that differ from all their neighbours, and texels where light changes most.

These texels are few, so random sampling would miss them. The map alone does not show whether they are wrong.
For example, a correct texel next to a gap through which light enters may differ from its neighbours as much
as a wrong texel. Therefore these texels are compared with path-traced values.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, maximum_filter, minimum_filter

# Footprint of the eight neighbours of a texel.
_NEIGHBOURS = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)
# Smallest outlier factor of an outlier, see `outlier_factor`.
_MIN_FACTOR = 1.1
# Relative change of light over a distance of two texels. Above this change, a texel is steep.
_MIN_CHANGE = 0.1
# Share of the page's median that keeps dark texels from large ratios: added to values in `outlier_factor`,
# and the lower limit of the denominator in `steep_texels`.
_DARK = 0.01


def outlier_factor(page: NDArray[np.float64], covered: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return the factor by which each texel is above all its neighbours, or below all of them.

    It is max(v / highest neighbour, lowest neighbour / v), with a small constant added to all values v.

    Parameters
    ----------
    page : (H, W) float64
        Values, not below 0.
    covered : (H, W) bool
        Texels whose values were computed, not filled by dilation. Only texels with eight covered neighbours
        are compared.

    Returns
    -------
    (H, W) float64
        At most 1 for texels between their neighbours, and 1 for texels that are not compared.
    """
    inside = binary_erosion(covered, np.ones((3, 3), bool))
    if not inside.any():
        return np.ones(page.shape)
    floor = max(_DARK * float(np.median(page[covered])), 1e-30)
    value = page + floor
    high, low = maximum_filter(value, footprint=_NEIGHBOURS), minimum_filter(value, footprint=_NEIGHBOURS)
    return np.where(inside, np.maximum(value / high, low / value), 1.0)


def outlier_texels(maps: NDArray[np.float32], covered: NDArray[np.bool_], count: int) -> NDArray[np.int64]:
    """Return the texels with the largest outlier factor in any component, among those above `_MIN_FACTOR`.

    Parameters
    ----------
    maps : (P, H, W, C) float32
        Pages of a channel.
    covered : (P, H, W) bool
        Texels whose values were computed, not filled by dilation.
    count : int
        Largest number of texels to return.

    Returns
    -------
    (m,) int64, ascending
        (page * H + row) * W + column.
    """
    score = np.stack(
        [
            np.max([outlier_factor(np.maximum(page[..., c], 0), on) for c in range(page.shape[2])], axis=0)
            for page, on in zip(maps.astype(np.float64), covered, strict=True)
        ]
    ).reshape(-1)
    found = np.flatnonzero(score > _MIN_FACTOR)
    worst = found[np.argsort(-score[found], kind="stable")[:count]]
    return np.sort(worst)


def steep_texels(maps: NDArray[np.float32], covered: NDArray[np.bool_], count: int) -> NDArray[np.int64]:
    """Return the texels at which the left and right, or upper and lower, neighbours differ most.

    The effect of a shift or a blur of the map is largest at these texels. The difference is relative to the
    brighter neighbour, and texels up to `_MIN_CHANGE` are left out. For the ranking, this relative difference
    is limited to one half, so that soft shadow edges have the same rank as sharp edges of gaps. Texels of
    equal rank are chosen at random.

    Parameters
    ----------
    maps : (P, H, W, C) float32
        Pages of a channel.
    covered : (P, H, W) bool
        Texels whose values were computed, not filled by dilation.
    count : int
        Largest number of texels to return.

    Returns
    -------
    (m,) int64, ascending
        (page * H + row) * W + column.
    """
    score = np.zeros(covered.shape)
    for number, (page, on) in enumerate(zip(maps.mean(axis=3, dtype=np.float64), covered, strict=True)):
        inside = binary_erosion(on, np.ones((3, 3), bool))
        floor = max(_DARK * float(np.median(page[on])), 1e-30) if on.any() else 1.0
        for axis in (0, 1):
            before, after = np.roll(page, 1, axis), np.roll(page, -1, axis)
            change = np.abs(before - after) / np.maximum(np.maximum(before, after), floor)
            score[number] = np.where(inside, np.maximum(score[number], change), 0.0)
    flat = score.reshape(-1)
    found = np.flatnonzero(flat > _MIN_CHANGE)
    random = np.random.Generator(np.random.PCG64([len(found), 14])).random(len(found))
    order = np.lexsort((random, -np.minimum(flat[found], 0.5)))
    return np.sort(found[order[:count]])
