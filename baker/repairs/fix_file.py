"""Reads a scene, fixes its meshes one by one, and makes a GLB of the result."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress, report, silent
from baker.core.result import Result
from baker.core.scene import Scene, SourceDocument
from baker.core.source_mesh import SourceInstance, SourceMesh, SourcePrimitive, SourceScene
from baker.core.stage import Stage
from baker.io.gltf.ao_materials import material_holders, reads_texcoord_1, reads_texture
from baker.io.gltf.edited_primitive import EditedPrimitive, ReplacedPrimitive
from baker.io.gltf.packer import objects
from baker.io.gltf.primitive_columns import read_columns, why_locked
from baker.io.gltf.uri import is_data
from baker.io.gltf.write_fixed import write_fixed
from baker.io.gltf.write_source import source_glb
from baker.io.load import IMPORTERS, SceneFile, load_scene, read_scene_file
from baker.repairs.inside_out import faces_to_flip
from baker.repairs.lightmap_uv import UvRequest, new_lightmap_uv
from baker.repairs.mesh_plan import Change, plan_mesh
from baker.repairs.mesh_repair import repair_mesh
from baker.repairs.meshlab import require_meshlab
from baker.repairs.primitive_edit import EditablePrimitive, apply_edit
from baker.repairs.settings import RepairSettings
from baker.topology.triangle_check import face_normal, in_range


@dataclass(frozen=True)
class Fix:
    """A change of the mesh of an object.

    Attributes
    ----------
    object : str
        Name of the first node that has the mesh.
    node : int
        Index of this node.
    change : Change
    """

    object: str
    node: int
    change: Change


@dataclass(frozen=True)
class LeftAlone:
    """A defect that was found but not fixed.

    Attributes
    ----------
    object : str
        Name of the first node that has the mesh.
    node : int
        Index of this node.
    reason : str
        A sentence that states the defect and why it was not fixed.
    """

    object: str
    node: int
    reason: str


@dataclass(frozen=True, repr=False)
class FixResult(Result):
    """A fixed scene.

    Attributes
    ----------
    data : bytes
        The fixed scene as GLB. If the input is a GLB that names no other file, and nothing was fixed, these
        are the bytes of the input.
    fixed : tuple of Fix
    left_alone : tuple of LeftAlone
    """

    data: bytes
    fixed: tuple[Fix, ...]
    left_alone: tuple[LeftAlone, ...]

    def summary(self) -> dict[str, Any]:
        """Return the names and values that the short text shows."""
        return {"fixed": len(self.fixed), "left alone": len(self.left_alone)}

    def to_dict(self) -> dict[str, Any]:
        """Return the keys `fixed` and `left_alone` of the JSON object that `baker check --json` prints."""
        return {
            "fixed": [
                {"object": fix.object, "node": fix.node, **_change_json(fix.change)} for fix in self.fixed
            ],
            "left_alone": [
                {"object": left.object, "node": left.node, "reason": left.reason} for left in self.left_alone
            ],
        }


def _change_json(change: Change) -> dict[str, Any]:
    value: dict[str, Any] = {
        "change": change.change,
        "counted": change.counted,
        "before": change.before,
        "after": change.after,
    }
    if change.distance is not None:
        value["distance"] = change.distance
    if change.lost:
        value["lost"] = list(change.lost)
    return value


def fix_file(path: Path, settings: RepairSettings | None = None, progress: Progress = silent) -> FixResult:
    """Fix a scene file.

    Parameters
    ----------
    path : Path
        The file, in any format that can be read. It is not changed.
    settings : RepairSettings
        Lightmap resolution, up axis and scale of the file, and whether shapes are repaired.
    progress : Progress
        Called with the stages "fix" and "repair"; a truthy return value stops the work.

    Returns
    -------
    FixResult
        The GLB, the changes made, and the defects that were not fixed.

    Raises
    ------
    InputError
        If the file cannot be read.
    ResourceError
        If `settings.repair` is set, and pymeshlab is not installed or fails.
    Cancelled
        If `progress` returned a truthy value.
    """
    settings = settings or RepairSettings()
    if settings.repair:
        require_meshlab()
    allowed = settings.allow_outside
    read = partial(_read_glb, path, allow_outside=allowed)
    scene = load_scene(path, up=settings.up, scale=settings.scale, lenient=True, allow_outside=allowed)
    data: bytes | None = None
    if scene.source is None:
        # Convert other formats to GLB, defective triangles included, and fix the GLB.
        assert scene.source_scene is not None
        data = source_glb(scene, scene.source_scene)
        scene = read(data)
    elif not _names_files(scene.source):
        written = read_scene_file(path)
        data = written if written[:4] == b"glTF" else None
    result = _fix(scene, data, settings, progress, make_normals=not settings.repair)
    if settings.repair:
        result = _repair(read(result.data), result, progress)
        # Fix again, because repaired meshes may have duplicate vertices, no normals or invalid lightmap uv.
        result = _joined(result, _fix(read(result.data), result.data, settings, progress))
    fixed = read(result.data)
    wrong = faces_to_flip(fixed)
    if wrong:
        result = _joined(result, _fix(fixed, result.data, settings, progress, inside_out=wrong))
    return result


def _joined(first: FixResult, second: FixResult) -> FixResult:
    """Combine the results of two successive calls of `_fix`; a defect that neither fixed is listed once."""
    left = dict.fromkeys((*first.left_alone, *second.left_alone))
    return FixResult(second.data, (*first.fixed, *second.fixed), tuple(left))


def _fix(
    scene: Scene,
    data: bytes | None,
    settings: RepairSettings,
    progress: Progress,
    *,
    make_normals: bool = True,
    inside_out: Mapping[int, Sequence[NDArray[np.bool_]]] | None = None,
) -> FixResult:
    """Fix a scene by changes that are not visible.

    `data` are the bytes of the scene's GLB. If nothing is fixed, these bytes are returned. If `data` is None,
    a GLB is always written. `inside_out` has, by mesh, the faces that `faces_to_flip` returns.
    """
    source, source_scene = _parsed(scene)
    area = _area_shares(source_scene)
    edited: dict[tuple[int, int], EditedPrimitive] = {}
    fixed: list[Fix] = []
    left: list[LeftAlone] = []
    for number, mesh, shown in _shown_meshes(source_scene):
        report(progress, Stage.FIX, number / len(source_scene.meshes), mesh.name)
        name, node = shown[0].name, shown[0].node
        index = source.json["nodes"][node]["mesh"]
        plan = plan_mesh(
            _editable(source, index, mesh),
            make_normals=make_normals,
            inside_out=(inside_out or {}).get(number),
        )
        request = UvRequest(settings.resolution, area[number], settings.threads)
        plan, uv = new_lightmap_uv(plan, shown, request, _within(progress, number, len(source_scene.meshes)))
        for k, edit in enumerate(plan.edits):
            made = apply_edit(edit, None if uv is None else uv[k])
            if made is not None:
                edited[index, edit.primitive.arrays.index] = made
        fixed += [Fix(name, node, change) for change in plan.changes]
        left += [LeftAlone(name, node, reason) for reason in plan.left]
    report(progress, Stage.FIX, 1.0)
    if edited or data is None:
        data = write_fixed(source, edited)
    return FixResult(data, tuple(fixed), tuple(left))


def _repair(scene: Scene, first: FixResult, progress: Progress) -> FixResult:
    """Repair the shapes of a fixed scene. The result lists the fixes in `first` before the repairs."""
    source, source_scene = _parsed(scene)
    made: dict[tuple[int, int], EditedPrimitive | ReplacedPrimitive] = {}
    fixed, left = list(first.fixed), []
    for number, mesh, shown in _shown_meshes(source_scene):
        report(progress, Stage.REPAIR, number / len(source_scene.meshes), mesh.name)
        name, node = shown[0].name, shown[0].node
        index = source.json["nodes"][node]["mesh"]
        primitives = source.json["meshes"][index]["primitives"]
        textured = any(reads_texture(source.json, primitives[arrays.index]) for arrays in mesh.primitives)
        repair = repair_mesh(_editable(source, index, mesh), textured, shown[0])
        made |= {(index, primitive): new for primitive, new in repair.made.items()}
        fixed += [Fix(name, node, change) for change in repair.changes]
        left += [LeftAlone(name, node, reason) for reason in repair.left]
    report(progress, Stage.REPAIR, 1.0)
    return FixResult(write_fixed(source, made) if made else first.data, tuple(fixed), tuple(left))


def _parsed(scene: Scene) -> tuple[SourceDocument, SourceScene]:
    assert scene.source is not None
    assert scene.source_scene is not None
    return scene.source, scene.source_scene


def _shown_meshes(source_scene: SourceScene) -> Iterator[tuple[int, SourceMesh, list[SourceInstance]]]:
    """Yield each mesh that has triangles: its number, the mesh, and its instances."""
    for number, mesh in enumerate(source_scene.meshes):
        if mesh.primitives:
            yield number, mesh, [instance for instance in source_scene.instances if instance.mesh == number]


def _names_files(source: SourceDocument) -> bool:
    """Return whether a glTF document refers to other files."""
    uris = (thing.get("uri") for key in ("images", "buffers") for _, thing in objects(source.json, key))
    return any(isinstance(uri, str) and not is_data(uri) for uri in uris)


def _read_glb(path: Path, data: bytes, *, allow_outside: bool) -> Scene:
    return IMPORTERS.require(".glb", "importer")(
        SceneFile(path, data, lenient=True, allow_outside=allow_outside)
    )


def _within(progress: Progress, number: int, count: int) -> Progress:
    """Return a progress callback that converts a fraction of mesh `number` to one of all `count` meshes."""
    return lambda stage, fraction, detail="": progress(Stage.FIX, (number + fraction) / count, detail)


def _area_shares(source_scene: SourceScene) -> NDArray[np.float64]:
    """Return each mesh's share of the total area in world space, (M,) float64.

    The area of a mesh is that of its first instance.
    """
    area = np.zeros(len(source_scene.meshes))
    for instance in source_scene.instances:
        if area[instance.mesh] == 0.0:
            linear = instance.world_from_object[:3, :3]
            for arrays in source_scene.meshes[instance.mesh].primitives:
                triangle = arrays.triangle[_in_range(arrays)]
                with np.errstate(over="ignore", invalid="ignore"):
                    normal = face_normal(arrays.position, triangle) @ np.linalg.pinv(linear)
                    size = 0.5 * np.linalg.norm(normal, axis=1) * abs(np.linalg.det(linear))
                area[instance.mesh] += float(size[np.isfinite(size)].sum())
    return np.asarray(area / max(float(area.sum()), 1e-300))


def _in_range(arrays: SourcePrimitive) -> NDArray[np.bool_]:
    """Return (T,) bool: the faces whose three indices refer to existing vertices."""
    n = np.full(len(arrays.triangle), len(arrays.position))
    return in_range(arrays.triangle, np.zeros_like(n), n)


def _editable(source: SourceDocument, index: int, mesh: SourceMesh) -> list[EditablePrimitive]:
    """Return the primitives of a mesh, with the limits of their edits; `index` is its number in the file."""
    document = source.json
    primitives = document["meshes"][index]["primitives"]
    found = []
    for arrays in mesh.primitives:
        primitive = primitives[arrays.index]
        # A material variant may replace the material, so an edit must be invisible with every material.
        materials = [
            document["materials"][holder["material"]] if "material" in holder else {}
            for holder in material_holders(primitive)
        ]
        locked = why_locked(source, index, primitive)
        good = _in_range(arrays)
        if not good.all():
            arrays = replace(arrays, triangle=arrays.triangle[good])
            locked = f"{int((~good).sum())} of its faces name vertices that do not exist; export it again"
        found.append(
            EditablePrimitive(
                arrays=arrays,
                column=read_columns(source, primitive),
                double_sided=all(material.get("doubleSided", False) for material in materials),
                blends=any(material.get("alphaMode") == "BLEND" for material in materials),
                reads_lightmap_uv=reads_texcoord_1(document, primitive, occlusion=True),
                locked=locked,
            )
        )
    return found
