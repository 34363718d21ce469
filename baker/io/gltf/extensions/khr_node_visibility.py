"""Describes KHR_node_visibility, which `baker.io.gltf.node` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_node_visibility")(
    GltfExtension(
        read="all",
        used="hidden nodes neither cast nor receive light",
    )
)
