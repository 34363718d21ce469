"""The result of editing a primitive: its vertices in a new order, or a new surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class EditedPrimitive:
    """New vertices and triangles of a primitive; all other attributes are copied from the old vertices.

    Attributes
    ----------
    row : (V,) int64
        The old vertex that each new vertex is a copy of.
    triangle : (T, 3) int64, indices into the new vertices
    normal : (V, 3) float32, unit, object space, or None
        None keeps the bytes of NORMAL.
    turned : (V,) bool
        Vertices whose normal was reversed, so that the handedness of their tangent is reversed as well.
    uv : (V, 2) float32 or None
        New TEXCOORD_1; None keeps the old one.
    """

    row: NDArray[np.int64]
    triangle: NDArray[np.int64]
    normal: NDArray[np.float32] | None
    turned: NDArray[np.bool_]
    uv: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class ReplacedPrimitive:
    """A primitive with new vertices, which have these attributes only.

    Attributes
    ----------
    position : (V, 3) float32, metres, object space
    triangle : (T, 3) int64, indices into the vertices
    normal : (V, 3) float32, unit, object space, or None
    colour : (V, 4) float32, linear Rec.709, or None
    """

    position: NDArray[np.float32]
    triangle: NDArray[np.int64]
    normal: NDArray[np.float32] | None = None
    colour: NDArray[np.float32] | None = None
