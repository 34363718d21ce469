"""Which texels are judged: all objects and brightnesses, evenly by area; more where a light level has few."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Every object gets this many texels, as long as that leaves three quarters of them to be shared out by area.
_LEAST = 8
# Light levels for each factor of ten.
LEVELS = 2


def choose_texels(
    owner: NDArray[np.int32], judged: NDArray[np.bool_], brightness: NDArray[np.float64], n: int, seed: int
) -> NDArray[np.int64]:
    """Return texel numbers, rising: about n of those that may be judged.

    Parameters
    ----------
    owner : (N,) int32
        Object of each texel, -1 for none.
    judged : (N,) bool
        Texels that may be chosen.
    brightness : (N,) float64
        Each object's texels are taken evenly over their order by this.
    """
    candidate = np.flatnonzero(judged & (owner >= 0))
    if len(candidate) <= n:
        return candidate
    objects, count = np.unique(owner[candidate], return_counts=True)
    floor = np.minimum(count, min(_LEAST, max(n // (4 * len(objects)), 1)))
    left = count - floor
    share = floor + np.floor(max(n - floor.sum(), 0) * left / max(left.sum(), 1)).astype(np.int64)
    random = np.random.Generator(np.random.PCG64([seed, 6]))
    order = candidate[np.lexsort((candidate, brightness[candidate], owner[candidate]))]
    begin = np.concatenate([[0], np.cumsum(count)[:-1]])
    chosen = []
    for first, size, wanted in zip(begin, count, np.minimum(share, count), strict=True):
        edge = np.linspace(0, size, wanted + 1)
        # One texel from each of `wanted` equal parts of the object's order.
        at = np.floor(edge[:-1] + random.random(wanted) * np.diff(edge)).astype(np.int64)
        chosen.append(order[first + np.unique(np.minimum(at, size - 1))])
    return np.sort(np.concatenate(chosen))


def light_level(light: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the level of each light (n,): half a power of ten; all that is nearly black is one."""
    lit = light[light > 0]
    least = 1e-7 * float(lit.max()) if len(lit) else 1.0
    return np.asarray(np.floor(LEVELS * np.log10(np.maximum(light, least))), np.int64)


def scarce_texels(
    judged: NDArray[np.bool_], brightness: NDArray[np.float64], chosen: NDArray[np.int64], n: int, seed: int
) -> NDArray[np.int64]:
    """Return texel numbers, rising, that bring each light level to n, as far as it has texels.

    Parameters
    ----------
    judged : (N,) bool
        Texels that may be chosen.
    brightness : (N,) float64
    chosen : (m,) int64
        Texels that are judged already.
    """
    candidate = np.flatnonzero(judged & (brightness > 0))
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
