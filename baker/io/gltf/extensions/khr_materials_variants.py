"""Describes KHR_materials_variants, which `baker.io.gltf.variant` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_materials_variants")(
    GltfExtension(
        read="all",
        used="materials of the variant that the setting `variant` names",
        kept="yes, with all variants",
    )
)
