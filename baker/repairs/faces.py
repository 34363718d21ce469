"""Finds the faces that can go without a trace: those that nothing draws, and exact doubles of another.

A double goes only if no renderer can tell the two apart: same corners with the same attributes, in a material
that does not blend. What differs in anything stays, since which of the two is seen depends on the renderer.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.repairs.part import Part
from baker.topology.triangle_check import duplicates, usable_vertices, zero_area
from baker.topology.unique_rows import first_equal


@dataclass(frozen=True)
class FaceChoice:
    """Which faces of a primitive stay.

    Attributes
    ----------
    keep : (T,) bool
    n_unusable, n_zero_area, n_duplicate : int
        Faces that go: with NaN, infinite or huge coordinates, without area, doubles of another.
    n_stitches : int
        Faces of a strip that only join its pieces: they end with the strip and are no defect.
    n_unlike : int
        Faces in the place of another one that stay, since the two differ or blend.
    """

    keep: NDArray[np.bool_]
    n_unusable: int
    n_zero_area: int
    n_duplicate: int
    n_stitches: int
    n_unlike: int

    @property
    def n_dropped(self) -> int:
        """Count the defective faces that go."""
        return self.n_unusable + self.n_zero_area + self.n_duplicate


def choose_faces(part: Part) -> FaceChoice:
    """Find the faces of a primitive that can go.

    Parameters
    ----------
    part : Part
    """
    position, triangle = part.arrays.position, part.arrays.triangle
    left = np.arange(len(triangle))

    def drop(bad: NDArray[np.bool_]) -> int:
        nonlocal left
        left = left[~bad]
        return int(bad.sum())

    n_stitches = 0
    if part.arrays.stitched:
        n_stitches = drop(np.asarray((triangle == np.roll(triangle, 1, axis=1)).any(axis=1)))
    usable = usable_vertices(position)
    n_unusable = drop(np.asarray(~usable[triangle[left]].all(axis=1)))
    n_zero_area = drop(zero_area(position, triangle[left]))
    doubled = _in_the_same_place(part, triangle[left])
    n_duplicate = n_unlike = 0
    if doubled:
        if not part.blends:
            n_duplicate = drop(_exact_doubles(part, triangle[left]))
        n_unlike = _in_the_same_place(part, triangle[left])
    keep = np.zeros(len(triangle), bool)
    keep[left] = True
    return FaceChoice(keep, n_unusable, n_zero_area, n_duplicate, n_stitches, n_unlike)


def _in_the_same_place(part: Part, triangle: NDArray[np.int64]) -> int:
    """Count the faces that repeat another by position."""
    material = np.zeros(len(triangle), np.int32)
    return int(
        duplicates(part.arrays.position, triangle, material, np.array([part.double_sided], bool)).sum()
    )


def _exact_doubles(part: Part, triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell which faces show exactly what an earlier one shows, (T,) bool.

    A face turned round is told from its twin unless the material shows both sides and the normals are
    opposite, as if the twin were seen from behind.
    """
    leave_out = {"NORMAL"} if part.reads_lightmap_uv else {"NORMAL", "TEXCOORD_1"}
    column = [data for name, data in part.column.items() if name not in leave_out]
    vertex = first_equal(column, len(part.arrays.position))[triangle]
    # Each face from its lowest corner, and then towards the lower of the other two.
    row = np.arange(len(triangle))
    start = vertex.argmin(axis=1)
    order = (start[:, None] + np.arange(3)) % 3
    turned = vertex[row, order[:, 1]] > vertex[row, order[:, 2]]
    order[turned] = order[turned][:, [0, 2, 1]]
    signature: list[NDArray[np.generic]] = [np.take_along_axis(vertex, order, axis=1)]
    normal = part.arrays.normal
    if normal is not None:
        given = normal[np.take_along_axis(triangle, order, axis=1)]
        if part.double_sided:
            given = np.where(turned[:, None, None], -given, given)
        signature.append(given + np.float32(0.0))  # + 0 makes -0 equal to 0
    if not part.double_sided or "TANGENT" in part.column:
        signature.append(turned.reshape(-1, 1))
    repeated: NDArray[np.bool_] = np.asarray(first_equal(signature, len(triangle)) != row)
    return repeated
