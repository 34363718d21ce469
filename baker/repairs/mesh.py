"""Repairs the meshes of a document one by one, and measures how far each surface moved."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from baker.core.source_mesh import SourceInstance
from baker.io.gltf.edited_primitive import EditedPrimitive, ReplacedPrimitive
from baker.repairs.part import Part
from baker.repairs.plan import Change, finish_part
from baker.repairs.slivers import is_needle_mesh, remesh_part
from baker.repairs.surface import FURTHEST, Surface, distance, join, repair_surface
from baker.repairs.winding import count_edges


@dataclass(frozen=True)
class MeshRepair:
    """What was made of one mesh.

    Attributes
    ----------
    made : dict
        The new primitives by their number in the mesh; empty if it stays as it is.
    changes : tuple of Change
    left : tuple of str
    """

    made: dict[int, EditedPrimitive | ReplacedPrimitive]
    changes: tuple[Change, ...]
    left: tuple[str, ...]


def repair_mesh(parts: list[Part], textured: bool, shown: SourceInstance) -> MeshRepair:
    """Repair one mesh, unless that moved its surface too far.

    Parameters
    ----------
    parts : list of Part
    textured : bool
        A texture reads the mesh's uv, so that new vertices would lose it.
    shown : SourceInstance
        Its scale makes metres of the distance.
    """
    surface = join(parts)
    if not len(surface.triangle):
        return MeshRepair({}, (), ())
    locked = next((part.locked for part in parts if part.locked), "")
    if locked:
        why = f"its shape is not repaired: {locked}"
        return MeshRepair({}, (), (why,) if _needs_repair(surface) else ())
    repair = repair_surface(parts)
    left, changes = list(repair.left), list(repair.changes)
    made: dict[int, EditedPrimitive | ReplacedPrimitive] = {}
    for plan in repair.parts:
        finished = finish_part(plan)
        if finished is not None:
            made[plan.part.arrays.index] = finished
    after = repair.after
    if is_needle_mesh(repair.after):
        if len(parts) > 1 or textured:
            why = "its textures would lose their uv" if textured else "it has several primitives"
            left.append(f"its needle-shaped faces stay: {why}")
        else:
            plan = repair.parts[0]
            new = remesh_part(repair.after, plan)
            made[parts[0].arrays.index] = new.made
            face = new.made.triangle
            after = Surface(new.made.position, face, np.zeros(len(face), np.int64), face)
            changes.append(Change("needles", "needle-shaped faces", new.n_before, new.n_after))
            n_faces = len(repair.after.triangle), len(face)
            changes.append(Change("remeshed", "faces", *n_faces, lost=new.lost))
    if not changes:
        return MeshRepair({}, (), tuple(left))
    scale = float(np.linalg.norm(shown.world_from_object[:3, :3], 2))
    moved = distance(repair.before, after)
    if moved > FURTHEST * surface.diagonal:
        far = f"{moved * scale:.3g} m, {moved / surface.diagonal:.1%} of its size"
        left.append(f"its shape is not repaired: the surface would move by {far}")
        return MeshRepair({}, (), tuple(left))
    told = tuple(replace(change, distance=moved * scale) for change in changes)
    return MeshRepair(made, told, tuple(left))


def _needs_repair(surface: Surface) -> bool:
    return bool((count_edges(surface.triangle) > 2).any()) or is_needle_mesh(surface)
