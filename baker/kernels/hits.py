"""From what a ray hit to the texel that lies there.

Every surface blocks light from both sides; the back of a one-sided surface is black.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

# Answers of `hit_entry` other than an entry's number.
LOST = -1
BACK_FACE = -2


class HitTable(NamedTuple):
    """What is looked up at a hit.

    row (T, 16) float32, one cache line a triangle: lightmap uv of corner 0, its two edges (2 each),
    page, 1 if double-sided, face normal (3), area, emitter number or -1, material, two spare;
    lookup (P * H * W,) int32; back_entry (n_front,) int32; size int.
    """

    row: NDArray[np.float32]
    lookup: NDArray[np.int32]
    back_entry: NDArray[np.int32]
    size: int


@njit(cache=True, nogil=True, inline="always")
def front_facing(table, prim, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Tell whether a ray of direction d meets the front of the triangle."""
    return table.row[prim, 8] * dx + table.row[prim, 9] * dy + table.row[prim, 10] * dz < np.float32(0.0)


@njit(cache=True, nogil=True)
def hit_entry(table, prim, u, v, front):  # type: ignore[no-untyped-def]
    """Return the texel entry at barycentrics (u, v) of a triangle, or LOST or BACK_FACE."""
    row = table.row[prim]
    if not front and row[7] == np.float32(0.0):
        return BACK_FACE
    size = table.size
    x = (row[0] + u * row[2] + v * row[4]) * size
    y = (row[1] + u * row[3] + v * row[5]) * size
    column = min(max(int(x), 0), size - 1)
    line = min(max(int(y), 0), size - 1)
    base = np.int64(row[6]) * size * size
    entry = table.lookup[base + line * size + column]
    if entry < 0:
        entry = _nearest(table, base, line, column, x, y)
    if entry >= 0 and not front:
        return table.back_entry[entry]
    return entry


@njit(cache=True, nogil=True)
def _nearest(table, base, line, column, x, y):  # type: ignore[no-untyped-def]
    """Return the covered texel nearest to (x, y) among the eight around an uncovered one (rounding at borders)."""
    best = 1.0e30
    entry = LOST
    for j in range(max(line - 1, 0), min(line + 2, table.size)):
        for i in range(max(column - 1, 0), min(column + 2, table.size)):
            found = table.lookup[base + j * table.size + i]
            distance = math.hypot(i + 0.5 - x, j + 0.5 - y)
            if found >= 0 and distance < best:
                best = distance
                entry = found
    return entry
