"""Finds the faces that the fix of `inside-out` flips: those that `baker check` reports with that code."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.rules.inside_out import inside_out_parts
from baker.core.scene import Scene
from baker.core.settings import make_settings


def faces_to_flip(scene: Scene) -> dict[int, list[NDArray[np.bool_]]]:
    """Return the faces of the closed parts of meshes that the rule `inside-out` reports.

    Parameters
    ----------
    scene : Scene
        The scene, read leniently.

    Returns
    -------
    dict of int to list of (T,) bool
        For each mesh with such faces, one mask of faces for each primitive.
    """
    context = CheckContext(scene, make_settings({}))
    found: dict[int, list[NDArray[np.bool_]]] = {}
    for number, facts in enumerate(context.meshes):
        parts = inside_out_parts(context, number)
        if not parts:
            continue
        face = facts.good[np.concatenate(parts)]
        masks = [np.zeros(len(p.triangle), bool) for p in facts.source.primitives]
        for k, mask in enumerate(masks):
            mask[facts.local[face[facts.primitive[face] == k]]] = True
        found[number] = masks
    return found
