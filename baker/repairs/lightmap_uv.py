"""Unwraps meshes anew whose own lightmap uv (TEXCOORD_1) cannot carry a lightmap."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.progress import Progress
from baker.core.scene import Instance, Material, Mesh, Scene
from baker.core.settings import make_settings
from baker.core.source_mesh import SourceInstance
from baker.repairs.plan import Change, MeshPlan
from baker.topology.triangle_check import duplicates, usable_vertices
from baker.uv.keep import find_fault
from baker.uv.unwrap import unwrap_scene

# Texels across which an object is unwrapped at least, however small a share of the scene it is.
_SMALLEST = 64


def new_lightmap_uv(
    plan: MeshPlan,
    shown: Sequence[SourceInstance],
    share: float,
    *,
    resolution: int,
    threads: int | None,
    progress: Progress,
) -> tuple[MeshPlan, list[NDArray[np.float32]] | None]:
    """Judge the TEXCOORD_1 of what is left of a mesh, and make a new one if it fails.

    Parameters
    ----------
    plan : MeshPlan
    shown : sequence of SourceInstance
        The nodes that show the mesh; it is cut for the first one's scale.
    share : float
        The mesh's part of the scene's area, 0 to 1: it will get about this part of a page.
    resolution : int
        Page width in texels.
    threads : int or None
    progress : Progress

    Returns
    -------
    plan : MeshPlan
        With what was changed, or why it was not.
    uv : list of (T, 3, 2) float32, for each primitive, or None
    """
    if not any(1 in part.part.arrays.texcoord for part in plan.parts):
        return plan, None
    mesh = _mesh(plan)
    if mesh is None:
        return plan, None
    # A bake leaves doubles out, so they do not count as overlap.
    single = ~duplicates(mesh.position, mesh.triangle.astype(np.int64), mesh.material, np.zeros(1, bool))
    fault = find_fault(replace(mesh, triangle=mesh.triangle[single]), resolution)
    if fault is None:
        return plan, None
    stays = f"its lightmap uv stay, though {fault[1]}: "
    locked = next((part.part.locked for part in plan.parts if part.part.locked), "")
    if locked:
        return _left(plan, stays + locked), None
    if any(part.part.reads_lightmap_uv for part in plan.parts):
        return _left(
            plan, f"{stays}a texture of its material reads them; a bake makes others beside them"
        ), None
    side = min(resolution, max(_SMALLEST, 16 * round(resolution * np.sqrt(share) / 16)))
    settings = make_settings({"resolution": side, "uv": "unwrap", "threads": threads})
    alone = Scene(
        name=mesh.name,
        path=None,
        meshes=(mesh,),
        materials=(Material(),),
        instances=(Instance(0, shown[0].name, 0, shown[0].world_from_object),),
    )
    try:
        layout = unwrap_scene(alone, settings, progress).layouts[0]
    except InputError as error:
        return _left(plan, f"{stays}it cannot be unwrapped ({error.message})"), None
    uv = layout.uv[layout.triangle]
    again = find_fault(_replaced(mesh, uv, single), resolution)
    if again is not None:
        return _left(plan, f"{stays}unwrapped anew, {again[1]}"), None
    change = Change("lightmap-uv", f"lightmap uv of which {fault[1].removeprefix('its ')}", 1, 0)
    ends = np.cumsum([len(part.triangle) for part in plan.parts])[:-1]
    return replace(plan, changes=(*plan.changes, change)), np.split(uv, ends)


def _left(plan: MeshPlan, reason: str) -> MeshPlan:
    return replace(plan, left=(*plan.left, reason))


def _mesh(plan: MeshPlan) -> Mesh | None:
    """Return what is left of a mesh for unwrapping; None if its coordinates are unusable."""
    parts = plan.parts
    start = np.cumsum([0] + [len(part.part.arrays.position) for part in parts[:-1]])
    position = np.concatenate([part.part.arrays.position for part in parts])
    triangle = np.concatenate([part.triangle + s for part, s in zip(parts, start, strict=True)])
    if not usable_vertices(position)[triangle].all():
        return None
    uv = np.concatenate(
        [
            part.part.arrays.texcoord.get(1, np.zeros((len(part.part.arrays.position), 2), np.float32))
            for part in parts
        ]
    )
    zero_t, zero_v = np.zeros(len(triangle), np.int32), np.zeros(len(position), np.int32)
    row = np.arange(len(position), dtype=np.int32)
    # Normals play no part in unwrapping.
    normal = np.zeros_like(position)
    corner = triangle.astype(np.int32)
    return Mesh("", position, normal, corner, zero_t, zero_t, zero_v, row, (None, uv))


def _replaced(mesh: Mesh, uv: NDArray[np.float32], single: NDArray[np.bool_]) -> Mesh:
    """Return the mesh's faces marked `single`, with a vertex for each corner and other lightmap uv."""
    flat = np.arange(3 * len(mesh.triangle), dtype=np.int32).reshape(-1, 3)[single]
    position = mesh.position[mesh.triangle].reshape(-1, 3)
    return replace(mesh, position=position, triangle=flat, texcoord=(None, uv.reshape(-1, 2)))
