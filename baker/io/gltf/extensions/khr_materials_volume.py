"""Describes KHR_materials_volume, which `baker.io.gltf.transmission` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_materials_volume")(
    GltfExtension(
        read="attenuation, thickness factor",
        used="colour of transmitted light: half of the attenuation at each crossing of the surface",
    )
)
