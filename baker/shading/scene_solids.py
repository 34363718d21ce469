"""Classifies triangles, and determines what a ray's first hit on a triangle implies about the ray's origin.

`topology.solids` defines the classes solid, room and cover. All other surfaces are called sheets.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.core.scene import Scene
from baker.kernels.probe import BLACK_BACK, SOLID_BACK, SOLID_FRONT
from baker.kernels.shading import Shading
from baker.topology.solids import BEFORE, BEHIND, Solids, SolidSurfaces, find_solids, lights_and_cameras


def scene_solids(scene: Scene, geometry: Geometry, shading: Shading) -> Solids:
    """Classify the parts of a scene as solids, rooms and covers.

    Parameters
    ----------
    scene : Scene
        Lights and cameras. A closed part that contains a light or camera is a room.
    geometry : Geometry
        Triangles of the scene.
    shading : Shading
        Materials.

    Returns
    -------
    Solids
        Classification of each triangle.
    """
    surfaces = SolidSurfaces(
        position=geometry.position,
        triangle=geometry.triangle,
        instance=geometry.instance,
        # An object that no ray hits is no solid: points inside it are lit.
        opaque=_opaque(geometry, shading) & scene.object_flags("cast")[geometry.instance],
        double_sided=geometry.double_sided,
        emits=(shading.emission.max(axis=1) > 0)[geometry.material],
    )
    return find_solids(surfaces, lights_and_cameras(scene))


def hide_backs(scene: Scene, geometry: Geometry, shading: Shading) -> tuple[Geometry, NDArray[np.uint8]]:
    """Make faces one-sided if a solid without holes is at their back; also return `hit_kind` of triangles.

    No light arrives inside a solid without holes, so the backs of its faces need no texels.

    Parameters
    ----------
    scene : Scene
        Lights and cameras.
    geometry : Geometry
        Triangles of the scene.
    shading : Shading
        Materials.

    Returns
    -------
    Geometry
        The geometry with `double_sided` false for these faces.
    hit_kind : (T,) uint8
        What a first hit on each triangle implies about the ray's origin, see `kernels.probe`.
    """
    solids = scene_solids(scene, geometry, shading)
    hidden = solids.sealed & (solids.inside == BEHIND) & geometry.double_sided
    if hidden.any():
        geometry = replace(geometry, double_sided=geometry.double_sided & ~hidden)
    return geometry, hit_kinds(geometry, shading, solids)


def hit_kinds(geometry: Geometry, shading: Shading, solids: Solids) -> NDArray[np.uint8]:
    """Return for each triangle what a first hit on it implies about the ray's origin.

    Backs of one-sided sheets are black, and backs of covers are treated as black. Hits on rooms and on
    triangles that let light through imply nothing (0).

    Parameters
    ----------
    geometry : Geometry
        Triangles.
    shading : Shading
        Materials.
    solids : Solids
        Classification of the triangles.

    Returns
    -------
    (T,) uint8
        Values as in `kernels.probe`: 0, BLACK_BACK, SOLID_BACK or SOLID_FRONT.
    """
    hit_kind = np.where(geometry.double_sided, 0, BLACK_BACK).astype(np.uint8)
    hit_kind[~_opaque(geometry, shading)] = 0
    hit_kind[solids.room] = 0
    hit_kind[solids.cover] = BLACK_BACK
    hit_kind[solids.inside == BEHIND] = SOLID_BACK
    hit_kind[solids.inside == BEFORE] = SOLID_FRONT
    return hit_kind


def _opaque(geometry: Geometry, shading: Shading) -> NDArray[np.bool_]:
    """Return (T,) bool: the triangles that are opaque everywhere."""
    slot = shading.alpha.slot
    found: NDArray[np.bool_] = slot < 0 if len(slot) else np.ones(len(geometry.triangle), bool)
    return found
