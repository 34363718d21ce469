"""What mending makes of a primitive: old vertices in new order, or a surface made anew."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class EditedPrimitive:
    """New vertices and triangles of one primitive. What is not named here is copied from the old rows.

    Attributes
    ----------
    row : (V,) int64
        The old vertex that each new one is a copy of.
    triangle : (T, 3) int64, indices into the new vertices
    normal : (V, 3) float32, unit, object space, or None
        None keeps NORMAL as it is, byte for byte.
    turned : (V,) bool
        Vertices whose normal points the other way now, so that their tangent's handedness has to follow.
    uv : (V, 2) float32, or None
        New TEXCOORD_1; None keeps what is there.
    """

    row: NDArray[np.int64]
    triangle: NDArray[np.int64]
    normal: NDArray[np.float32] | None
    turned: NDArray[np.bool_]
    uv: NDArray[np.float32] | None = None


@dataclass(frozen=True)
class ReplacedPrimitive:
    """A primitive whose vertices are all new. It has no other attributes than these.

    Attributes
    ----------
    position : (V, 3) float32, object space
    triangle : (T, 3) int64
    normal : (V, 3) float32, unit, or None
    colour : (V, 4) float32, linear, or None
    """

    position: NDArray[np.float32]
    triangle: NDArray[np.int64]
    normal: NDArray[np.float32] | None = None
    colour: NDArray[np.float32] | None = None
