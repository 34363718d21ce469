"""Finds objects whose positions in float32 are too inaccurate for the size of their texels.

Two kinds of coordinates are float32: vertices of files, in object space, and positions that a bake traces,
relative to the scene's origin. At a coordinate of 100 km, float32 numbers are spaced by 8 mm. The transform
of a node cannot make the spacing of its mesh's vertices finer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.origin import column_medians
from baker.core.scene import Scene, SceneWarning

# Spacing of float32 positions, as a share of a texel's side, above which an object is reported.
COARSE = 0.1
# Share of a mesh's vertices that are ignored as outliers: for each axis, those with the largest absolute
# coordinates.
_OUTLIERS = 0.1
# A mesh with more vertices is sampled: between this number and twice this number of vertices are read.
_VERTICES = 1 << 15


@dataclass(frozen=True)
class CoarseObjects:
    """Objects whose positions are too coarse.

    Attributes
    ----------
    worst : int
        Index of the instance with the largest ratio of spacing to texel side.
    count : int
        Number of instances above `COARSE`.
    text : str
        Description of the defect of the instance `worst`, with numbers.
    fix : str
        Advice to the user.
    """

    worst: int
    count: int
    text: str
    fix: str


def coarse_objects(scene: Scene, texel: NDArray[np.float64]) -> CoarseObjects | None:
    """Find objects whose float32 positions are spaced by more than a tenth of a texel.

    Parameters
    ----------
    scene : Scene
        The scene to check.
    texel : (I,) float64, metres
        Side of a texel on each instance; inf if it is unknown.

    Returns
    -------
    CoarseObjects or None
        None if no object is above `COARSE`.
    """
    if not scene.instances:
        return None
    extents = [_median_and_extent(mesh.position) for mesh in scene.meshes]
    stored, spacing, distance = (np.zeros(len(scene.instances)) for _ in range(3))
    for k, instance in enumerate(scene.instances):
        linear, shift = instance.world_from_object[:3, :3], instance.world_from_object[:3, 3] - scene.origin
        middle, extent = extents[instance.mesh]
        stored[k] = float((np.abs(linear) @ _float32_spacing(extent)).max())
        distance[k] = float(np.abs(linear @ middle + shift).max())
        spacing[k] = max(stored[k], float(_float32_spacing(distance[k])))
    share = spacing / texel
    worst = int(share.argmax())
    if not share[worst] > COARSE:
        return None
    ends = (
        f"where steps of single precision are {_metres(spacing[worst])}: coarser than a tenth of a texel, "
        f"which is {_metres(texel[worst])} wide"
    )
    if stored[worst] == spacing[worst]:
        largest = float(extents[scene.instances[worst].mesh][1].max())
        text = f"90 % of its vertices are stored with coordinates of up to {largest:.3g}, {ends}"
        fix = "move the distance into the node's translation, so that the mesh lies around its own origin"
    else:
        text = f"it lies {_metres(distance[worst])} from the origin among the other objects, {ends}"
        fix = "bake objects that are so far apart as scenes of their own"
    return CoarseObjects(worst, int((share > COARSE).sum()), text, fix)


def coarse_warnings(scene: Scene, atlas: Atlas) -> list[SceneWarning]:
    """Return a warning about the object whose positions are coarsest relative to its texels, if too coarse.

    Parameters
    ----------
    scene : Scene
        The baked scene.
    atlas : Atlas
        The atlas of the scene; the texels per metre of each instance are read.

    Returns
    -------
    list of SceneWarning
        At most one, with the code `coarse-positions`.
    """
    density = np.array([layout.texels_per_metre for layout in atlas.layouts], np.float64)
    texel = np.divide(1.0, density, out=np.full(len(density), np.inf), where=density > 0)
    found = coarse_objects(scene, texel)
    if found is None:
        return []
    more = f" ({found.count - 1} further objects are coarse, too)" if found.count > 1 else ""
    name = scene.instances[found.worst].name
    return [SceneWarning("coarse-positions", f"{found.text}; {found.fix}{more}", name)]


def _median_and_extent(position: NDArray[np.float32]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return, by axis, the median (3,) of vertices and the 0.9 quantile (3,) of absolute coordinates."""
    some = position[:: max(1, len(position) // _VERTICES)].astype(np.float64)
    if not len(some):
        return np.zeros(3), np.zeros(3)
    return column_medians(some), np.quantile(np.abs(some), 1.0 - _OUTLIERS, axis=0)


def _float32_spacing(value: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the distance from each value >= 0, rounded to float32, to the next larger float32 number."""
    return np.asarray(np.spacing(np.asarray(value, np.float32)), np.float64)


def _metres(value: float) -> str:
    """Return a length as text in km, m or mm."""
    if value >= 1000.0:
        return f"{value / 1000.0:.3g} km"
    return f"{value:.3g} m" if value >= 1.0 else f"{value * 1000.0:.3g} mm"
