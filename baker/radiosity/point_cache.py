"""Computes and caches the 16 sample points of each texel, from which rays start.

Points are computed tile by tile to save memory. In small scenes they are also stored for later stages,
because computing the points takes about a tenth of the time of tracing their rays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.budget import MAX_CACHED_TEXELS
from baker.kernels.surface import N_POINTS, Surface, place_points

# Empty arrays, for which `place_points` writes no triangles and barycentrics.
_NO_TRIANGLE, _NO_BARY = np.zeros((0, 1), np.int32), np.zeros((0, 1, 2), np.float32)
_EVERY = np.arange(N_POINTS, dtype=np.uint8)[None]


def points_of(
    surface: Surface,
    valid_points: NDArray[np.uint16],
    chosen: NDArray[np.int64],
    wanted: NDArray[np.uint8] = _EVERY,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return ray origins and shading normals of points of texel entries.

    Parameters
    ----------
    surface : Surface
        Triangles and the n texel entries.
    valid_points : (n,) uint16
        Bit k is set where point k of an entry is valid. An invalid point is replaced by a valid point of the
        same entry.
    chosen : (m,) int64
        Texel entries.
    wanted : (m, w) or (1, w) uint8
        Numbers, 0 to 15, of the wanted points of each chosen entry. With shape (1, w), the same numbers are
        used for all entries. By default, all 16 points are returned.

    Returns
    -------
    origin, normal : (m, w, 3) float32
        Metres and unit vectors, world space.
    """
    shape = (len(chosen), wanted.shape[1])
    origin, normal = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    place_points(surface, valid_points, chosen, wanted, origin, normal, _NO_TRIANGLE, _NO_BARY)
    return origin, normal


@dataclass(frozen=True)
class PointCache:
    """The points of all n texel entries. The first stage that uses a tile's points stores them.

    Attributes
    ----------
    origin, normal : (n, 16, 3) float32
        Ray origins in metres, and unit shading normals; world space.
    filled : set of (int, int)
        First entry and end of each tile whose points are stored.
    """

    origin: NDArray[np.float32]
    normal: NDArray[np.float32]
    filled: set[tuple[int, int]]


def new_point_cache(n: int) -> PointCache | None:
    """Allocate the cache of n entries.

    Parameters
    ----------
    n : int
        Number of entries.

    Returns
    -------
    PointCache or None
        Empty cache; None for more than `core.budget.MAX_CACHED_TEXELS` entries.
    """
    if n > MAX_CACHED_TEXELS:
        return None
    shape = (n, N_POINTS, 3)
    return PointCache(np.zeros(shape, np.float32), np.zeros(shape, np.float32), set())


def tile_points(
    surface: Surface, valid_points: NDArray[np.uint16], begin: int, end: int, cache: PointCache | None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return `origin` and `normal` (m, 16, 3) of entries begin to end - 1, see `points_of`.

    If `cache` holds the points, they are read from it. Otherwise they are computed and, if there is a cache,
    stored in it.
    """
    if cache is None:
        return points_of(surface, valid_points, np.arange(begin, end))
    origin, normal = cache.origin[begin:end], cache.normal[begin:end]
    if (begin, end) not in cache.filled:
        place_points(
            surface, valid_points, np.arange(begin, end), _EVERY, origin, normal, _NO_TRIANGLE, _NO_BARY
        )
        cache.filled.add((begin, end))
    return origin, normal


def some_points(
    surface: Surface,
    valid_points: NDArray[np.uint16],
    chosen: NDArray[np.int64],
    wanted: NDArray[np.uint8],
    cache: PointCache | None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return `origin` and `normal` (m, 1, 3) of one point of each chosen entry, see `points_of`.

    chosen : (m,) int64, entries; wanted : (m,) uint8, number, 0 to 15, of one point of each entry
    cache : if it holds the points of all entries, they are read from it; else the points are computed
    """
    if cache is None or sum(end - begin for begin, end in cache.filled) < len(cache.origin):
        return points_of(surface, valid_points, chosen, wanted[:, None])
    at = chosen * N_POINTS + wanted
    origin, normal = (np.take(p.reshape(-1, 3), at, axis=0)[:, None] for p in (cache.origin, cache.normal))
    return origin, normal
