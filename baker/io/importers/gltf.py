"""Imports glTF 2.0 scenes (.glb, .gltf): nodes, instances, lights.

`world_from_object` is the product of the local matrices `T R S` from the root node down to the node.

Based on: Khronos Group, glTF 2.0 Specification, section 3.5; KHR_lights_punctual.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.scene import Instance, Mesh, PunctualLight, Scene, SceneWarning, SourceDocument
from baker.core.source_mesh import SourceInstance, SourceMesh, SourceScene
from baker.io.gltf.animation import posed_nodes
from baker.io.gltf.camera import read_cameras
from baker.io.gltf.choose_scene import choose_scene
from baker.io.gltf.document import GltfDocument, open_document
from baker.io.gltf.expand import expand_document
from baker.io.gltf.instancing import refuse_broken
from baker.io.gltf.json import JsonObject
from baker.io.gltf.light import read_light
from baker.io.gltf.lod import without_lower_levels
from baker.io.gltf.material import MaterialReader
from baker.io.gltf.mesh import read_primitives
from baker.io.gltf.morph import has_targets, morphed, weights_of
from baker.io.gltf.node import Placed
from baker.io.gltf.skin import Poser
from baker.io.gltf.unread import unneeded_faults
from baker.io.load import IMPORTERS, SceneFile
from baker.io.mesh.build import build_mesh
from baker.topology.triangle_check import LARGEST_COORDINATE

# Smallest divided by largest singular value of a node's matrix. If the ratio does not exceed this number, the
# instance is flat and is left out.
_FLATTEST = 1e-7

# Key of a built mesh: the index of the mesh, and the index of the node if the node has a skin or weights of
# morph targets, else None.
_Key = tuple[int, int | None]


@dataclass(frozen=True)
class _Built:
    """A mesh of the file; if its node has a skin, in the pose of the skin.

    Attributes
    ----------
    number : int, index of `source` in the meshes of the source scene
    mesh : int or None, index in the meshes of the scene; None without a valid triangle
    source : SourceMesh
    extent : (3,) float64, largest absolute object-space coordinate along each axis
    world_from_posed : (4, 4) float64, or None without a skin
    """

    number: int
    mesh: int | None
    source: SourceMesh
    extent: NDArray[np.float64]
    world_from_posed: NDArray[np.float64] | None


@IMPORTERS.register(".glb")
@IMPORTERS.register(".gltf")
def import_gltf(source: SceneFile) -> Scene:
    """Read a glTF file.

    Parameters
    ----------
    source : SceneFile
        The file. `up` and `scale` have no effect, because glTF is +Y up and in metres.

    Raises
    ------
    InputError
        If the file is malformed, requires an unknown extension, or holds nothing to bake.
    """
    document, warnings = expand_document(open_document(source.path, source.data, source.folder))
    if source.up != "y" or source.scale != 1.0:
        message = "up axis and scale are not applied: glTF is +Y up and in metres"
        warnings.append(SceneWarning("up-and-scale-ignored", message))
    nodes = posed_nodes(document, source.options, warnings)
    number, placed = choose_scene(
        document, nodes, source.options.scene_name, warnings, lenient=source.lenient
    )
    placed = without_lower_levels(placed, len(nodes), warnings)
    reader = MaterialReader(document, source.options, reflections=source.reflections)
    meshes, instances, source_scene = _instances(
        document, placed, Poser(document, nodes), reader, warnings, lenient=source.lenient
    )
    lights = _lights(placed, document, warnings, lenient=source.lenient)
    cameras = read_cameras(placed, document, warnings)
    warnings += [*reader.warnings, *reader.notes(), *unneeded_faults(document, reader.reported)]
    if not instances and not source.lenient:
        where = f"scenes[{number}]" if number is not None else None
        detail = "; ".join(f"{w.object}: {w.message}" if w.object else w.message for w in warnings[:3])
        raise InputError(
            f"there is nothing to bake: the scene holds no usable triangle{f' ({detail})' if detail else ''}",
            file=str(source.path),
            object=where,
        )
    return Scene(
        name=source.path.name.split(".")[0],
        path=source.path,
        meshes=tuple(meshes),
        materials=tuple(reader.materials),
        instances=tuple(instances),
        lights=tuple(lights),
        warnings=tuple(warnings),
        source=SourceDocument(
            document.root.value,
            document.buffers,
            document.folder.path,
            document.folder.allow_outside,
            missing=frozenset(document.buffer_faults),
            missing_images=frozenset(document.image_faults),
            chunks=document.chunks,
        ),
        sha256=document.sha256,
        cameras=tuple(cameras),
        source_scene=source_scene,
    )


def _instances(
    document: GltfDocument,
    placed: list[Placed],
    poser: Poser,
    reader: MaterialReader,
    warnings: list[SceneWarning],
    *,
    lenient: bool,
) -> tuple[list[Mesh], list[Instance], SourceScene | None]:
    """Return the distinct meshes in use, the instances, and the source scene (None unless `lenient`)."""
    sources = document.root.children("meshes")
    built: dict[_Key, _Built] = {}
    users = _users(placed, sources)
    meshes: list[Mesh] = []
    instances: list[Instance] = []
    shown: list[SourceInstance] = []
    for node in placed:
        if "mesh" not in node.json:
            continue
        refuse_broken(document, node.json)
        number = node.json.index("mesh", len(sources), "meshes")
        name = sources[number].string("name", f"mesh_{number}")
        # A skinned mesh is transformed by its joints, not by its node's matrix, and nodes may have weights of
        # morph targets. Build a mesh for each such node.
        key = _key(node, number)
        if key not in built:
            arrays, found = read_primitives(document, sources[number], name, reader, lenient=lenient)
            if has_targets(sources[number]):
                arrays = morphed(document, sources[number], arrays, weights_of(sources[number], node.json))
                message = "the mesh has morph targets; it is baked with the weights of the file"
                found.append(SceneWarning("morphed", message, name))
            posed = None
            if "skin" in node.json:
                arrays, posed = poser.pose(sources[number], arrays, node)
            mesh, defects = build_mesh(name, arrays, reader.materials)
            warnings += found + [_with_nodes(defect, users[key]) for defect in defects]
            if mesh is None:
                warnings.append(
                    SceneWarning("no-triangles", "the mesh has no usable triangle and is left out", name)
                )
            source_mesh = SourceMesh(name, tuple(arrays) if lenient else ())
            extent = np.zeros(3) if mesh is None else np.abs(mesh.position).max(axis=0).astype(np.float64)
            built[key] = _Built(len(built), None if mesh is None else len(meshes), source_mesh, extent, posed)
            meshes += [] if mesh is None else [mesh]
        made = built[key]
        label = node.json.string("name", name)
        if made.world_from_posed is not None:
            node = Placed(node.index, node.json, made.world_from_posed)
            message = "the mesh is skinned; it is baked in the pose that its joints have in the file"
            warnings.append(SceneWarning("skinned", message, label))
        shown.append(SourceInstance(node.index, label, made.number, node.matrix))
        if made.mesh is not None and _is_usable(node, made.extent, label, warnings):
            instances.append(Instance(node.index, label, made.mesh, node.matrix))
    kept = SourceScene(tuple(made.source for made in built.values()), tuple(shown)) if lenient else None
    return *_drop_unused(meshes, instances), kept


def _key(node: Placed, number: int) -> _Key:
    """Return the key of the mesh that is built for a node with mesh `number`."""
    return number, node.index if "skin" in node.json or "weights" in node.json else None


def _users(placed: list[Placed], sources: list[JsonObject]) -> dict[_Key, list[str]]:
    """Return the names of the nodes that use each mesh to build."""
    users: dict[_Key, list[str]] = {}
    for node in placed:
        if "mesh" in node.json:
            number = node.json.index("mesh", len(sources), "meshes")
            name = node.json.string("name", "") or f"node {node.index}"
            users.setdefault(_key(node, number), []).append(name)
    return users


def _with_nodes(defect: SceneWarning, nodes: list[str]) -> SceneWarning:
    """Return a warning, extended by the first node that uses the mesh and the number of other nodes."""
    if nodes == [defect.object]:
        return defect
    more = f" and {len(nodes) - 1} more" if len(nodes) > 1 else ""
    return replace(defect, message=f"{defect.message} (mesh of '{nodes[0]}'{more})")


def _is_usable(node: Placed, extent: NDArray[np.float64], label: str, warnings: list[SceneWarning]) -> bool:
    """Return whether an instance can be baked; `extent` is that of its mesh, see `_Built`."""
    singular = np.linalg.svd(node.matrix[:3, :3], compute_uv=False)
    if not singular[2] > _FLATTEST * singular[0]:
        message = "the node's scale is zero along an axis; the instance is left out"
        warnings.append(SceneWarning("flat-instance", message, label))
        return False
    with np.errstate(over="ignore"):
        largest = np.abs(node.matrix[:3, :3]) @ extent + np.abs(node.matrix[:3, 3])
    if not (largest <= LARGEST_COORDINATE).all():
        node.json.fail(f"the node places its mesh further than {LARGEST_COORDINATE:g} m away")
    return True


def _drop_unused(meshes: list[Mesh], instances: list[Instance]) -> tuple[list[Mesh], list[Instance]]:
    used = sorted({instance.mesh for instance in instances})
    if len(used) == len(meshes):
        return meshes, instances
    renumbered = {old: new for new, old in enumerate(used)}
    moved = [Instance(i.node, i.name, renumbered[i.mesh], i.world_from_object) for i in instances]
    return [meshes[k] for k in used], moved


def _lights(
    placed: list[Placed], document: GltfDocument, warnings: list[SceneWarning], *, lenient: bool
) -> list[PunctualLight]:
    extension = document.root.extension("KHR_lights_punctual")
    known: list[JsonObject] = extension.children("lights") if extension is not None else []
    lights = []
    for node in placed:
        reference = node.json.extension("KHR_lights_punctual")
        if reference is None:
            continue
        light = known[reference.index("light", len(known), "lights")]
        made = read_light(light, node, warnings, lenient=lenient)
        lights += [] if made is None else [made]
    return lights
