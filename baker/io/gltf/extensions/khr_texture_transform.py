"""Describes KHR_texture_transform, which `baker.io.gltf.texture` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_texture_transform")(
    GltfExtension(
        read="all",
        used="uv of textures",
    )
)
