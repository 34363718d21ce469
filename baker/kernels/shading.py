"""Materials of all triangles, as kernels take them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.alpha import AlphaTable, no_alpha
from baker.kernels.textures import TexturePack


class Shading(NamedTuple):
    """What kernels need to know of materials.

    Attributes
    ----------
    pack : TexturePack
    base, emission : (M, 3) float32
    base_texture, emission_texture : (M,) int32, -1 for none
    base_uv, emission_uv : (V, 2) float32, by lightmap vertex (of the material its triangles have)
    colour : (V, 3) float32, linear vertex colour
    triangle : (T, 3) int32, lightmap vertices; material : (T,) int32
    alpha : AlphaTable
    metallic, roughness : (M,) float32; reflection_texture (M,) int32 and reflection_uv (V, 2) float32 of the
        texture that scales them (blue, green), only if asked for
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
