"""Builds the triangle table of a bake, with one cache line (64 bytes) per triangle."""

from __future__ import annotations

import numpy as np

from baker.core.geometry import Geometry
from baker.core.texels import TexelBuffer
from baker.kernels.emitters import Emitters
from baker.kernels.triangle_lookup import (
    DOUBLE_SIDED,
    EMITTER,
    FACE_AREA,
    FACE_NORMAL,
    MATERIAL,
    PAGE,
    ROW_LENGTH,
    UV,
    UV_EDGE_1,
    UV_EDGE_2,
    TriangleLookup,
)


def build_triangle_lookup(geometry: Geometry, texels: TexelBuffer, emitters: Emitters) -> TriangleLookup:
    """Build the table from which kernels read the data of a hit triangle.

    Parameters
    ----------
    geometry : Geometry
        The T triangles.
    texels : TexelBuffer
        Texels of these triangles.
    emitters : Emitters
        Emitters of these triangles.

    Returns
    -------
    TriangleLookup
        One row per triangle.
    """
    row = np.zeros((len(geometry.triangle), ROW_LENGTH), np.float32)
    uv = geometry.uv[geometry.triangle]
    row[:, UV : UV + 2] = uv[:, 0]
    row[:, UV_EDGE_1 : UV_EDGE_1 + 2] = uv[:, 1] - uv[:, 0]
    row[:, UV_EDGE_2 : UV_EDGE_2 + 2] = uv[:, 2] - uv[:, 0]
    row[:, PAGE] = geometry.page
    # `texels` has an entry for the back of each texel that a double-sided triangle covers. Without such
    # entries, mark all triangles as one-sided, because lookups of backs would read past the end of `lookup`.
    row[:, DOUBLE_SIDED] = geometry.double_sided & (texels.n > texels.n_front)
    row[:, FACE_NORMAL : FACE_NORMAL + 3] = geometry.face_normal
    row[:, FACE_AREA] = geometry.area
    row[:, EMITTER] = emitters.root
    row[:, MATERIAL] = geometry.material
    return TriangleLookup(row, texels.resolution, len(texels.lookup))
