"""Looks up a boolean property of the material of each face."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Material


def flag_of_faces(
    materials: Sequence[Material], material: NDArray[np.integer], flag: Callable[[Material], bool]
) -> NDArray[np.bool_]:
    """Return a boolean property of the material of each face.

    `flag` is called only for materials that occur in `material`. If it were called for all materials of the
    scene for each mesh, the time would be proportional to the number of meshes times that of materials.

    Parameters
    ----------
    materials : sequence of Material
        Materials of the scene.
    material : (T,) integer
        Index of the material of each face.
    flag : callable
        `flag(material)` returns the property of a material.

    Returns
    -------
    (T,) bool
        The property of each face's material.
    """
    used, face = np.unique(material, return_inverse=True)
    return np.array([flag(materials[k]) for k in used], bool)[face]
