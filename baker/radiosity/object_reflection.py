"""Removes the reflection of objects whose settings say that they reflect no light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from baker.core.scene import Scene
from baker.core.texels import TexelBuffer


def without_reflection(scene: Scene, texels: TexelBuffer) -> TexelBuffer:
    """Return the texels with albedo 0 on objects that reflect no light, and area 0 where no ray hits them.

    Form factors to a texel are in proportion to its area. If an object that no ray hits had an area, light
    that other surfaces receive would be divided between them and the object.

    Parameters
    ----------
    scene : Scene
        The scene, with the settings of its instances.
    texels : TexelBuffer
        The texels of the scene.

    Returns
    -------
    TexelBuffer
        `texels` itself if all objects reflect light.
    """
    cast = scene.object_flags("cast")
    reflects = cast & scene.object_flags("bounce")
    if reflects.all():
        return texels
    seen, lit = cast[texels.instance], reflects[texels.instance]
    return replace(
        texels,
        albedo=np.where(lit[:, None], texels.albedo, np.float32(0.0)),
        area=np.where(seen, texels.area, np.float32(0.0)),
    )
