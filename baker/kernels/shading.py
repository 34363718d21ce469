"""The materials of a scene in arrays, from which kernels read base colour, emission and alpha."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.alpha import AlphaTable, no_alpha
from baker.kernels.textures import TexturePack


class Shading(NamedTuple):
    """M materials, their textures, and vertex colours; V lightmap vertices and T triangles.

    Attributes
    ----------
    pack : TexturePack
        All textures.
    base, emission : (M, 3) float32
        Base colour factor, and emission factor in cd/m2; linear Rec.709.
    base_texture, emission_texture : (M,) int32
        Number of the texture in `pack`, -1 for none.
    base_uv, emission_uv : (V, 2) float32
        Image uv of each lightmap vertex for these textures; (1, 2) if no material has such a texture.
    colour : (V, 3) float32
        Linear vertex colour; (1, 3) if no mesh has vertex colours.
    triangle : (T, 3) int32
        Lightmap vertices of each triangle.
    material : (T,) int32
        Material of each triangle.
    alpha : AlphaTable
        Triangles whose opacity may be below 1 somewhere.
    metallic, roughness : (M,) float32
        Metallic and roughness factors. Bakes read neither these two arrays nor the two arrays below.
    reflection_texture : (M,) int32
        Number of the texture that scales metallic (blue) and roughness (green), -1 for none.
    reflection_uv : (V, 2) float32
        Image uv of each lightmap vertex for this texture.
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
