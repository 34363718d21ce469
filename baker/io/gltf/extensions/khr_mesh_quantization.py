"""Describes KHR_mesh_quantization, which `baker.io.gltf.accessor` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_mesh_quantization")(
    GltfExtension(
        read="all",
        used="vertices of 8 and 16 bits",
    )
)
