"""Describes EXT_mesh_gpu_instancing, which `baker.io.gltf.instancing` expands to nodes."""

from __future__ import annotations

from baker.io.gltf.extension import EXTENSIONS, GltfExtension
from baker.io.gltf.instancing import spread_instances

EXTENSIONS.register("EXT_mesh_gpu_instancing")(
    GltfExtension(
        read="all",
        used="every instance is baked",
        kept="as nodes, one for each instance",
        expand=spread_instances,
    )
)
