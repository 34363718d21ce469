"""Defines and applies the edit that a fix or a repair makes to a primitive of a glTF mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.source_mesh import SourcePrimitive
from baker.io.gltf.edited_primitive import EditedPrimitive
from baker.repairs.normals import NormalChoice
from baker.topology.triangle_check import face_normal
from baker.topology.unique_rows import first_equal, unique_rows


@dataclass(frozen=True)
class EditablePrimitive:
    """A primitive with V vertices as stored in its file, and the limits of its edits.

    Attributes
    ----------
    arrays : SourcePrimitive
        Positions, normals, triangles and other attributes as numbers.
    column : dict of str to (V, B) uint8
        For each vertex attribute, by its name in the file, the B bytes that the file stores for each vertex.
    double_sided : bool
        Whether all materials of the primitive, including those of variants, are double-sided.
    blends : bool
        Whether a material has the alpha mode BLEND. Two coincident faces then hide more of the background
        than one face.
    reads_lightmap_uv : bool
        Whether a texture of a material uses TEXCOORD_1.
    locked : str
        Why the primitive must not be changed, as the end of a sentence; empty if it may be edited.
    """

    arrays: SourcePrimitive
    column: dict[str, NDArray[np.uint8]]
    double_sided: bool = False
    blends: bool = False
    reads_lightmap_uv: bool = False
    locked: str = ""


@dataclass(frozen=True)
class PrimitiveEdit:
    """The remaining faces of a primitive, and their new normals.

    Attributes
    ----------
    primitive : EditablePrimitive
    touched : bool
        Whether anything is changed. If not, the primitive is written as it is in the file.
    triangle : (T, 3) int64
        The remaining faces, as indices of the vertices in the file. Faces to be flipped are already flipped.
    normal : (T, 3, 3) float32, unit, object space, or None
        New normal of each face corner. None if the normals of the file are kept.
    turned : (T, 3) bool
        The face corners whose normals are negated.
    """

    primitive: EditablePrimitive
    touched: bool
    triangle: NDArray[np.int64]
    normal: NDArray[np.float32] | None
    turned: NDArray[np.bool_]


def edit_with_flips(
    primitive: EditablePrimitive,
    triangle: NDArray[np.int64],
    flip: NDArray[np.bool_],
    *,
    touched: bool,
    normals: NormalChoice | None = None,
) -> PrimitiveEdit:
    """Return the edit of a primitive.

    The normals of a flipped face are negated if their sum points away from the front of the face.

    Parameters
    ----------
    primitive : EditablePrimitive
        The primitive as in the file.
    triangle : (T, 3) int64
        The remaining faces. Faces marked in `flip` are already flipped.
    flip : (T,) bool
        The flipped faces.
    touched : bool
        Whether anything is changed.
    normals : NormalChoice or None
        New normals of the face corners, before any is negated.

    Returns
    -------
    PrimitiveEdit
        The edit, for `apply_edit`.
    """
    normals = normals or NormalChoice(None)
    turned = np.zeros(triangle.shape, bool)
    corner = normals.corner
    given = primitive.arrays.normal
    if flip.any() and given is not None:
        corner = given[triangle] if corner is None else corner
        front = face_normal(primitive.arrays.position, triangle)
        against = np.einsum("tkx,tx->t", np.nan_to_num(corner).astype(np.float64), front) < 0
        turned[flip & against] = True
        if turned.any():
            corner = np.where(turned[..., None], -corner, corner)
        else:
            corner = normals.corner
    return PrimitiveEdit(primitive, touched, triangle, corner, turned)


def apply_edit(edit: PrimitiveEdit, uv: NDArray[np.float32] | None = None) -> EditedPrimitive | None:
    """Make the new vertices of a primitive. Equal vertices are merged, and unused vertices are dropped.

    Parameters
    ----------
    edit : PrimitiveEdit
        The remaining faces and their new normals.
    uv : (T, 3, 2) float32 or None
        New TEXCOORD_1 of each face corner. None if the TEXCOORD_1 of the file is kept.

    Returns
    -------
    EditedPrimitive or None
        None if the primitive is not changed.
    """
    if not edit.touched and uv is None:
        return None
    primitive = edit.primitive
    replaced = set() if edit.normal is None else {"NORMAL"}
    replaced |= set() if uv is None else {"TEXCOORD_1"}
    column = [data for name, data in primitive.column.items() if name not in replaced]
    row = first_equal(column, len(primitive.arrays.position))[edit.triangle].reshape(-1)
    own: list[NDArray[np.generic]] = [row.reshape(-1, 1), edit.turned.reshape(-1, 1)]
    # Add 0 to make -0 equal to 0, because bits are compared.
    normal = None if edit.normal is None else edit.normal.reshape(-1, 3) + np.float32(0.0)
    own += [] if normal is None else [normal]
    own += [] if uv is None else [uv.reshape(-1, 2)]
    corner, number = unique_rows(own, len(row))
    # Sort the new vertices by the old vertices from which they are made, to keep the order of the file.
    order = np.argsort(row[corner], kind="stable")
    rank = np.zeros(len(order), np.int64)
    rank[order] = np.arange(len(order))
    corner = corner[order]
    return EditedPrimitive(
        row=row[corner],
        triangle=rank[number].reshape(-1, 3),
        normal=None if normal is None else normal[corner],
        turned=edit.turned.reshape(-1)[corner],
        uv=None if uv is None else uv.reshape(-1, 2)[corner],
    )
