# mypy: disable-error-code="no-untyped-def"
"""From what a ray hit to the texel that lies there.

Every surface blocks light from both sides; the back of a one-sided surface is black.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.trace.jit import inner, larger, smaller

# Answer of `hit_pixel` for the black back of a one-sided surface.
BACK_FACE = -1


class TriangleLookup(NamedTuple):
    """What is looked up at a hit.

    row (T, 16) float32, one cache line a triangle: lightmap uv of corner 0, its two edges (2 each), page,
    1 if double-sided, face normal (3), area, emitter (see `emitters.emitter_at`) or -1, material, two spare;
    size int, of a page in texels; n_pixels int, of all pages: backs are numbered behind them.
    """

    row: NDArray[np.float32]
    size: int
    n_pixels: int


# The functions below take the table's arrays one by one: handing a tuple of arrays to a function costs
# Numba an atomic reference count per array and call, which tripled the time of a hit.
@inner
def front_facing(row, prim, dx, dy, dz):
    """Tell whether a ray of direction d meets the front of the triangle."""
    return row[prim, 8] * dx + row[prim, 9] * dy + row[prim, 10] * dz < np.float32(0.0)


@inner
def hit_pixel(row, size, n_pixels, prim, u, v, front):
    """Return the flat pixel at barycentrics (u, v) of a triangle (+ n_pixels on its back), or BACK_FACE."""
    if not front and row[prim, 7] == np.float32(0.0):
        return np.int64(BACK_FACE)
    x = (row[prim, 0] + u * row[prim, 2] + v * row[prim, 4]) * np.float32(size)
    y = (row[prim, 1] + u * row[prim, 3] + v * row[prim, 5]) * np.float32(size)
    last = np.int32(size - 1)
    column = np.int64(smaller(larger(np.int32(x), np.int32(0)), last))
    line = np.int64(smaller(larger(np.int32(y), np.int32(0)), last))
    pixel = (np.int64(row[prim, 6]) * size + line) * size + column
    return pixel if front else pixel + n_pixels
