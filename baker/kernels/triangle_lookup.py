# mypy: disable-error-code="no-untyped-def"
"""Defines the triangle table of a bake, and finds the lightmap texel of a hit.

The table has one cache line (64 bytes) per triangle.

Every surface blocks light from both sides; the back of a one-sided surface is black.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.trace.jit import inner, larger, smaller

# Columns of `TriangleLookup.row`:
#
#     UV                     lightmap uv of corner 0 (2)
#     UV_EDGE_1, UV_EDGE_2   uv of corner 1 and of corner 2, minus uv of corner 0 (2 each)
#     PAGE                   page of the atlas, a whole number
#     DOUBLE_SIDED           1 if the back has texel entries, else 0
#     FACE_NORMAL            unit normal of the front, world (3)
#     FACE_AREA              m2
#     EMITTER                code of the triangle's emitters, see `kernels.emitters.emitter_at`; -1 for none
#     MATERIAL               number of the material, a whole number
UV, UV_EDGE_1, UV_EDGE_2, PAGE, DOUBLE_SIDED = 0, 2, 4, 6, 7
FACE_NORMAL, FACE_AREA, EMITTER, MATERIAL = 8, 11, 12, 13
# A row has 64 bytes; the last two columns are unused.
ROW_LENGTH = 16
# Return value of `hit_pixel` for the black back of a one-sided surface.
BACK_FACE = -1


class TriangleLookup(NamedTuple):
    """Data of T triangles that kernels read at hits.

    Attributes
    ----------
    row : (T, 16) float32
        One row per triangle, columns UV to MATERIAL.
    size : int
        Width and height of a page, texels.
    n_pixels : int
        Total number of pixels of all pages. The back of pixel p has the number p + n_pixels.
    """

    row: NDArray[np.float32]
    size: int
    n_pixels: int


# The functions below take the fields of `TriangleLookup` as separate arguments. Passing the tuple costs an
# atomic reference count for each array and call, which tripled the time per hit.
@inner
def front_facing(row, prim, dx, dy, dz):
    """Return whether a ray of direction (dx, dy, dz) hits the front of triangle `prim`.

    row : (T, 16) float32, see `TriangleLookup`
    """
    return row[prim, FACE_NORMAL] * dx + row[prim, FACE_NORMAL + 1] * dy + row[
        prim, FACE_NORMAL + 2
    ] * dz < np.float32(0.0)


@inner
def hit_pixel(row, size, n_pixels, prim, u, v, front):
    """Return the number of the pixel at barycentrics (u, v) of triangle `prim`.

    row : (T, 16) float32; size, n_pixels : int, see `TriangleLookup`
    front : whether the ray hit the front
    Returns (page * size + row) * size + column, plus n_pixels on the back of a double-sided triangle, or
    BACK_FACE on the back of a one-sided triangle.
    """
    if not front and row[prim, DOUBLE_SIDED] == np.float32(0.0):
        return np.int64(BACK_FACE)
    x = (row[prim, UV] + u * row[prim, UV_EDGE_1] + v * row[prim, UV_EDGE_2]) * np.float32(size)
    y = (row[prim, UV + 1] + u * row[prim, UV_EDGE_1 + 1] + v * row[prim, UV_EDGE_2 + 1]) * np.float32(size)
    last = np.int32(size - 1)
    column = np.int64(smaller(larger(np.int32(x), np.int32(0)), last))
    line = np.int64(smaller(larger(np.int32(y), np.int32(0)), last))
    pixel = (np.int64(row[prim, PAGE]) * size + line) * size + column
    return pixel if front else pixel + n_pixels
