"""Decides which instances of a mesh share one layout of charts, and how large each instance is in it.

Instances whose world shapes differ by more than a uniform scale are put into one group if the stretch between
them is small; otherwise their charts would be distorted. Inside a group, each layout has a limited range of
sizes, because the gaps between charts grow with the size.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Mesh, Scene
from baker.core.settings import BakeSettings
from baker.uv.stretch import world_stretch

# Largest ratio of the scales along two axes between an instance and the shape that its charts were cut for.
_MOST_STRETCH = 2.0
# Largest ratio of the sizes of two instances with the same layout.
_MOST_SIZES = 4.0


@dataclass(frozen=True)
class SharedSize:
    """The layout of an instance that shares it.

    Attributes
    ----------
    stretch : (3, 3) float64
        Stretch of the mesh for which its charts are cut, see `world_stretch`.
    factor : float
        Metres per unit of the stretched mesh.
    layout : int
        Number of the layout, from 0 over all meshes.
    """

    stretch: NDArray[np.float64]
    factor: float
    layout: int


@dataclass
class _Group:
    """Instances of a mesh that share charts."""

    stretch: NDArray[np.float64]
    member: list[tuple[int, float]]


def repeated_meshes(scene: Scene, filled: list[int], settings: BakeSettings) -> set[int]:
    """Return the meshes whose instances share TEXCOORD_1: those with several instances.

    Parameters
    ----------
    scene : Scene
        The scene.
    filled : list of int
        Indices of the instances that have triangles.
    settings : BakeSettings
        `instances` is read.
    """
    if settings.instances == "unique":
        return set()
    count = Counter(scene.instances[k].mesh for k in filled)
    return {mesh for mesh, n in count.items() if n > 1}


def shared_sizes(scene: Scene, members: dict[int, tuple[float, bool]]) -> dict[int, SharedSize]:
    """Return the layout and the size of each instance that shares charts with another one.

    Parameters
    ----------
    scene : Scene
        The scene.
    members : dict of int to (float, bool)
        The instances of repeated meshes whose mesh is cut into charts: factor on the density, and whether the
        density is fixed, see `object_shares`. Instances with and without a fixed density share no layout.

    Returns
    -------
    dict of int to SharedSize
        By index of the instance. Instances that no other instance resembles are left out.
    """
    by_mesh: dict[tuple[int, bool], list[int]] = defaultdict(list)
    for k, (_, fixed) in members.items():
        by_mesh[scene.instances[k].mesh, fixed].append(k)
    result: dict[int, SharedSize] = {}
    n_layouts = 0
    for (number, _), own in by_mesh.items():
        for group in _groups(scene, scene.meshes[number], own):
            for same in _size_classes(group.member, members):
                if len(same) > 1 or len(group.member) > 1:
                    for k, factor in same:
                        result[k] = SharedSize(group.stretch, factor, n_layouts)
                    n_layouts += 1
    return result


def _groups(scene: Scene, mesh: Mesh, own: list[int]) -> list[_Group]:
    """Divide the instances `own` of a mesh into groups of similar stretch.

    Instances without stretch come first, so that their charts are not distorted.
    """
    found = {k: world_stretch(scene.instances[k].world_from_object) for k in own}
    identity = np.eye(3).tobytes()
    groups: list[_Group] = []
    known: dict[bytes, tuple[_Group, float]] = {}
    for k in sorted(own, key=lambda k: found[k][1].tobytes() != identity):
        factor, stretch = found[k]
        key = stretch.tobytes()
        if key not in known:
            group = next((g for g in groups if _distortion(stretch, g.stretch) <= _MOST_STRETCH), None)
            if group is None:
                group = _Group(stretch, [])
                groups.append(group)
            same = group.stretch.tobytes() == key
            size = 1.0 if same else _relative_size(mesh, stretch, group.stretch)
            known[key] = (group, size)
        group, size = known[key]
        group.member.append((k, factor * size))
    return groups


def _distortion(stretch: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the largest ratio of the scales along two axes of the map from `other` to `stretch`."""
    value = np.linalg.svd(stretch @ np.linalg.inv(other), compute_uv=False)
    return float(value[0] / max(value[-1], 1e-300))


def _relative_size(mesh: Mesh, stretch: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Return the square root of the ratio of a mesh's areas with two stretches, rounded to 6 digits."""
    area = [_area(mesh.position.astype(np.float64) @ s, mesh.triangle) for s in (stretch, other)]
    return float(f"{np.sqrt(area[0] / area[1]):.6g}") if min(area) > 0.0 else 1.0


def _area(position: NDArray[np.float64], triangle: NDArray[np.int32]) -> float:
    corner = position[triangle]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return 0.5 * float(np.linalg.norm(cross, axis=1).sum())


def _size_classes(
    member: list[tuple[int, float]], density: dict[int, tuple[float, bool]]
) -> list[list[tuple[int, float]]]:
    """Divide pairs of instance and size into lists whose sizes in texels differ by at most `_MOST_SIZES`."""
    classes: list[list[tuple[int, float]]] = []
    largest = np.inf
    for k, factor in sorted(member, key=lambda pair: -pair[1] * density[pair[0]][0]):
        texels = factor * density[k][0]
        if not classes or texels * _MOST_SIZES < largest * (1.0 - 1e-9):
            classes.append([])
            largest = texels
        classes[-1].append((k, factor))
    return classes
