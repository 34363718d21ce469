"""Makes vertex normals for primitives without normals, and replaces unusable normals.

glTF requires flat shading for primitives without normals (glTF 2.0, 3.7.2.1), so adding flat normals is not
visible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.triangle_check import face_normal

# Largest deviation of a normal's length from 1 that is accepted. Rounding causes smaller deviations.
LENGTH_SLACK = 1e-2


@dataclass(frozen=True)
class NormalChoice:
    """New normals of the face corners of a primitive, and the numbers of defective normals.

    Attributes
    ----------
    corner : (T, 3, 3) float32, unit, or None
        Normal of each face corner. None if the normals of the file are kept.
    n_missing : int
        Number of vertices without a normal.
    n_empty : int
        Number of vertices whose normal is zero or not finite.
    n_long : int
        Number of vertices whose normal has a direction, but a length other than 1.
    """

    corner: NDArray[np.float32] | None
    n_missing: int = 0
    n_empty: int = 0
    n_long: int = 0

    @property
    def n_made(self) -> int:
        """Return the number of vertices that get a new normal."""
        return self.n_missing + self.n_empty + self.n_long


def choose_normals(
    position: NDArray[np.float32],
    triangle: NDArray[np.int64],
    normal: NDArray[np.float32] | None,
    *,
    is_float: bool,
) -> NormalChoice:
    """Make new normals of face corners, if normals are missing or defective.

    Parameters
    ----------
    position : (V, 3) float32
        Vertices of the primitive.
    triangle : (T, 3) int64
        Faces of the primitive, all with area.
    normal : (V, 3) float32 or None
        Vertex normals of the file.
    is_float : bool
        Whether the file stores normals as float32. The length of normalized integers is not tested, because
        rounding changes it.

    Returns
    -------
    NormalChoice
        The new normals, or None in `corner` if the normals of the file are kept.
    """
    used = np.unique(triangle)
    if normal is None:
        flat = _unit(face_normal(position, triangle)).astype(np.float32)
        return NormalChoice(np.repeat(flat[:, None, :], 3, axis=1), n_missing=len(used))
    given = normal.astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.sqrt((given * given).sum(axis=1))
        empty = ~(np.isfinite(length) & (length > 1e-12))
        long = ~empty & (np.abs(length - 1.0) > LENGTH_SLACK) if is_float else np.zeros(len(given), bool)
    n_empty, n_long = int(empty[used].sum()), int(long[used].sum())
    if not n_empty and not n_long:
        return NormalChoice(None)
    out = normal.copy()
    out[long] = _unit(given[long]).astype(np.float32)
    out[empty] = 0.0
    corner = out[triangle]
    if n_empty:
        # Replace an empty normal by the area-weighted mean of the normals of the vertex's faces.
        face = face_normal(position, triangle)
        smooth = np.zeros_like(given)
        for axis in range(3):
            smooth[:, axis] = np.bincount(triangle.ravel(), np.repeat(face[:, axis], 3), minlength=len(given))
        size = np.bincount(triangle.ravel(), np.repeat(np.linalg.norm(face, axis=1), 3), minlength=len(given))
        # If the mean is nearly zero, replace the normal at each corner by the normal of its face.
        lost = np.linalg.norm(smooth, axis=1) <= 1e-6 * size
        made = np.where(lost[triangle][..., None], face[:, None, :], smooth[triangle])
        filled = _unit(made.reshape(-1, 3)).reshape(-1, 3, 3).astype(np.float32)
        corner = np.where(empty[triangle][..., None], filled, corner)
    return NormalChoice(corner, n_empty=n_empty, n_long=n_long)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Normalise the vectors (N, 3). Zero vectors are returned unchanged."""
    # Divide by the largest component first, so that squares neither underflow nor overflow.
    scaled = vector / np.maximum(np.abs(vector).max(axis=1, keepdims=True, initial=0.0), 1e-300)
    length = np.sqrt((scaled * scaled).sum(axis=1, keepdims=True))
    return np.asarray(scaled / np.maximum(length, 1e-300))
