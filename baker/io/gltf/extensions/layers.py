"""Lists the extensions of materials that are ignored with a warning and keep the material's base colour."""

from __future__ import annotations

from baker.io.gltf.extension import UNKNOWN, GltfExtension, register_all

register_all(
    (
        "ADOBE_materials_clearcoat_specular",
        "ADOBE_materials_clearcoat_tint",
        "ADOBE_materials_thin_transparency",
        "KHR_materials_diffuse_transmission",
        "KHR_materials_subsurface",
        "KHR_materials_volume",
        "KHR_materials_volume_scatter",
        "MSFT_lod",
        "MSFT_packing_normalRoughnessMetallic",
        "MSFT_packing_occlusionRoughnessMetallic",
        "VRMC_materials_hdr_emissiveMultiplier",
    ),
    GltfExtension(read="nothing", used="nothing, with a warning", refused=UNKNOWN, ignored=True),
)
