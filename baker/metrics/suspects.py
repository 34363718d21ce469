"""Texels of a map that stand out from all their neighbours, or lie where light changes most.

They are few, and random choice would miss them. Whether they are wrong only path tracing can tell: a crack of
light is as bright beside its neighbours as a fault.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, maximum_filter, minimum_filter

# The texel itself takes no part.
_AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)
# A texel that differs by less than this factor from its nearest neighbour is no suspect.
_LEAST = 1.1
# Light that changes less than this over two texels tells little.
_STEEP = 0.1
# Light below this share of the median is dark: differences there are held against it.
_DARK = 0.01


def suspicion(page: NDArray[np.float64], covered: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return by what factor each texel lies above all its neighbours, or below them; 1 for most.

    Parameters
    ----------
    page : (H, W) float64
        Not below 0.
    covered : (H, W) bool
        Only texels whose eight neighbours are covered, too, are compared.
    """
    inside = binary_erosion(covered, np.ones((3, 3), bool))
    if not inside.any():
        return np.ones(page.shape)
    floor = max(_DARK * float(np.median(page[covered])), 1e-30)
    value = page + floor
    high, low = maximum_filter(value, footprint=_AROUND), minimum_filter(value, footprint=_AROUND)
    return np.where(inside, np.maximum(value / high, low / value), 1.0)


def suspect_texels(maps: NDArray[np.float32], covered: NDArray[np.bool_], most: int) -> NDArray[np.int64]:
    """Return at most `most` texel numbers, rising, of those that stand out most.

    Parameters
    ----------
    maps : (P, H, W, C) float32
    covered : (P, H, W) bool
    """
    score = np.stack(
        [
            np.max([suspicion(np.maximum(page[..., c], 0), on) for c in range(page.shape[2])], axis=0)
            for page, on in zip(maps.astype(np.float64), covered, strict=True)
        ]
    ).reshape(-1)
    found = np.flatnonzero(score > _LEAST)
    worst = found[np.argsort(-score[found], kind="stable")[:most]]
    return np.sort(worst)


def steep_texels(maps: NDArray[np.float32], covered: NDArray[np.bool_], most: int) -> NDArray[np.int64]:
    """Return at most `most` texel numbers, rising, of those between neighbours that differ most.

    There a map shows whether it is shifted or blurred. Differences count as a share of the brighter side, up
    to half of it: the edges of shadows are as good as those of gaps.
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
    found = np.flatnonzero(flat > _STEEP)
    random = np.random.Generator(np.random.PCG64([len(found), 14])).random(len(found))
    order = np.lexsort((random, -np.minimum(flat[found], 0.5)))
    return np.sort(found[order[:most]])
