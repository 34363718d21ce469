"""Holds the result of editing a glTF primitive: copies of its old vertices, or new vertices."""

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
        For each new vertex, the index of the old vertex that it copies.
    triangle : (T, 3) int64, indices into the new vertices
    normal : (V, 3) float32, unit, object space, or None
        None copies NORMAL from the old vertices.
    turned : (V,) bool
        True for vertices whose normal was reversed; the handedness of their tangent is reversed as well.
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
    """A primitive with new vertices, which have no attributes except those listed here.

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
