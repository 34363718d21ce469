"""Describes KHR_materials_ior, which `baker.io.gltf.transmission` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_materials_ior")(
    GltfExtension(
        read="all",
        used="Fresnel reflection of materials that transmit light",
    )
)
