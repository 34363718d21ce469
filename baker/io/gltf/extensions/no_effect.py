"""Lists the extensions that change neither geometry nor base colour nor emission; files may require them."""

from __future__ import annotations

from baker.io.gltf.extension import GltfExtension, register_all

register_all(
    (
        "KHR_animation_pointer",
        "KHR_materials_anisotropy",
        "KHR_materials_clearcoat",
        "KHR_materials_dispersion",
        "KHR_materials_ior",
        "KHR_materials_iridescence",
        "KHR_materials_sheen",
        "KHR_materials_specular",
        "KHR_xmp_json_ld",
    ),
    GltfExtension(read="nothing", used="nothing"),
)
