"""Describes KHR_materials_pbrSpecularGlossiness, which `baker.io.gltf.surface` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_materials_pbrSpecularGlossiness")(
    GltfExtension(
        read="diffuse factor and texture, glossiness factor",
        used="base colour, roughness of `render`",
    )
)
