"""Repairs a mesh, and measures the distance between the repaired and the original surface."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from baker.core.source_mesh import SourceInstance
from baker.io.gltf.edited_primitive import EditedPrimitive, ReplacedPrimitive
from baker.repairs.mesh_plan import Change
from baker.repairs.primitive_edit import EditablePrimitive, apply_edit
from baker.repairs.remesh import needs_remeshing, remesh_primitive
from baker.repairs.shape_repair import FURTHEST, ShapeRepair, repair_shape
from baker.repairs.welded_mesh import WeldedMesh, distance, weld_primitives
from baker.repairs.winding import count_edges


@dataclass(frozen=True)
class MeshRepair:
    """The result of repairing one mesh.

    Attributes
    ----------
    made : dict of int to EditedPrimitive or ReplacedPrimitive
        The new primitives, by their index in the mesh. Empty if the mesh is not changed.
    changes : tuple of Change
    left : tuple of str
        One sentence for each defect that is not repaired, with the reason.
    """

    made: dict[int, EditedPrimitive | ReplacedPrimitive]
    changes: tuple[Change, ...]
    left: tuple[str, ...]


def repair_mesh(primitives: list[EditablePrimitive], textured: bool, shown: SourceInstance) -> MeshRepair:
    """Repair one mesh, unless this moves its surface by more than `shape_repair.FURTHEST` allows.

    Parameters
    ----------
    primitives : list of EditablePrimitive
        The primitives of the mesh.
    textured : bool
        Whether a texture uses the mesh's uv. The mesh is then not remeshed, because new vertices have no uv.
    shown : SourceInstance
        The first instance of the mesh. Its scale converts distances to metres.

    Returns
    -------
    MeshRepair
        The new primitives, the changes, and the defects that remain.
    """
    mesh = weld_primitives(primitives)
    if not len(mesh.triangle):
        return MeshRepair({}, (), ())
    locked = next((p.locked for p in primitives if p.locked), "")
    if locked:
        why = f"its shape is not repaired: {locked}"
        return MeshRepair({}, (), (why,) if _needs_repair(mesh) else ())
    repair = repair_shape(primitives)
    left, changes = list(repair.left), list(repair.changes)
    made: dict[int, EditedPrimitive | ReplacedPrimitive] = {}
    for edit in repair.edits:
        edited = apply_edit(edit)
        if edited is not None:
            made[edit.primitive.arrays.index] = edited
    after = repair.after
    if needs_remeshing(repair.after):
        if len(primitives) > 1 or textured:
            why = "its textures would lose their uv" if textured else "it has several primitives"
            left.append(f"its slivers stay: {why}")
        else:
            after = _remesh(repair, made, changes)
    if not changes:
        return MeshRepair({}, (), tuple(left))
    scale = float(np.linalg.norm(shown.world_from_object[:3, :3], 2))
    moved = distance(repair.before, after)
    if moved > FURTHEST * mesh.diagonal:
        far = f"{moved * scale:.3g} m, {moved / mesh.diagonal:.1%} of its size"
        left.append(f"its shape is not repaired: the surface would move by {far}")
        return MeshRepair({}, (), tuple(left))
    measured = tuple(replace(change, distance=moved * scale) for change in changes)
    return MeshRepair(made, measured, tuple(left))


def _remesh(
    repair: ShapeRepair, made: dict[int, EditedPrimitive | ReplacedPrimitive], changes: list[Change]
) -> WeldedMesh:
    """Remesh a repaired mesh that has one primitive, and return the new mesh.

    The new primitive is added to `made`, and the changes to `changes`.
    """
    new = remesh_primitive(repair.after, repair.edits[0])
    made[repair.edits[0].primitive.arrays.index] = new.made
    face = new.made.triangle
    changes.append(Change("slivers", "slivers", new.n_before, new.n_after))
    changes.append(Change("remeshed", "faces", len(repair.after.triangle), len(face), lost=new.lost))
    return WeldedMesh(new.made.position, face, np.zeros(len(face), np.int64), face)


def _needs_repair(mesh: WeldedMesh) -> bool:
    return bool((count_edges(mesh.triangle) > 2).any()) or needs_remeshing(mesh)
