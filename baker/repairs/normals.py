"""Makes vertex normals where the file has none, or none that say anything.

Without normals a face is flat (glTF 2.0, 3.7.2.1), so flat normals are what every renderer shows already.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.topology.triangle_check import face_normal

# Difference from 1 that a normal's length may have: what single precision and sloppy exporters leave.
LENGTH_SLACK = 1e-2


@dataclass(frozen=True)
class NormalChoice:
    """Normals of the corners of faces.

    Attributes
    ----------
    corner : (T, 3, 3) float32, unit, or None
        None if the file's own can stay as they are.
    n_missing : int
        Vertices that had no normal at all.
    n_empty : int
        Vertices whose normal was not finite or had no length.
    n_long : int
        Vertices whose normal pointed somewhere but was not of unit length.
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
    exact: bool,
) -> NormalChoice:
    """Return normals for the corners of faces.

    Parameters
    ----------
    position : (V, 3) float32
    triangle : (T, 3) int64, with area
    normal : (V, 3) float32 or None
        As the file has them.
    exact : bool
        The file stores floats; shorter numbers cannot have unit length and are not judged by it.
    """
    used = np.unique(triangle)
    if normal is None:
        flat = _unit(face_normal(position, triangle)).astype(np.float32)
        return NormalChoice(np.repeat(flat[:, None, :], 3, axis=1), n_missing=len(used))
    given = normal.astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        length = np.sqrt((given * given).sum(axis=1))
        empty = ~(np.isfinite(length) & (length > 1e-12))
        long = ~empty & (np.abs(length - 1.0) > LENGTH_SLACK) if exact else np.zeros(len(given), bool)
    n_empty, n_long = int(empty[used].sum()), int(long[used].sum())
    if not n_empty and not n_long:
        return NormalChoice(None)
    out = normal.copy()
    out[long] = _unit(given[long]).astype(np.float32)
    out[empty] = 0.0
    corner = out[triangle]
    if n_empty:
        face = face_normal(position, triangle)
        smooth = np.zeros_like(given)
        for axis in range(3):
            smooth[:, axis] = np.bincount(triangle.ravel(), np.repeat(face[:, axis], 3), minlength=len(given))
        size = np.bincount(triangle.ravel(), np.repeat(np.linalg.norm(face, axis=1), 3), minlength=len(given))
        # Faces that cancel out leave no direction: each corner takes the normal of its own face then.
        lost = np.linalg.norm(smooth, axis=1) <= 1e-6 * size
        made = np.where(lost[triangle][..., None], face[:, None, :], smooth[triangle])
        filled = _unit(made.reshape(-1, 3)).reshape(-1, 3, 3).astype(np.float32)
        corner = np.where(empty[triangle][..., None], filled, corner)
    return NormalChoice(corner, n_empty=n_empty, n_long=n_long)


def _unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    # By the largest component first, so that squares of tiny or huge vectors stay in range.
    scaled = vector / np.maximum(np.abs(vector).max(axis=1, keepdims=True, initial=0.0), 1e-300)
    length = np.sqrt((scaled * scaled).sum(axis=1, keepdims=True))
    return np.asarray(scaled / np.maximum(length, 1e-300))
