"""Pairs the objects of two bakes.

Three rules are applied one after the other, each to the objects that are not paired yet. A rule pairs two
objects if they have the same key, and no other unpaired object of either scene has this key.

    rule | key            | further condition
    1    | node and name  |
    2    | name           |
    3    | node           | the meshes are equal (the object was renamed)

Objects that remain unpaired may have been joined or split. Points on unpaired objects are therefore matched
with all unpaired objects of the other scene.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Hashable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Instance, Mesh, Scene

# Largest difference between coordinates that count as equal, as a share of the mesh's largest coordinate.
_NEAR = 1.0e-6


@dataclass(frozen=True)
class ObjectPairs:
    """Pairs of the instances of scenes a and b.

    Attributes
    ----------
    partner : (A,) int64
        For each of the A instances of a, its partner among the instances of b, or -1.
    same : (A,) bool
        Whether the instance has a partner and their meshes are equal triangle by triangle.
    rest_a, rest_b : (k,) int64
        Instances of a and of b without a partner.
    """

    partner: NDArray[np.int64]
    same: NDArray[np.bool_]
    rest_a: NDArray[np.int64]
    rest_b: NDArray[np.int64]


def pair_objects(a: Scene, b: Scene) -> ObjectPairs:
    """Pair the instances of two scenes by the three rules in the docstring of this module."""
    partner = np.full(len(a.instances), -1, np.int64)
    known: dict[tuple[int, int], bool] = {}

    def same(i: int, j: int) -> bool:
        key = a.instances[i].mesh, b.instances[j].mesh
        if key not in known:
            known[key] = _same_mesh(a.meshes[key[0]], b.meshes[key[1]])
        return known[key]

    _pair(a, b, partner, lambda instance: (instance.node, instance.name))
    _pair(a, b, partner, lambda instance: instance.name)
    _pair(a, b, partner, lambda instance: instance.node, accept=same)
    equal = np.array([j >= 0 and same(i, int(j)) for i, j in enumerate(partner)], bool)
    rest_b = np.setdiff1d(np.arange(len(b.instances)), partner)
    return ObjectPairs(partner, equal, np.flatnonzero(partner < 0), rest_b)


def _pair(
    a: Scene,
    b: Scene,
    partner: NDArray[np.int64],
    key: Callable[[Instance], Hashable],
    accept: Callable[[int, int], bool] = lambda i, j: True,
) -> None:
    """Pair instances with equal keys, if the key occurs once among the unpaired instances of each scene.

    `partner` (A,) is changed in place. `accept(i, j)` returns whether instances i of a and j of b may be
    paired.
    """
    taken = set(partner.tolist())
    left = {i: key(instance) for i, instance in enumerate(a.instances) if partner[i] < 0}
    right = {j: key(instance) for j, instance in enumerate(b.instances) if j not in taken}
    count_a, count_b = Counter(left.values()), Counter(right.values())
    right_of = {value: j for j, value in right.items()}
    for i, value in left.items():
        if count_a[value] == count_b[value] == 1 and accept(i, right_of[value]):
            partner[i] = right_of[value]


def _same_mesh(a: Mesh, b: Mesh) -> bool:
    """Return whether the triangles of two meshes have equal corner positions, in the same order."""
    if a.triangle.shape != b.triangle.shape:
        return False
    if not len(a.triangle):
        return True
    first, second = a.position[a.triangle].astype(np.float64), b.position[b.triangle].astype(np.float64)
    return bool(np.abs(first - second).max() <= _NEAR * np.abs(first).max())
