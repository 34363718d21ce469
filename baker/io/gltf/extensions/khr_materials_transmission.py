"""Describes KHR_materials_transmission, which `baker.io.gltf.transmission` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_materials_transmission")(
    GltfExtension(
        read="all",
        used="light passes in a straight line, coloured, less the Fresnel reflection",
    )
)
