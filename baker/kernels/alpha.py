"""How much of a surface is there, by the alpha of MASK and BLEND triangles.

alpha = factor * texture(base uv) * vertex alpha; MASK: 1 where it reaches the cutoff, else 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.textures import sample_alpha
from baker.trace.jit import inner, larger, smaller

# Columns of a row: image uv of corner 0, its two edges (2 each), factor times vertex alpha at corner 0 and
# what corners 1 and 2 add to it, cutoff (-1: BLEND), texture (-1: none), connected surface (a whole number).
UV, ALPHA, CUTOFF, TEXTURE, SURFACE = 0, 6, 9, 10, 11
ROW_LENGTH = 16


class AlphaTable(NamedTuple):
    """The K triangles that let light through somewhere, one cache line each.

    slot (T,) int32, row of each triangle of the scene or -1, (0,) if there are none at all;
    row (K, 16) float32, see the column names.
    """

    slot: NDArray[np.int32]
    row: NDArray[np.float32]


def no_alpha() -> AlphaTable:
    """Return the table of a scene in which everything blocks."""
    return AlphaTable(np.zeros(0, np.int32), np.zeros((0, ROW_LENGTH), np.float32))


@inner
def opacity(row, k, pixels, level, wrap, b1, b2):  # type: ignore[no-untyped-def]
    """Return how much of the surface of row k is there at barycentrics, 0 to 1; arrays: `TexturePack`."""
    alpha = np.float64(row[k, ALPHA]) + b1 * row[k, ALPHA + 1] + b2 * row[k, ALPHA + 2]
    if row[k, TEXTURE] >= np.float32(0.0):
        u = np.float64(row[k, UV]) + b1 * row[k, UV + 2] + b2 * row[k, UV + 4]
        v = np.float64(row[k, UV + 1]) + b1 * row[k, UV + 3] + b2 * row[k, UV + 5]
        alpha *= sample_alpha(pixels, level, wrap, np.int64(row[k, TEXTURE]), u, v)
    if row[k, CUTOFF] >= np.float32(0.0):
        # Weights of a lookup may add up to a hair less than 1: the comparison is one of float32.
        return 1.0 if np.float32(alpha) >= row[k, CUTOFF] else 0.0
    return smaller(larger(alpha, 0.0), 1.0)


@inner
def opacity_at(shading, t, b1, b2):  # type: ignore[no-untyped-def]
    """Return the same for triangle t of the scene, 1 if it blocks everywhere."""
    if len(shading.alpha.slot) == 0 or shading.alpha.slot[t] < 0:
        return 1.0
    pack = shading.pack
    return opacity(
        shading.alpha.row, np.int64(shading.alpha.slot[t]), pack.pixels, pack.level, pack.wrap,
        np.float64(b1), np.float64(b2),
    )  # fmt: skip
