"""Describes KHR_materials_transmission; the reader of materials warns for each material that transmits."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, UNKNOWN, GltfExtension

EXTENSIONS.register("KHR_materials_transmission")(
    GltfExtension(
        read="transmission factor, for a warning",
        used="nothing: the material blocks light",
        refused=UNKNOWN,
    )
)
