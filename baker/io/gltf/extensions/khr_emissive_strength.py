"""Describes KHR_materials_emissive_strength, which `baker.io.gltf.material` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_materials_emissive_strength")(
    GltfExtension(
        read="all",
        used="factor of the emitted radiance",
    )
)
