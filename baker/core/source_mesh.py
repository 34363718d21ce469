"""A scene's triangles as its file has them, bad ones included, for those who judge the file itself."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class PrimitiveArrays:
    """One primitive as its file has it.

    Attributes
    ----------
    index : int
        Number of the primitive in its mesh.
    material : int
        Index into the scene's materials.
    position : (V, 3) float32, object space
    triangle : (T, 3) int64, indices into the vertices, not yet known to be in range
    normal : (V, 3) float32 or None
        None asks for flat normals.
    texcoord : dict of int to (V, 2) float32
    colour : (V, 4) float32, linear, or None
    further : (V, B) uint8 or None
        Bytes of the vertex attributes that are not above; only where a file is read leniently.
    stitched : bool
        True for strips, whose triangles with a repeated index only join pieces: left out without a word.
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
class RawMesh:
    """A mesh with everything that its file says, however wrong."""

    name: str
    primitives: tuple[PrimitiveArrays, ...]


@dataclass(frozen=True)
class RawInstance:
    """A node that shows a mesh, even one that cannot be baked.

    Attributes
    ----------
    node : int
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
    """All meshes that stand in the scene, in the order of their first instance."""

    meshes: tuple[RawMesh, ...]
    instances: tuple[RawInstance, ...]
