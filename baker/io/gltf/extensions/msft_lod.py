"""Describes MSFT_lod, whose lower levels `baker.io.gltf.lod` leaves out."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("MSFT_lod")(
    GltfExtension(
        read="levels of nodes",
        used="the first level is baked; lower levels neither block nor get light, with a warning",
    )
)
