"""Describes EXT_texture_webp, which `baker.io.gltf.texture` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("EXT_texture_webp")(
    GltfExtension(
        read="all",
        used="textures",
    )
)
