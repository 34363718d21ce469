"""Points of texels for the ray kernels, computed tile by tile so that memory stays small.

In small scenes the points are stored from one stage to the next, since computing them takes a tenth of the
time of tracing the rays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.budget import MAX_CACHED_TEXELS
from baker.kernels.surface import N_POINTS, Surface, place_points

# Empty outputs of `place_points` for triangles and barycentrics, which are not needed.
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
        Triangles and texel entries.
    valid_points : (n,) uint16
        Bit k is set where point k of an entry is valid; invalid points are replaced by valid ones of the
        same entry.
    chosen : (m,) int64
        Texel entries.
    wanted : (m or 1, w) uint8
        Numbers of points, 0 to 15, of each chosen entry; all 16 by default.

    Returns
    -------
    origin, normal : (m, w, 3) float32
        World space.
    """
    shape = (len(chosen), wanted.shape[1])
    origin, normal = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    place_points(surface, valid_points, chosen, wanted, origin, normal, _NO_TRIANGLE, _NO_BARY)
    return origin, normal


@dataclass(frozen=True)
class PointCache:
    """The points of all n entries, filled tile by tile by the first stage that needs them.

    Attributes
    ----------
    origin, normal : (n, 16, 3) float32
        World space.
    filled : set of (int, int)
        Spans of entries whose points are stored.
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
        None for more than `core.budget.MAX_CACHED_TEXELS` entries.
    """
    if n > MAX_CACHED_TEXELS:
        return None
    shape = (n, N_POINTS, 3)
    return PointCache(np.zeros(shape, np.float32), np.zeros(shape, np.float32), set())


def tile_points(
    surface: Surface, valid_points: NDArray[np.uint16], begin: int, end: int, cache: PointCache | None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return all points of entries begin to end, see `points_of`; they are stored in `cache`, if any."""
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
    """Return one point of each chosen entry, (m, 1, 3), see `points_of`; from `cache` if it is complete.

    chosen : (m,) int64, entries; wanted : (m,) uint8, number of the point of each, 0 to 15
    """
    if cache is None or sum(end - begin for begin, end in cache.filled) < len(cache.origin):
        return points_of(surface, valid_points, chosen, wanted[:, None])
    at = chosen * N_POINTS + wanted
    origin, normal = (np.take(p.reshape(-1, 3), at, axis=0)[:, None] for p in (cache.origin, cache.normal))
    return origin, normal
