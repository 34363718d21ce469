"""Describes KHR_lights_punctual, which `baker.io.gltf.light` reads."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_lights_punctual")(
    GltfExtension(
        read="all",
        used="point, spot and directional lights",
    )
)
