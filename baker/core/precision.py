"""Objects whose positions single precision holds in steps that are coarse for their texels.

Files store vertices as float32: 100 km from the object's own origin their steps are 8 mm, whatever the node
does with them. What a bake traces is float32 around the scene's origin: an object 100 km from it has the same
steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.scene import Scene, SceneWarning

# Share of a texel that a step may have, and of a mesh's vertices that may lie farther out.
COARSE, _OUTLIERS = 0.1, 0.1
_VERTICES = 1 << 15


@dataclass(frozen=True)
class CoarseObjects:
    """Objects with too large steps.

    Attributes
    ----------
    worst : int
        Index of the instance whose step is the largest share of its texel.
    count : int
    text : str
        What is wrong with that one, with the numbers.
    fix : str
        What to do.
    """

    worst: int
    count: int
    text: str
    fix: str


def coarse_objects(scene: Scene, texel: NDArray[np.float64]) -> CoarseObjects | None:
    """Find objects whose float32 steps are more than a tenth of a texel.

    Parameters
    ----------
    scene : Scene
    texel : (I,) float64
        Side of a texel on each instance, metres; inf where it is not known.
    """
    if not scene.instances:
        return None
    reach = [_reach(mesh.position) for mesh in scene.meshes]
    stored, step, distance = (np.zeros(len(scene.instances)) for _ in range(3))
    for k, instance in enumerate(scene.instances):
        linear, shift = instance.world_from_object[:3, :3], instance.world_from_object[:3, 3] - scene.origin
        middle, far = reach[instance.mesh]
        stored[k] = float((np.abs(linear) @ _steps(far)).max())
        distance[k] = float(np.abs(linear @ middle + shift).max())
        step[k] = max(stored[k], float(_steps(distance[k])))
    share = step / texel
    worst = int(share.argmax())
    if not share[worst] > COARSE:
        return None
    ends = (
        f"where steps of single precision are {_metres(step[worst])}: coarser than a tenth of a texel, "
        f"which is {_metres(texel[worst])} wide"
    )
    if stored[worst] == step[worst]:
        largest = float(reach[scene.instances[worst].mesh][1].max())
        text = f"its vertices are stored with coordinates of up to {largest:.3g}, {ends}"
        fix = "move the distance into the node's translation, so that the mesh lies around its own origin"
    else:
        text = f"it lies {_metres(distance[worst])} from the origin among the other objects, {ends}"
        fix = "bake objects that are so far apart as scenes of their own"
    return CoarseObjects(worst, int((share > COARSE).sum()), text, fix)


def coarse_warnings(scene: Scene, atlas: Atlas) -> list[SceneWarning]:
    """Return a warning about the coarsest of a bake's objects, if any is coarse."""
    density = np.array([layout.texels_per_metre for layout in atlas.layouts], np.float64)
    texel = np.divide(1.0, density, out=np.full(len(density), np.inf), where=density > 0)
    found = coarse_objects(scene, texel)
    if found is None:
        return []
    more = f" ({found.count - 1} further objects are coarse, too)" if found.count > 1 else ""
    name = scene.instances[found.worst].name
    return [SceneWarning("coarse-positions", f"{found.text}; {found.fix}{more}", name)]


def _reach(position: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the median (3,) of vertices and how far from 0 (3,) all but a few lie along each axis."""
    some = position[:: max(1, len(position) // _VERTICES)].astype(np.float64)
    if not len(some):
        return np.zeros(3), np.zeros(3)
    return np.median(some, axis=0), np.quantile(np.abs(some), 1.0 - _OUTLIERS, axis=0)


def _steps(value: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the steps of float32 at numbers above 0."""
    return np.asarray(np.spacing(np.asarray(value, np.float32)), np.float64)


def _metres(value: float) -> str:
    """Return a length with a unit that suits it."""
    if value >= 1000.0:
        return f"{value / 1000.0:.3g} km"
    return f"{value:.3g} m" if value >= 1.0 else f"{value * 1000.0:.3g} mm"
