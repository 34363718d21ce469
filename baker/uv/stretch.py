"""Splits the effect of a transform on lengths into a factor and a stretch."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Limit of the relative difference between the scales of an instance along different axes. Up to this limit,
# the scale is treated as uniform.
_EVEN_SCALE = 1e-4


def world_stretch(world_from_object: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Split the effect of a transform on lengths into a factor and a symmetric (3, 3) stretch.

    If the scale is uniform, the factor is the scale and the stretch is the identity, so that all uniformly
    scaled instances of a mesh share their charts. Otherwise the factor is 1 and the stretch is the square
    root of M^T M, where M is the linear part of the transform. This stretch does not depend on rotations and
    mirrors in the transform.
    """
    linear = world_from_object[:3, :3].astype(np.float64)
    gram = linear.T @ linear
    even = float(np.sqrt(np.trace(gram) / 3.0))
    if np.abs(gram - even * even * np.eye(3)).max() <= 2.0 * _EVEN_SCALE * even * even:
        return float(f"{even:.6g}"), np.eye(3)
    value, vector = np.linalg.eigh(gram)
    root = (vector * np.sqrt(np.maximum(value, 0.0))) @ vector.T
    # Round, so that instances share their charts if their transforms differ by rounding errors only.
    digits = 5 - int(np.floor(np.log10(np.abs(root).max())))
    return 1.0, np.round(0.5 * (root + root.T), digits) + 0.0
