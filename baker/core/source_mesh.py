"""A scene's triangles as its file holds them, invalid ones included, for checks and repairs of the file."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class SourcePrimitive:
    """One primitive as its file holds it.

    Attributes
    ----------
    index : int
        Number of the primitive in its mesh.
    material : int
        Index into the scene's materials.
    position : (V, 3) float32, metres, object space
    triangle : (T, 3) int64
        Indices into the vertices, not yet checked to be in range.
    normal : (V, 3) float32 or None, object space
        None for flat normals.
    texcoord : dict of int to (V, 2) float32
        TEXCOORD sets by number.
    colour : (V, 4) float32 or None, linear Rec.709
    further : (V, B) uint8 or None
        Bytes of all other vertex attributes; only where a file is read leniently.
    stitched : bool
        True for strips: a triangle with a repeated index joins two parts of a strip and is dropped without
        a warning.
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
    """A mesh with all primitives of its file, unchecked."""

    name: str
    primitives: tuple[SourcePrimitive, ...]


@dataclass(frozen=True)
class SourceInstance:
    """A node that shows a mesh, including a mesh without a valid triangle.

    Attributes
    ----------
    node : int
        As in `Instance`.
    name : str
        As in `Instance`.
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
    """All meshes that a scene's nodes show, in the order of their first instance."""

    meshes: tuple[SourceMesh, ...]
    instances: tuple[SourceInstance, ...]
