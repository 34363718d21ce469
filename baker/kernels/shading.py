"""Materials of all triangles, as kernels read them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.alpha import AlphaTable, no_alpha
from baker.kernels.textures import TexturePack


class Shading(NamedTuple):
    """Materials, textures and vertex colours of M materials, V lightmap vertices and T triangles.

    Attributes
    ----------
    pack : TexturePack
        All textures.
    base, emission : (M, 3) float32
        Factors of base colour, and of emission in cd/m2; linear Rec.709.
    base_texture, emission_texture : (M,) int32
        Number of the texture in `pack`, -1 for none.
    base_uv, emission_uv : (V, 2) float32
        Image uv of each lightmap vertex, for the material of its triangles; (1, 2) if nothing is textured.
    colour : (V, 3) float32
        Linear vertex colour; (1, 3) if no mesh has any.
    triangle : (T, 3) int32
        Lightmap vertices.
    material : (T,) int32
    alpha : AlphaTable
        Triangles that let light through.
    metallic, roughness : (M,) float32
        Factors.
    reflection_texture : (M,) int32
        Number of the texture that scales metallic (blue) and roughness (green), -1 for none. Only for
        reflections: bakes leave the four arrays at their defaults or unused.
    reflection_uv : (V, 2) float32
        Its image uv.
    """

    pack: TexturePack
    base: NDArray[np.float32]
    emission: NDArray[np.float32]
    base_texture: NDArray[np.int32]
    emission_texture: NDArray[np.int32]
    base_uv: NDArray[np.float32]
    emission_uv: NDArray[np.float32]
    colour: NDArray[np.float32]
    triangle: NDArray[np.int32]
    material: NDArray[np.int32]
    alpha: AlphaTable = no_alpha()
    metallic: NDArray[np.float32] = np.zeros(0, np.float32)
    roughness: NDArray[np.float32] = np.zeros(0, np.float32)
    reflection_texture: NDArray[np.int32] = np.zeros(0, np.int32)
    reflection_uv: NDArray[np.float32] = np.zeros((1, 2), np.float32)
