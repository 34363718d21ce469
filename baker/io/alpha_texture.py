"""Puts an opacity that is stored in another image into the alpha of a base colour texture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Texture
from baker.io.images import resized


def with_alpha(base: Texture | None, like: Texture, alpha: NDArray[np.float32]) -> Texture:
    """Return a base colour texture with another alpha.

    Parameters
    ----------
    base : Texture or None
        The base colour texture; None for white.
    like : Texture
        Its uv and wrap modes are used if there is no `base`. They must be equal to those of `base`.
    alpha : (H, W) float32
        Alpha, 0 to 1. If its size is not that of `base`, the result has the larger width and height.

    Returns
    -------
    Texture
        The texture; alpha is rounded to 8 bits if the image of `base` has 8 bits.
    """
    if base is None:
        white = np.full((1, 1, 4), 255, np.uint8)
        base = replace(like, image=white)
    height, width = (max(a, b) for a, b in zip(base.image.shape[:2], alpha.shape, strict=True))
    image = resized(base.image, width, height).copy()
    values = resized(alpha[..., None], width, height)[..., 0]
    image[..., 3] = np.rint(255.0 * values) if image.dtype == np.uint8 else values
    return replace(base, image=image)


def same_mapping(a: Texture, b: Texture) -> bool:
    """Return whether two textures of a material have the same uv and wrap modes.

    Parameters
    ----------
    a, b : Texture
        The textures.

    Returns
    -------
    bool
        True if a point of the surface has the same image uv in both.
    """
    return a.texcoord == b.texcoord and a.wrap == b.wrap and np.array_equal(a.transform, b.transform)


def lowest_alpha(texture: Texture | None) -> float:
    """Return the smallest alpha of a texture, 1 for None.

    Parameters
    ----------
    texture : Texture or None
        The texture.

    Returns
    -------
    float
        0 to 1.
    """
    return 1.0 if texture is None else float(channel(texture, 3).min())


def channel(texture: Texture, number: int) -> NDArray[np.float32]:
    """Return the values of one channel of a texture as they are stored.

    Parameters
    ----------
    texture : Texture
        The texture.
    number : int
        0 for red to 3 for alpha.

    Returns
    -------
    (H, W) float32
        0 to 1.
    """
    scale = np.float32(255.0 if texture.image.dtype == np.uint8 else 1.0)
    return np.asarray(texture.image[..., number], np.float32) / scale
