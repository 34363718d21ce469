"""Packs what kernels look up at a hit into one cache line a triangle."""

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
    """Return the table for `kernels.triangle_lookup`."""
    row = np.zeros((len(geometry.triangle), ROW_LENGTH), np.float32)
    uv = geometry.uv[geometry.triangle]
    row[:, UV : UV + 2] = uv[:, 0]
    row[:, UV_EDGE_1 : UV_EDGE_1 + 2] = uv[:, 1] - uv[:, 0]
    row[:, UV_EDGE_2 : UV_EDGE_2 + 2] = uv[:, 2] - uv[:, 0]
    row[:, PAGE] = geometry.page
    # Slivers that own no texel may be all that has two sides: then there is no back to look up.
    row[:, DOUBLE_SIDED] = geometry.double_sided & (texels.n > texels.n_front)
    row[:, FACE_NORMAL : FACE_NORMAL + 3] = geometry.face_normal
    row[:, FACE_AREA] = geometry.area
    row[:, EMITTER] = emitters.root
    row[:, MATERIAL] = geometry.material
    return TriangleLookup(row, texels.resolution, len(texels.lookup))
