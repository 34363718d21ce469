"""Points of texels for the ray kernels, made tile by tile so that memory stays small.

Small scenes keep the points from one stage to the next: making them takes a tenth of the time of their rays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.kernels.surface import N_POINTS, Surface, place_points

_NOWHERE, _NO_BARY = np.zeros((0, 1), np.int32), np.zeros((0, 1, 2), np.float32)
# Points take 384 bytes a texel: 100 MB are kept at most.
MOST_KEPT = 262_144
_EVERY = np.arange(N_POINTS, dtype=np.uint8)[None]


def points_of(
    surface: Surface, mask: NDArray[np.uint16], chosen: NDArray[np.int64], wanted: NDArray[np.uint8] = _EVERY
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return ray origins and shading normals (m, w, 3) float32, world, of points of texel entries.

    Parameters
    ----------
    mask : (n,) uint16
        Bit k is set where point k of a texel is not buried; buried points are replaced by free ones.
    chosen : (m,) int64
        Texel entries.
    wanted : (m or 1, w) uint8
        Which of a texel's 16 points; all by default.
    """
    shape = (len(chosen), wanted.shape[1])
    origin, normal = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    place_points(surface, mask, chosen, wanted, origin, normal, _NOWHERE, _NO_BARY)
    return origin, normal


@dataclass(frozen=True)
class PointCache:
    """The points of all entries, filled tile by tile by whoever needs them first.

    Attributes
    ----------
    origin, normal : (n, 16, 3) float32
    made : set of (int, int), spans of entries whose points are there
    """

    origin: NDArray[np.float32]
    normal: NDArray[np.float32]
    made: set[tuple[int, int]]


def keep_points(n: int) -> PointCache | None:
    """Return room for the points of n entries, None if that is too much to keep."""
    if n > MOST_KEPT:
        return None
    shape = (n, N_POINTS, 3)
    return PointCache(np.zeros(shape, np.float32), np.zeros(shape, np.float32), set())


def tile_points(
    surface: Surface, mask: NDArray[np.uint16], begin: int, end: int, kept: PointCache | None
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return all points of entries begin to end, see `points_of`; from `kept` if they are there."""
    if kept is None:
        return points_of(surface, mask, np.arange(begin, end))
    origin, normal = kept.origin[begin:end], kept.normal[begin:end]
    if (begin, end) not in kept.made:
        place_points(
            surface, mask, np.arange(begin, end), _EVERY, origin, normal, _NOWHERE, _NO_BARY
        )  # fmt: skip
        kept.made.add((begin, end))
    return origin, normal


def some_points(
    surface: Surface,
    mask: NDArray[np.uint16],
    chosen: NDArray[np.int64],
    wanted: NDArray[np.uint8],
    kept: PointCache | None,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return one point of each chosen entry, (m, 1, 3), see `points_of`; from `kept` if all are there.

    chosen : (m,) int64, entries; wanted : (m,) uint8, which of the 16 points of each
    """
    if kept is None or sum(end - begin for begin, end in kept.made) < len(kept.origin):
        return points_of(surface, mask, chosen, wanted[:, None])
    at = chosen * N_POINTS + wanted
    origin, normal = (np.take(p.reshape(-1, 3), at, axis=0)[:, None] for p in (kept.origin, kept.normal))
    return origin, normal
