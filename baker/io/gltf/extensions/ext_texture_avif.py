"""Describes EXT_texture_avif, which `baker.io.gltf.texture` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("EXT_texture_avif")(
    GltfExtension(
        read="all, if Pillow can decode AVIF; else the fallback of the texture",
        used="textures",
    )
)
