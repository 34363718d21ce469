"""Applies morph targets: each vertex is moved by the sum over targets of weight times displacement.

Based on: Khronos Group, glTF 2.0 Specification, section 3.7.2.2.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.core.source_mesh import SourcePrimitive
from baker.io.gltf.accessor import read_accessor
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject


def has_targets(mesh: JsonObject) -> bool:
    """Return whether a mesh has morph targets.

    Parameters
    ----------
    mesh : JsonObject
        The mesh.

    Returns
    -------
    bool
        True if any primitive has targets.
    """
    return any(primitive.children("targets") for primitive in mesh.children("primitives"))


def weights_of(mesh: JsonObject, node: JsonObject) -> tuple[float, ...]:
    """Return the weights of the morph targets of a mesh.

    Parameters
    ----------
    mesh : JsonObject
        The mesh.
    node : JsonObject
        The node; its weights precede those of the mesh.

    Returns
    -------
    tuple of float
        One weight for each target; empty if neither has weights, so that all weights are 0.
    """
    for holder in (node, mesh):
        if "weights" in holder:
            values = holder.value["weights"]
            return holder.numbers("weights", len(values) if isinstance(values, list) else 0)
    return ()


def morphed(
    document: GltfDocument,
    mesh: JsonObject,
    arrays: Sequence[SourcePrimitive],
    weights: tuple[float, ...],
) -> list[SourcePrimitive]:
    """Return the primitives of a mesh with its morph targets applied.

    Parameters
    ----------
    document : GltfDocument
        The document.
    mesh : JsonObject
        The mesh.
    arrays : sequence of SourcePrimitive
        The primitives of the mesh, as `read_primitives` returns them.
    weights : tuple of float
        One weight for each target.

    Returns
    -------
    list of SourcePrimitive
        Primitives with displaced positions, normals, uv and colours.

    Raises
    ------
    InputError
        If a target with a weight other than 0 cannot be read.
    """
    primitives = mesh.children("primitives")
    return [_morphed(document, primitives[part.index], part, weights) for part in arrays]


def _morphed(
    document: GltfDocument, primitive: JsonObject, part: SourcePrimitive, weights: tuple[float, ...]
) -> SourcePrimitive:
    targets = primitive.children("targets")
    if targets and weights and len(weights) != len(targets):
        primitive.fail(f"it has {len(targets)} morph targets and {len(weights)} weights", "targets")
    used = [(target, weight) for target, weight in zip(targets, weights, strict=False) if weight]

    def moved(key: str, base: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
        if base is None or not any(key in target for target, _ in used):
            return base
        total = base.astype(np.float64)
        for target, weight in used:
            if key in target:
                delta = _delta(document, target, key, len(base))
                total[:, : delta.shape[1]] += weight * delta
        return total.astype(np.float32)

    position = moved("POSITION", part.position)
    assert position is not None
    texcoord = {k: moved(f"TEXCOORD_{k}", uv) for k, uv in part.texcoord.items()}
    return replace(
        part,
        position=position,
        normal=moved("NORMAL", part.normal),
        colour=moved("COLOR_0", part.colour),
        texcoord={k: uv for k, uv in texcoord.items() if uv is not None},
    )


def _delta(document: GltfDocument, target: JsonObject, key: str, count: int) -> NDArray[np.float32]:
    """Return the displacements of a target, (V, components)."""
    accessors = document.root.children("accessors")
    at = target.index(key, len(accessors), "accessors")
    delta = read_accessor(document, at, types=("VEC2", "VEC3", "VEC4"))
    if len(delta) != count:
        target.fail(f"the accessor has {len(delta)} rows, the primitive has {count}", key)
    return delta
