"""Finds objects whose positions in float32 are too inaccurate for the size of their texels.

Two kinds of coordinates are float32: vertices of files, in object space, and positions that a bake traces,
relative to the scene's origin. At a coordinate of 100 km, float32 numbers are spaced by 8 mm. The transform
of a node cannot make the spacing of its mesh's vertices finer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
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
    middle, extent = _medians_and_extents([mesh.position for mesh in scene.meshes])
    mesh = np.array([instance.mesh for instance in scene.instances])
    matrix = np.stack([instance.world_from_object for instance in scene.instances])
    linear, shift = matrix[:, :3, :3], matrix[:, :3, 3] - scene.origin
    stored = np.einsum("kij,kj->ki", np.abs(linear), _float32_spacing(extent)[mesh]).max(axis=1)
    distance = np.abs(np.einsum("kij,kj->ki", linear, middle[mesh]) + shift).max(axis=1)
    spacing = np.maximum(stored, _float32_spacing(distance))
    share = spacing / texel
    worst = int(share.argmax())
    if not share[worst] > COARSE:
        return None
    ends = (
        f"where steps of single precision are {_metres(spacing[worst])}: coarser than a tenth of a texel, "
        f"which is {_metres(texel[worst])} wide"
    )
    if stored[worst] == spacing[worst]:
        largest = float(extent[mesh[worst]].max())
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


def _medians_and_extents(
    positions: Sequence[NDArray[np.float32]],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return, for N meshes and by axis, the median of vertices and the 0.9 quantile of absolute coordinates.

    positions : N arrays (V, 3) float32. The results are (N, 3) float64, and 0 for meshes without vertices.
    """
    some = [position[:: max(1, len(position) // _VERTICES)] for position in positions]
    count = np.array([len(rows) for rows in some])
    middle, extent = np.zeros((2, len(some), 3))
    # Sort small meshes together, because the calls for a single mesh take longer than sorting it.
    batch = np.cumsum(count) // _VERTICES
    for number in np.unique(batch):
        mine = np.flatnonzero((batch == number) & (count > 0))
        if not len(mine):
            continue
        rows = np.concatenate([some[k] for k in mine]).astype(np.float64)
        owner = np.repeat(np.arange(len(mine)), count[mine])
        n, start = count[mine], np.cumsum(count[mine]) - count[mine]
        for axis in range(3):
            value = rows[:, axis]
            ordered = value[np.lexsort((value, owner))]
            middle[mine, axis] = (ordered[start + (n - 1) // 2] + ordered[start + n // 2]) / 2.0
            size = np.abs(value)
            ordered = size[np.lexsort((size, owner))]
            at = (1.0 - _OUTLIERS) * (n - 1)
            low = at.astype(np.int64)
            below, above = ordered[start + low], ordered[start + np.minimum(low + 1, n - 1)]
            extent[mine, axis] = below + (at - low) * (above - below)
    return middle, extent


def _float32_spacing(value: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Return the distance from each value >= 0, rounded to float32, to the next larger float32 number."""
    return np.asarray(np.spacing(np.asarray(value, np.float32)), np.float64)


def _metres(value: float) -> str:
    """Return a length as text in km, m or mm."""
    if value >= 1000.0:
        return f"{value / 1000.0:.3g} km"
    return f"{value:.3g} m" if value >= 1.0 else f"{value * 1000.0:.3g} mm"
