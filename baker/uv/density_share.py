"""Computes the texel density of each object relative to others.

Objects may have a density, or a factor on the density, among their settings. Objects on which a lightmap is
invisible have a lower density. An emitter with a black base colour, such as a sky dome, reflects nothing. A
surface of alpha 0 is invisible. With the same density as other objects, a sky dome would fill almost the
whole page, because its area is much larger than the area of the scene inside.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Instance, Material, Scene

# Largest share of the page's used area for all objects on which a lightmap is invisible.
_MOST = 0.05


def density_shares(scene: Scene, instances: list[Instance]) -> NDArray[np.float64]:
    """Return (N,) float64: the factor on the texel density of each instance.

    It is below 1 only for instances on which a lightmap is invisible.
    """
    share = np.ones(len(instances))
    blank = np.array([_shows_nothing(m) for m in scene.materials], bool)
    hidden = np.array([bool(blank[scene.meshes[i.mesh].material].all()) for i in instances], bool)
    if not hidden.any() or hidden.all():
        return share
    area = np.array([_area(scene, instance) for instance in instances])
    most = _MOST / (1.0 - _MOST) * float(area[~hidden].sum())
    share[hidden] = min(1.0, float(np.sqrt(most / max(float(area[hidden].sum()), 1e-300))))
    return share


def object_shares(
    scene: Scene, instances: list[Instance], density: float | None
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return the factors on the density of the pages, and which instances have a fixed density.

    Parameters
    ----------
    scene : Scene
        Materials and meshes.
    instances : list of N Instance
        The instances, with their settings.
    density : float or None
        The setting `density` of the bake, texels per metre. With it, all other instances have this density.

    Returns
    -------
    share : (N,) float64
        Factor on the density of each instance; for fixed instances, their density in texels per metre.
    fixed : (N,) bool
        Whether an instance has an absolute density. With the setting `density`, it is expressed as a factor.
    """
    share = density_shares(scene, instances) if density is None else np.ones(len(instances))
    fixed = np.zeros(len(instances), bool)
    for k, instance in enumerate(instances):
        absolute = instance.settings.texels_per_metre
        if absolute is None:
            share[k] *= instance.settings.density_factor
        else:
            share[k] = absolute / (density or 1.0)
            fixed[k] = density is None
    return share, fixed


def _shows_nothing(material: Material) -> bool:
    """Return whether a lightmap is invisible on a material: it is black and emits, or its alpha is 0."""
    black = max(material.base_colour[:3]) <= 0.0 and max(material.emission) > 0.0
    return black or (material.alpha_mode != "OPAQUE" and material.base_colour[3] <= 0.0)


def _area(scene: Scene, instance: Instance) -> float:
    """Return the world-space area of an instance, m2."""
    mesh = scene.meshes[instance.mesh]
    position = mesh.position.astype(np.float64) @ instance.world_from_object[:3, :3].T
    corner = position[mesh.triangle]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return 0.5 * float(np.linalg.norm(cross, axis=1).sum())
