"""What is solid in a scene, and what rays from inside of it meet."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.core.scene import Scene
from baker.kernels.probe import BLACK_BACK, SOLID_BACK, SOLID_FRONT
from baker.kernels.shading import Shading
from baker.topology.solids import BEFORE, BEHIND, Solids, Surfaces, find_solids, lights_and_cameras


def scene_solids(scene: Scene, geometry: Geometry, shading: Shading) -> Solids:
    """Tell solids from rooms and open sheets.

    Parameters
    ----------
    scene : Scene
        Its lamps and cameras show where somebody sees.
    geometry : Geometry
        Made from the same scene.
    shading : Shading
    """
    surfaces = Surfaces(
        position=geometry.position,
        triangle=geometry.triangle,
        instance=geometry.instance,
        opaque=_opaque(geometry, shading),
        double_sided=geometry.double_sided,
        glows=(shading.emission.max(axis=1) > 0)[geometry.material],
    )
    return find_solids(surfaces, lights_and_cameras(scene))


def hide_backs(scene: Scene, geometry: Geometry, shading: Shading) -> tuple[Geometry, NDArray[np.uint8]]:
    """Return the geometry with faces of solids one-sided, and what each triangle tells rays.

    No light gets to the backs of a solid without holes, whatever its material says of them.

    Returns
    -------
    Geometry
    tells : (T,) uint8, see `kernels.probe`
    """
    solids = scene_solids(scene, geometry, shading)
    hidden = solids.sealed & (solids.inside == BEHIND) & geometry.double_sided
    if hidden.any():
        geometry = replace(geometry, double_sided=geometry.double_sided & ~hidden)
    return geometry, hit_kinds(geometry, shading, solids)


def hit_kinds(geometry: Geometry, shading: Shading, solids: Solids) -> NDArray[np.uint8]:
    """Return (T,) uint8 for `kernels.probe`: what a ray from inside of something meets.

    Backs of one-sided sheets are black, those of covers as good as black; those of rooms and of what lets
    light through say nothing.
    """
    tells = np.where(geometry.double_sided, 0, BLACK_BACK).astype(np.uint8)
    tells[~_opaque(geometry, shading)] = 0
    tells[solids.room] = 0
    tells[solids.cover] = BLACK_BACK
    tells[solids.inside == BEHIND] = SOLID_BACK
    tells[solids.inside == BEFORE] = SOLID_FRONT
    return tells


def _opaque(geometry: Geometry, shading: Shading) -> NDArray[np.bool_]:
    """Return (T,) bool: triangles that let no light through anywhere."""
    slot = shading.alpha.slot
    found: NDArray[np.bool_] = slot < 0 if len(slot) else np.ones(len(geometry.triangle), bool)
    return found
