"""Reads a flag of the materials of faces."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Material


def flag_of_faces(
    materials: Sequence[Material], material: NDArray[np.integer], flag: Callable[[Material], bool]
) -> NDArray[np.bool_]:
    """Return a flag of the material of each face.

    `flag` is called only for materials that occur. A table of all materials for each mesh would make the
    time proportional to meshes times materials.

    Parameters
    ----------
    materials : sequence of Material
        Materials of the scene.
    material : (T,) integer
        Index of the material of each face.
    flag : callable
        Returns the flag of a material.

    Returns
    -------
    (T,) bool
        The flag of each face.
    """
    used, face = np.unique(material, return_inverse=True)
    return np.array([flag(materials[k]) for k in used], bool)[face]
