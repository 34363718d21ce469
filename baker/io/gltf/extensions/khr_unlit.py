"""Describes KHR_materials_unlit, which `baker.io.gltf.material` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_materials_unlit")(
    GltfExtension(
        read="all",
        used="the material blocks light; it reflects light only if the setting `unlit` is lit",
    )
)
