"""Unwraps meshes whose lightmap uv (TEXCOORD_1) in the file is not usable for a lightmap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.progress import Progress
from baker.core.scene import Instance, Material, Mesh, Scene
from baker.core.settings import BakeSettings, make_settings
from baker.core.source_mesh import SourceInstance
from baker.repairs.mesh_plan import Change, MeshPlan
from baker.topology.triangle_check import duplicates, usable_vertices
from baker.uv.keep import find_fault
from baker.uv.unwrap import unwrap_scene

# Smallest width of the page for which an object is unwrapped, texels.
_SMALLEST = 64


@dataclass(frozen=True)
class UvRequest:
    """The size of the lightmap for which the uv of a mesh are tested and made.

    Attributes
    ----------
    resolution : int
        Width of a page, texels.
    share : float
        The mesh's share of the scene's area, 0 to 1. In a bake, the mesh gets about this share of a page.
    threads : int or None
        Number of threads.
    """

    resolution: int
    share: float
    threads: int | None

    def unwrap_settings(self) -> BakeSettings:
        """Return settings that unwrap the mesh alone on a page whose area is `share` of the full page.

        The page is square. Its width is rounded to a multiple of 16 texels, from `_SMALLEST` to `resolution`.
        """
        width = min(self.resolution, max(_SMALLEST, 16 * round(self.resolution * np.sqrt(self.share) / 16)))
        return make_settings({"resolution": width, "uv": "unwrap", "threads": self.threads})


def new_lightmap_uv(
    plan: MeshPlan, shown: Sequence[SourceInstance], request: UvRequest, progress: Progress
) -> tuple[MeshPlan, list[NDArray[np.float32]] | None]:
    """Test the TEXCOORD_1 of a mesh's remaining faces, and make a new TEXCOORD_1 if the test fails.

    Parameters
    ----------
    plan : MeshPlan
        The edits of the mesh.
    shown : sequence of SourceInstance
        The instances of the mesh. The mesh is unwrapped at the scale of the first instance.
    request : UvRequest
        Size of the lightmap.
    progress : Progress

    Returns
    -------
    plan : MeshPlan
        The plan, with the change added, or the reason why an invalid TEXCOORD_1 is kept.
    uv : list of (T, 3, 2) float32, or None
        New uv of the face corners of each primitive; None if the TEXCOORD_1 is kept.
    """
    if not any(1 in edit.primitive.arrays.texcoord for edit in plan.edits):
        return plan, None
    mesh = _mesh(plan)
    if mesh is None:
        return plan, None
    # Leave out duplicate faces, as a bake does, so that they do not count as an overlap.
    sided = np.zeros(len(mesh.triangle), bool)
    single = ~duplicates(mesh.position, mesh.triangle.astype(np.int64), mesh.material, sided)
    fault = find_fault(replace(mesh, triangle=mesh.triangle[single]), request.resolution)
    if fault is None:
        return plan, None
    stays = f"its lightmap uv stay, though {fault[1]}: "
    obstacle = _obstacle(plan)
    if obstacle:
        return _left(plan, stays + obstacle), None
    try:
        uv = _unwrap(mesh, shown[0], request, progress)
    except InputError as error:
        return _left(plan, f"{stays}it cannot be unwrapped ({error.message})"), None
    again = find_fault(_replaced(mesh, uv, single), request.resolution)
    if again is not None:
        return _left(plan, f"{stays}unwrapped again, {again[1]}"), None
    change = Change("lightmap-uv", f"lightmap uv of which {fault[1].removeprefix('its ')}", 1, 0)
    ends = np.cumsum([len(edit.triangle) for edit in plan.edits])[:-1]
    return replace(plan, changes=(*plan.changes, change)), np.split(uv, ends)


def _obstacle(plan: MeshPlan) -> str:
    """Return why the TEXCOORD_1 of a mesh must be kept, as the end of a sentence; empty if it may change."""
    locked = next((edit.primitive.locked for edit in plan.edits if edit.primitive.locked), "")
    if locked:
        return locked
    if any(edit.primitive.reads_lightmap_uv for edit in plan.edits):
        return "a texture of its material reads them; a bake makes others beside them"
    return ""


def _unwrap(
    mesh: Mesh, instance: SourceInstance, request: UvRequest, progress: Progress
) -> NDArray[np.float32]:
    """Unwrap a mesh alone and return the new uv of its face corners, (T, 3, 2) float32."""
    alone = Scene(
        name=mesh.name,
        path=None,
        meshes=(mesh,),
        materials=(Material(),),
        instances=(Instance(0, instance.name, 0, instance.world_from_object),),
    )
    layout = unwrap_scene(alone, request.unwrap_settings(), progress).layouts[0]
    return layout.uv[layout.triangle]


def _left(plan: MeshPlan, reason: str) -> MeshPlan:
    return replace(plan, left=(*plan.left, reason))


def _mesh(plan: MeshPlan) -> Mesh | None:
    """Return the remaining faces of a mesh for unwrapping, or None if some coordinates are unusable."""
    arrays = [edit.primitive.arrays for edit in plan.edits]
    start = np.cumsum([0] + [len(a.position) for a in arrays[:-1]])
    position = np.concatenate([a.position for a in arrays])
    triangle = np.concatenate([edit.triangle + s for edit, s in zip(plan.edits, start, strict=True)])
    if not usable_vertices(position)[triangle].all():
        return None
    uv = np.concatenate([a.texcoord.get(1, np.zeros((len(a.position), 2), np.float32)) for a in arrays])
    zero_t, zero_v = np.zeros(len(triangle), np.int32), np.zeros(len(position), np.int32)
    row = np.arange(len(position), dtype=np.int32)
    # Set normals to zero, because unwrapping does not use them.
    normal = np.zeros_like(position)
    corner = triangle.astype(np.int32)
    return Mesh("", position, normal, corner, zero_t, zero_t, zero_v, row, (None, uv))


def _replaced(mesh: Mesh, uv: NDArray[np.float32], single: NDArray[np.bool_]) -> Mesh:
    """Return the faces that the mask `single` (T,) selects, with new lightmap uv (T, 3, 2).

    The returned mesh has one vertex for each face corner.
    """
    flat = np.arange(3 * len(mesh.triangle), dtype=np.int32).reshape(-1, 3)[single]
    position = mesh.position[mesh.triangle].reshape(-1, 3)
    return replace(mesh, position=position, triangle=flat, texcoord=(None, uv.reshape(-1, 2)))
