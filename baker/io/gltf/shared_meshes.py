"""Assigns meshes of the document to baked instances: one mesh for all instances that share TEXCOORD_1.

In glTF a material belongs to the primitives of a mesh. An occlusion texture at another place of the page
therefore needs a mesh of its own, which refers to the same accessors: no data is stored twice.
"""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

from baker.core.atlas import InstanceLayout
from baker.core.errors import InputError
from baker.core.scene import Instance
from baker.io.gltf.ao_materials import BakedUse
from baker.io.gltf.packer import Json, is_index, objects


def own_meshes(
    document: Json, source: Json, instances: Sequence[Instance], layouts: Sequence[InstanceLayout]
) -> list[int]:
    """Assign a mesh to every node with a lightmap, and return the mesh index of each instance.

    Instances that share TEXCOORD_1 get the same mesh; all others have a mesh of their own. The first instance
    of a mesh keeps the mesh's index, and copies of the mesh are appended for the others. If a node without
    a lightmap (for example in another scene) uses the mesh, all instances with a lightmap get copies.

    Parameters
    ----------
    document : dict
        glTF JSON of the output; `meshes` and `nodes` are changed in place.
    source : dict
        glTF JSON of the input.
    instances : sequence of Instance
        The baked instances.
    layouts : sequence of InstanceLayout
        Their lightmap uv.

    Returns
    -------
    list of int
        Index into `document["meshes"]` of each instance.

    Raises
    ------
    InputError
        If one node has several instances.
    """
    lit = {i.node for i, layout in zip(instances, layouts, strict=True) if layout.receives}
    if len({instance.node for instance in instances}) < len(instances):
        raise InputError("a node stands for several instances; baking them apart is not possible")
    taken = {
        node["mesh"] for i, node in objects(source, "nodes") if i not in lit and is_index(node.get("mesh"))
    }
    of_shared: dict[int, int] = {}
    result = []
    for instance, layout in zip(instances, layouts, strict=True):
        mesh = source["nodes"][instance.node]["mesh"]
        if not layout.receives:
            result.append(mesh)
            continue
        number = None if layout.shared is None else layout.shared.number
        if number is not None and number in of_shared:
            mesh = of_shared[number]
        elif mesh in taken:
            document["meshes"].append(copy.deepcopy(source["meshes"][mesh]))
            mesh = len(document["meshes"]) - 1
        taken.add(mesh)
        if number is not None:
            of_shared[number] = mesh
        document["nodes"][instance.node]["mesh"] = mesh
        result.append(mesh)
    return result


def separate_materials(
    document: Json, uses: list[BakedUse], instances: Sequence[tuple[int, InstanceLayout]], meshes: list[int]
) -> tuple[list[BakedUse], list[int]]:
    """Give each instance of a shared mesh primitives of its own, which refer to the same accessors.

    Parameters
    ----------
    document : dict
        glTF JSON; `meshes` and `nodes` are changed in place.
    uses : list of BakedUse
        The primitives of the first instance of each mesh.
    instances : sequence of (int, InstanceLayout)
        Index of the node and lightmap uv of each instance.
    meshes : list of int
        Index of each instance's mesh.

    Returns
    -------
    uses : list of BakedUse
        The primitives of all instances.
    meshes : list of int
        Index of each instance's mesh; no two are equal.
    """
    use_of = {id(use.primitive): use for use in uses}
    found, result, seen = list(uses), [], set[int]()
    for (node, layout), mesh in zip(instances, meshes, strict=True):
        if mesh not in seen:
            seen.add(mesh)
            result.append(mesh)
            continue
        shared = document["meshes"][mesh]
        own = copy.deepcopy(shared)
        for old, new in zip(shared["primitives"], own["primitives"], strict=True):
            use = use_of.get(id(old))
            if use is not None:
                found.append(replace(use, primitive=new, page=layout.page, shared=layout.shared))
        document["meshes"].append(own)
        result.append(len(document["meshes"]) - 1)
        document["nodes"][node]["mesh"] = result[-1]
    return found, result
