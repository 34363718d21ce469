"""Describes KHR_texture_basisu, which `baker.io.gltf.texture` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_texture_basisu")(
    GltfExtension(
        read="the fallback of the texture; without one, KTX2 files (`pip install opengl-basisu`)",
        used="textures",
    )
)
