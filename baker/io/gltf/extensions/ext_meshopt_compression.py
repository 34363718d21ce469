"""Describes EXT_meshopt_compression, which `baker.io.gltf.compressed_views` decodes."""

from __future__ import annotations

from baker.io.gltf.compressed_views import decode_views
from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("EXT_meshopt_compression")(
    GltfExtension(
        read="all modes and filters, versions 0 and 1",
        used="all data",
        kept="no, the data is uncompressed",
        decode=decode_views,
    )
)
