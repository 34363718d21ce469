"""Finds the faces that can be removed without a visible change: degenerate faces and exact duplicates.

A duplicate face is removed only if no renderer can distinguish it from an earlier face: both faces have the
same corners with the same attributes, and the material does not blend. Faces at the same positions with
different attributes are kept, because renderers differ in which face they show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.repairs.primitive_edit import EditablePrimitive
from baker.topology.triangle_check import duplicates, usable_vertices, zero_area
from baker.topology.unique_rows import first_equal


@dataclass(frozen=True)
class FaceChoice:
    """The faces of a primitive that are kept, and the numbers of those that are removed.

    Attributes
    ----------
    keep : (T,) bool
        The faces that are kept.
    n_unusable : int
        Removed faces with NaN, infinite or huge coordinates.
    n_zero_area : int
        Removed faces without area.
    n_duplicate : int
        Removed faces that duplicate another face.
    n_stitches : int
        Removed degenerate faces that only join the pieces of a triangle strip.
    n_unlike : int
        Faces at the positions of another face that are kept, because their attributes differ or the material
        blends.
    """

    keep: NDArray[np.bool_]
    n_unusable: int
    n_zero_area: int
    n_duplicate: int
    n_stitches: int
    n_unlike: int

    @property
    def n_dropped(self) -> int:
        """Return the number of defective faces that are removed, without `n_stitches`."""
        return self.n_unusable + self.n_zero_area + self.n_duplicate


def choose_faces(primitive: EditablePrimitive) -> FaceChoice:
    """Find the faces of a primitive that can be removed.

    Parameters
    ----------
    primitive : EditablePrimitive
        The primitive, which is not changed.

    Returns
    -------
    FaceChoice
        The faces that are kept, and the numbers of those that are removed.
    """
    position, triangle = primitive.arrays.position, primitive.arrays.triangle
    left = np.arange(len(triangle))

    def drop(bad: NDArray[np.bool_]) -> int:
        nonlocal left
        left = left[~bad]
        return int(bad.sum())

    n_stitches = 0
    if primitive.arrays.stitched:
        n_stitches = drop(np.asarray((triangle == np.roll(triangle, 1, axis=1)).any(axis=1)))
    usable = usable_vertices(position)
    n_unusable = drop(np.asarray(~usable[triangle[left]].all(axis=1)))
    n_zero_area = drop(zero_area(position, triangle[left]))
    n_duplicate = n_unlike = 0
    if _n_at_same_positions(primitive, triangle[left]):
        if not primitive.blends:
            n_duplicate = drop(_exact_duplicates(primitive, triangle[left]))
        n_unlike = _n_at_same_positions(primitive, triangle[left])
    keep = np.zeros(len(triangle), bool)
    keep[left] = True
    return FaceChoice(keep, n_unusable, n_zero_area, n_duplicate, n_stitches, n_unlike)


def _n_at_same_positions(primitive: EditablePrimitive, triangle: NDArray[np.int64]) -> int:
    """Return how many of the faces (T, 3) are at the positions of an earlier face, see `duplicates`."""
    material = np.zeros(len(triangle), np.int32)
    sided = np.full(len(triangle), primitive.double_sided)
    return int(duplicates(primitive.arrays.position, triangle, material, sided).sum())


def _exact_duplicates(primitive: EditablePrimitive, triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return (T,) bool: the faces (T, 3) that are rendered exactly like an earlier face.

    A face with the same corners but opposite winding is equal only if the material is double-sided, the
    normals are opposite, and there are no tangents. The face is then the back of the earlier face.
    """
    leave_out = {"NORMAL"} if primitive.reads_lightmap_uv else {"NORMAL", "TEXCOORD_1"}
    column = [data for name, data in primitive.column.items() if name not in leave_out]
    vertex = first_equal(column, len(primitive.arrays.position))[triangle]
    # Sort the vertices of each face, and record in `turned` whether this reverses the winding.
    row = np.arange(len(triangle))
    start = vertex.argmin(axis=1)
    order = (start[:, None] + np.arange(3)) % 3
    turned = vertex[row, order[:, 1]] > vertex[row, order[:, 2]]
    order[turned] = order[turned][:, [0, 2, 1]]
    signature: list[NDArray[np.generic]] = [np.take_along_axis(vertex, order, axis=1)]
    normal = primitive.arrays.normal
    if normal is not None:
        given = normal[np.take_along_axis(triangle, order, axis=1)]
        if primitive.double_sided:
            given = np.where(turned[:, None, None], -given, given)
        signature.append(given + np.float32(0.0))  # + 0 makes -0 equal to 0
    if not primitive.double_sided or "TANGENT" in primitive.column:
        signature.append(turned.reshape(-1, 1))
    repeated: NDArray[np.bool_] = np.asarray(first_equal(signature, len(triangle)) != row)
    return repeated
