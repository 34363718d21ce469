"""Writes a scene that was not read from glTF as GLB, with all its triangles, including invalid ones.

The repairs of glTF files can then be applied to that GLB. Base colour, emission, alpha and their textures are
written. Data that the importer does not read (bump maps, reflection) is lost.
"""

from __future__ import annotations

import numpy as np

from baker.core.errors import InputError
from baker.core.scene import Scene
from baker.core.source_mesh import SourcePrimitive, SourceScene
from baker.io.gltf.build_document import material_json, scene_name
from baker.io.gltf.packer import Json, Packer


def source_glb(scene: Scene, source: SourceScene) -> bytes:
    """Return a GLB with all meshes that have triangles, without lightmap uv.

    Parameters
    ----------
    scene : Scene
        The scene with the materials.
    source : SourceScene
        The meshes and instances.

    Returns
    -------
    bytes
        The content of the file.

    Raises
    ------
    InputError
        If no mesh has a triangle.
    """
    document: Json = {"asset": {"version": "2.0", "generator": "baker"}}
    packer = Packer(document)
    extensions: set[str] = set()
    images: dict[int, int] = {}
    if scene.materials:
        document["materials"] = [material_json(packer, m, images, extensions) for m in scene.materials]
    filled = [k for k, mesh in enumerate(source.meshes) if any(len(p.triangle) for p in mesh.primitives)]
    document["meshes"] = [
        {
            "name": source.meshes[k].name,
            "primitives": [_primitive(packer, p) for p in source.meshes[k].primitives if len(p.triangle)],
        }
        for k in filled
    ]
    written = {mesh: k for k, mesh in enumerate(filled)}
    nodes: list[Json] = []
    for instance in source.instances:
        if instance.mesh not in written:
            continue
        node: Json = {"name": instance.name, "mesh": written[instance.mesh]}
        if not np.array_equal(instance.world_from_object, np.eye(4)):
            node["matrix"] = instance.world_from_object.T.ravel().tolist()
        nodes.append(node)
    if not nodes:
        message = "the file holds no triangles; export it again"
        raise InputError(message, file=str(scene.path) if scene.path else None)
    document |= {"nodes": nodes, "scenes": [{**scene_name(scene), "nodes": list(range(len(nodes)))}]}
    document["scene"] = 0
    if extensions:
        document["extensionsUsed"] = sorted(extensions)
    return packer.glb()


def _primitive(packer: Packer, arrays: SourcePrimitive) -> Json:
    attributes = {"POSITION": packer.add_floats(arrays.position, bounds=True)}
    if arrays.normal is not None:
        attributes["NORMAL"] = packer.add_floats(arrays.normal)
    for number, uv in sorted(arrays.texcoord.items()):
        attributes[f"TEXCOORD_{number}"] = packer.add_floats(uv)
    if arrays.colour is not None:
        attributes["COLOR_0"] = packer.add_floats(arrays.colour)
    indices = packer.add_indices(arrays.triangle)
    return {"attributes": attributes, "indices": indices, "material": arrays.material}
