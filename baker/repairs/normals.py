"""Makes vertex normals where the file has none, or normals of zero length.

A primitive without normals is flat-shaded (glTF 2.0, 3.7.2.1), so flat normals change nothing visible.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.triangle_check import face_normal

# Deviation of a normal's length from 1 that is left as it is: rounding to single precision or short decimals.
LENGTH_SLACK = 1e-2


@dataclass(frozen=True)
class NormalChoice:
    """Normals of the corners of faces.

    Attributes
    ----------
    corner : (T, 3, 3) float32, unit, or None
        None: the file's own normals stay.
    n_missing : int
        Vertices without a normal.
    n_empty : int
        Vertices whose normal is not finite or has no length.
    n_long : int
        Vertices whose normal has a direction but not unit length.
    """

    corner: NDArray[np.float32] | None
    n_missing: int = 0
    n_empty: int = 0
    n_long: int = 0

    @property
    def n_made(self) -> int:
        """Count the vertices that get another normal."""
        return self.n_missing + self.n_empty + self.n_long


def choose_normals(
    position: NDArray[np.float32],
    triangle: NDArray[np.int64],
    normal: NDArray[np.float32] | None,
    *,
    is_float: bool,
) -> NormalChoice:
    """Return normals for the corners of faces.

    Parameters
    ----------
    position : (V, 3) float32
    triangle : (T, 3) int64
        Faces with area.
    normal : (V, 3) float32 or None
        As the file has them.
    is_float : bool
        The file stores float32. Normalized integers cannot have unit length, and their length is not tested.

    Returns
    -------
    NormalChoice
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
        # Replace empty normals by the area-weighted mean of the vertex's faces.
        face = face_normal(position, triangle)
        smooth = np.zeros_like(given)
        for axis in range(3):
            smooth[:, axis] = np.bincount(triangle.ravel(), np.repeat(face[:, axis], 3), minlength=len(given))
        size = np.bincount(triangle.ravel(), np.repeat(np.linalg.norm(face, axis=1), 3), minlength=len(given))
        # Where the faces cancel out, each corner takes the normal of its own face.
        lost = np.linalg.norm(smooth, axis=1) <= 1e-6 * size
        made = np.where(lost[triangle][..., None], face[:, None, :], smooth[triangle])
        filled = _unit(made.reshape(-1, 3)).reshape(-1, 3, 3).astype(np.float32)
        corner = np.where(empty[triangle][..., None], filled, corner)
    return NormalChoice(corner, n_empty=n_empty, n_long=n_long)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return (N, 3) vectors at unit length; zero ones stay zero."""
    # Divide by the largest component first: squares of tiny or huge components leave the exponent's range.
    scaled = vector / np.maximum(np.abs(vector).max(axis=1, keepdims=True, initial=0.0), 1e-300)
    length = np.sqrt((scaled * scaled).sum(axis=1, keepdims=True))
    return np.asarray(scaled / np.maximum(length, 1e-300))
