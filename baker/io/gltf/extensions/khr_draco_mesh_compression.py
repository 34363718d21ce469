"""Describes KHR_draco_mesh_compression, which `baker.io.gltf.draco_primitives` decodes."""

from __future__ import annotations

from baker.io.gltf.draco_primitives import decode_primitives
from baker.io.gltf.extension import EXTENSIONS, GltfExtension

EXTENSIONS.register("KHR_draco_mesh_compression")(
    GltfExtension(
        read="triangles and all attributes",
        used="all data",
        kept="no, the data is uncompressed",
        decode=decode_primitives,
    )
)
