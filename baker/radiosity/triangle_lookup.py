"""Packs what kernels look up at a hit into one cache line a triangle."""

from __future__ import annotations

import numpy as np

from baker.core.geometry import Geometry
from baker.core.texels import TexelBuffer
from baker.kernels.emitters import Emitters
from baker.kernels.triangle_lookup import TriangleLookup


def build_triangle_lookup(geometry: Geometry, texels: TexelBuffer, emitters: Emitters) -> TriangleLookup:
    """Return the table for `kernels.triangle_lookup`."""
    row = np.zeros((len(geometry.triangle), 16), np.float32)
    uv = geometry.uv[geometry.triangle]
    row[:, 0:2] = uv[:, 0]
    row[:, 2:4] = uv[:, 1] - uv[:, 0]
    row[:, 4:6] = uv[:, 2] - uv[:, 0]
    row[:, 6] = geometry.page
    # Slivers that own no texel may be all that has two sides: then there is no back to look up.
    row[:, 7] = geometry.double_sided & (texels.n > texels.n_front)
    row[:, 8:11] = geometry.face_normal
    row[:, 11] = geometry.area
    row[:, 12] = emitters.root
    row[:, 13] = geometry.material
    return TriangleLookup(row, texels.resolution, len(texels.lookup))
