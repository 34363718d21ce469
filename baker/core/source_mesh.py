"""Holds all triangles of a scene file, invalid ones included, for checks and repairs of the file."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SourcePrimitive:
    """One primitive of a scene file, without validation.

    Attributes
    ----------
    index : int
        Number of the primitive in its mesh.
    material : int
        Index into the scene's materials.
    position : (V, 3) float32, metres, object space
    triangle : (T, 3) int64
        Indices into the vertices; they may be out of range.
    normal : (V, 3) float32 or None, object space
        None if the file has no normals, which means flat normals.
    texcoord : dict of int to (V, 2) float32
        TEXCOORD sets by number.
    colour : (V, 4) float32 or None, linear Rec.709
    further : (V, B) uint8 or None
        The B bytes of all other attributes of each vertex; None unless a glTF file is loaded with
        `lenient=True`.
    stitched : bool
        True for triangle strips. A triangle of a strip with a repeated index only joins two parts of the
        strip, so it is dropped without a warning.
    """

    index: int
    material: int
    position: NDArray[np.float32]
    triangle: NDArray[np.int64]
    normal: NDArray[np.float32] | None = None
    texcoord: dict[int, NDArray[np.float32]] = field(default_factory=dict)
    colour: NDArray[np.float32] | None = None
    further: NDArray[np.uint8] | None = None
    stitched: bool = False


@dataclass(frozen=True)
class SourceMesh:
    """A mesh with all primitives that the file contains, without validation."""

    name: str
    primitives: tuple[SourcePrimitive, ...]


@dataclass(frozen=True)
class SourceInstance:
    """A node with a mesh. Unlike an `Instance`, its mesh may have no valid triangle.

    Attributes
    ----------
    node : int
        See `Instance`.
    name : str
        See `Instance`.
    mesh : int
        Index into `SourceScene.meshes`.
    world_from_object : (4, 4) float64
    """

    node: int
    name: str
    mesh: int
    world_from_object: NDArray[np.float64]


@dataclass(frozen=True)
class SourceScene:
    """All meshes that nodes of the scene refer to, in the order of their first instance, and these nodes."""

    meshes: tuple[SourceMesh, ...]
    instances: tuple[SourceInstance, ...]
