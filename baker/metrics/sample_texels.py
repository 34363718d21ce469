"""Chooses random texels to compare, stratified by object and brightness."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Smallest number of texels chosen on each object. If there are many objects, it is reduced (not below 1), so
# that these texels are at most a quarter of all chosen texels.
_MIN_PER_OBJECT = 8
# Number of light levels in each factor of ten.
LEVELS = 2


def choose_texels(
    owner: NDArray[np.int32],
    eligible: NDArray[np.bool_],
    brightness: NDArray[np.float64],
    n: int,
    seed: int,
) -> NDArray[np.int64]:
    """Choose about n texels at random, stratified by object and brightness, or all if there are at most n.

    First each object gets a minimum number of texels. The remaining texels are distributed in proportion to
    the objects' numbers of texels.

    Parameters
    ----------
    owner : (N,) int32
        Object of each texel, -1 for none.
    eligible : (N,) bool
        Texels that may be chosen.
    brightness : (N,) float64
        The texels of each object are sorted by brightness and divided into strata of equal size. One texel is
        chosen in each stratum.
    n : int
        Number of texels, approximately.
    seed : int
        Seed of the random choice.

    Returns
    -------
    (m,) int64, ascending
        Indices of the chosen texels.
    """
    candidate = np.flatnonzero(eligible & (owner >= 0))
    if len(candidate) <= n:
        return candidate
    objects, count = np.unique(owner[candidate], return_counts=True)
    floor = np.minimum(count, min(_MIN_PER_OBJECT, max(n // (4 * len(objects)), 1)))
    left = count - floor
    share = floor + np.floor(max(n - floor.sum(), 0) * left / max(left.sum(), 1)).astype(np.int64)
    random = np.random.Generator(np.random.PCG64([seed, 6]))
    order = candidate[np.lexsort((candidate, brightness[candidate], owner[candidate]))]
    begin = np.concatenate([[0], np.cumsum(count)[:-1]])
    chosen = []
    for first, size, wanted in zip(begin, count, np.minimum(share, count), strict=True):
        edge = np.linspace(0, size, wanted + 1)
        # Choose one texel in each of `wanted` strata of equal size.
        at = np.floor(edge[:-1] + random.random(wanted) * np.diff(edge)).astype(np.int64)
        chosen.append(order[first + np.unique(np.minimum(at, size - 1))])
    return np.sort(np.concatenate(chosen))


def light_level(light: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the light level of each value: floor(2 log10 light).

    Parameters
    ----------
    light : (n,) float64
        Light values. Values below 1e-7 times the largest value are raised to this limit.

    Returns
    -------
    (n,) int64
        Number of the level; negative for values below 1.
    """
    lit = light[light > 0]
    darkest = 1e-7 * float(lit.max()) if len(lit) else 1.0
    return np.asarray(np.floor(LEVELS * np.log10(np.maximum(light, darkest))), np.int64)


def scarce_texels(
    eligible: NDArray[np.bool_],
    brightness: NDArray[np.float64],
    chosen: NDArray[np.int64],
    n: int,
    seed: int,
) -> NDArray[np.int64]:
    """Choose additional texels so that n texels of each light level are chosen, or all if it has fewer.

    Parameters
    ----------
    eligible : (N,) bool
        Texels that may be chosen.
    brightness : (N,) float64
        Brightness, which determines the light level. Texels with brightness 0 are not chosen.
    chosen : (m,) int64
        Texels that are already chosen.
    n : int
        Number of texels of each light level, including those that are already chosen.
    seed : int
        Seed of the random choice.

    Returns
    -------
    (k,) int64, ascending
        Indices of the additional texels.
    """
    candidate = np.flatnonzero(eligible & (brightness > 0))
    level = light_level(brightness[candidate])
    new = ~np.isin(candidate, chosen)
    random = np.random.Generator(np.random.PCG64([seed, 15]))
    found = [np.zeros(0, np.int64)]
    for number in np.unique(level):
        same = level == number
        left = candidate[same & new]
        missing = max(n - int((same & ~new).sum()), 0)
        found.append(left[random.permutation(len(left))[:missing]])
    return np.sort(np.concatenate(found))
