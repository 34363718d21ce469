"""From what a ray hit to the texel that lies there.

Every surface blocks light from both sides; the back of a one-sided surface is black.
"""

from __future__ import annotations

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


# The functions below take the table's arrays one by one: handing a tuple of arrays to a function costs
# Numba an atomic reference count per array and call, which tripled the time of a hit.
@njit(cache=True, nogil=True)
def front_facing(row, prim, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Tell whether a ray of direction d meets the front of the triangle."""
    return row[prim, 8] * dx + row[prim, 9] * dy + row[prim, 10] * dz < np.float32(0.0)


@njit(cache=True, nogil=True)
def hit_entry(row, lookup, back_entry, size, prim, u, v, front):  # type: ignore[no-untyped-def]
    """Return the texel entry at barycentrics (u, v) of a triangle, or LOST or BACK_FACE."""
    entry = np.int64(BACK_FACE)
    if front or row[prim, 7] != np.float32(0.0):
        x = (row[prim, 0] + u * row[prim, 2] + v * row[prim, 4]) * np.float32(size)
        y = (row[prim, 1] + u * row[prim, 3] + v * row[prim, 5]) * np.float32(size)
        column = min(max(np.int64(x), 0), size - 1)
        line = min(max(np.int64(y), 0), size - 1)
        base = np.int64(row[prim, 6]) * size * size
        entry = np.int64(lookup[base + line * size + column])
        if entry < 0:
            entry = nearest_entry(lookup, base, size, x, y, column, line)
        if entry >= 0 and not front:
            entry = np.int64(back_entry[entry])
    return entry


@njit(cache=True, nogil=True)
def nearest_entry(lookup, base, size, x, y, column, line):  # type: ignore[no-untyped-def]
    """Return the covered texel nearest to (x, y) among the eight around an uncovered one, or LOST.

    Rounding puts a hit on a chart's border into the texel beside it now and then.
    """
    best = 1.0e30
    entry = np.int64(LOST)
    for j in range(max(line - 1, 0), min(line + 2, size)):
        for i in range(max(column - 1, 0), min(column + 2, size)):
            found = np.int64(lookup[base + j * size + i])
            distance = (i + 0.5 - x) ** 2 + (j + 0.5 - y) ** 2
            if found >= 0 and distance < best:
                best = distance
                entry = found
    return entry
