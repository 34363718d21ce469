"""Computes the opacity of MASK and BLEND triangles.

    alpha = factor * texture alpha * vertex alpha

The opacity of a BLEND triangle is alpha. The opacity of a MASK triangle is 1 where alpha >= cutoff, else 0.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.textures import sample_alpha
from baker.trace.jit import inner, larger, smaller

# Columns of `AlphaTable.row`. Columns EDGE_1 and EDGE_2 contain the value at corner 1 and at corner 2, minus
# the value at corner 0.
#
#     UV, UV_EDGE_1, UV_EDGE_2            image uv (2 each)
#     ALPHA, ALPHA_EDGE_1, ALPHA_EDGE_2   factor times vertex alpha
#     CUTOFF                              alpha cutoff of MASK; -1 for BLEND
#     TEXTURE                             number of the texture in the `TexturePack`, -1 for none
#     SURFACE                             number of the connected surface of a BLEND triangle, a whole number
UV, UV_EDGE_1, UV_EDGE_2, ALPHA, ALPHA_EDGE_1, ALPHA_EDGE_2, CUTOFF, TEXTURE, SURFACE = (
    0, 2, 4, 6, 7, 8, 9, 10, 11
)  # fmt: skip
# A row has 64 bytes, a cache line; the last four columns are unused.
ROW_LENGTH = 16


class AlphaTable(NamedTuple):
    """The K triangles of MASK and BLEND materials whose opacity may be below 1 somewhere.

    Attributes
    ----------
    slot : (T,) int32
        Row in `row` of each triangle of the scene, -1 for all other triangles, which are opaque;
        (0,) if K is 0.
    row : (K, 16) float32
        Data of these triangles, columns UV to SURFACE.
    """

    slot: NDArray[np.int32]
    row: NDArray[np.float32]


def no_alpha() -> AlphaTable:
    """Return the table of a scene whose triangles are all opaque.

    Returns
    -------
    AlphaTable
        Arrays of length 0.
    """
    return AlphaTable(np.zeros(0, np.int32), np.zeros((0, ROW_LENGTH), np.float32))


@inner
def opacity(row, k, pack, b1, b2):  # type: ignore[no-untyped-def]
    """Return the opacity, 0 to 1, of the triangle in row k at barycentrics (b1, b2).

    row : (K, 16) float32, see `AlphaTable`
    pack : TexturePack
    """
    alpha = np.float64(row[k, ALPHA]) + b1 * row[k, ALPHA_EDGE_1] + b2 * row[k, ALPHA_EDGE_2]
    if row[k, TEXTURE] >= np.float32(0.0):
        u = np.float64(row[k, UV]) + b1 * row[k, UV_EDGE_1] + b2 * row[k, UV_EDGE_2]
        v = np.float64(row[k, UV + 1]) + b1 * row[k, UV_EDGE_1 + 1] + b2 * row[k, UV_EDGE_2 + 1]
        alpha *= sample_alpha(pack, np.int64(row[k, TEXTURE]), u, v)
    if row[k, CUTOFF] >= np.float32(0.0):
        # Round alpha to float32, because the weights of a texture lookup may sum to slightly less than 1.
        return 1.0 if np.float32(alpha) >= row[k, CUTOFF] else 0.0
    return smaller(larger(alpha, 0.0), 1.0)


@inner
def opacity_at(shading, t, b1, b2):  # type: ignore[no-untyped-def]
    """Return the opacity, 0 to 1, of triangle t of the scene at barycentrics (b1, b2).

    shading : Shading
    """
    if len(shading.alpha.slot) == 0 or shading.alpha.slot[t] < 0:
        return 1.0
    k = np.int64(shading.alpha.slot[t])
    return opacity(shading.alpha.row, k, shading.pack, np.float64(b1), np.float64(b2))
