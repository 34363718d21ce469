"""Reads glTF materials that transmit light: KHR_materials_transmission, with volume and ior.

Such a material becomes a pane (`Material.reflectance`): a BLEND material whose alpha is the share that it
does not transmit. Light passes it in a straight line. Each crossing multiplies the light by

    transmission x base colour x (1 - F) x attenuationColor^(thickness / (2 attenuationDistance))

A ray crosses the surface of a closed object twice, so each crossing has half of the attenuation. F is the
Fresnel reflectance, see `shading.kernels.pane`.

Based on: Khronos Group, KHR_materials_transmission, KHR_materials_volume, KHR_materials_ior.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Material, SceneWarning, Texture
from baker.io.gltf.json import JsonObject
from baker.io.gltf.texture import TextureReader
from baker.io.images import resized

TRANSMISSION = "KHR_materials_transmission"


def as_pane(
    material: JsonObject, made: Material, textures: TextureReader, warnings: list[SceneWarning]
) -> Material:
    """Return a material as a pane if it transmits light, else unchanged.

    Parameters
    ----------
    material : JsonObject
        The glTF material.
    made : Material
        The material as it is without transmission.
    textures : TextureReader
        Reads the texture of the transmission.
    warnings : list of SceneWarning
        A warning is added if the transmission, or its texture, is not used.

    Returns
    -------
    Material
        The pane, or `made`.

    Raises
    ------
    InputError
        For values of a wrong type or out of range, and for a texture that cannot be read.
    """
    extension, share = material.extension(TRANSMISSION), _share(material)
    if extension is None or share == 0.0:
        return made
    base = made.base_colour_texture
    if made.alpha_mode != "OPAQUE" and (made.base_colour[3] < 1.0 or _lowest_alpha(base) < 1.0):
        message = (
            f"the material '{made.name}' has alpha and transmits light ({TRANSMISSION}); its alpha is used, "
            "its transmission is not: make it OPAQUE to use its transmission"
        )
        warnings.append(SceneWarning("transmission", message, made.name))
        return made
    texture = textures.read(extension, "transmissionTexture", made.name, warnings)
    if texture is not None and base is not None and not _same_place(texture, base):
        share *= float(_red(texture.image).mean())
        message = (
            f"the transmission texture of material '{made.name}' has other uv or another sampler than its "
            "base colour texture; the mean of the texture is used"
        )
        warnings.append(SceneWarning("transmission", message, made.name))
        texture = None
    red, green, blue = (c * v for c, v in zip(made.base_colour[:3], _attenuation(material), strict=True))
    return replace(
        made,
        base_colour=(red, green, blue, 1.0 - share if texture is None else 1.0),
        base_colour_texture=_with_transmission(base, texture, share),
        alpha_mode="BLEND",
        reflectance=_reflectance(material),
    )


def transmits(material: JsonObject) -> bool:
    """Return whether a glTF material has a transmission above 0.

    Parameters
    ----------
    material : JsonObject
        The glTF material.

    Returns
    -------
    bool
        False without KHR_materials_transmission.

    Raises
    ------
    InputError
        If the transmission is not a number from 0 to 1.
    """
    return _share(material) > 0.0


def _share(material: JsonObject) -> float:
    extension = material.extension(TRANSMISSION)
    return 0.0 if extension is None else extension.number("transmissionFactor", 0.0, low=0.0, high=1.0)


def _reflectance(material: JsonObject) -> float:
    """Return the Fresnel reflectance at normal incidence; 0.04 for the default ior of 1.5."""
    extension = material.extension("KHR_materials_ior")
    ior = 1.5 if extension is None else extension.number("ior", 1.5, low=0.0)
    return ((ior - 1.0) / (ior + 1.0)) ** 2


def _attenuation(material: JsonObject) -> tuple[float, ...]:
    """Return the RGB factor of one crossing of the surface of a volume."""
    volume = material.extension("KHR_materials_volume")
    if volume is None:
        return (1.0, 1.0, 1.0)
    thickness = volume.number("thicknessFactor", 0.0, low=0.0)
    # The default of the distance is infinite.
    distance = volume.number("attenuationDistance") if "attenuationDistance" in volume else math.inf
    colour = volume.numbers("attenuationColor", 3, (1.0, 1.0, 1.0))
    if distance <= 0.0 or min(colour) < 0.0:
        volume.fail("the attenuation distance is not above 0, or a colour is negative")
    return tuple(min(c, 1.0) ** (thickness / (2.0 * distance)) for c in colour)


def _same_place(a: Texture, b: Texture) -> bool:
    """Return whether two textures of a material have the same uv and wrap modes."""
    return a.texcoord == b.texcoord and a.wrap == b.wrap and np.array_equal(a.transform, b.transform)


def _lowest_alpha(texture: Texture | None) -> float:
    if texture is None:
        return 1.0
    return float(texture.image[..., 3].min()) / (255.0 if texture.image.dtype == np.uint8 else 1.0)


def _red(image: NDArray[np.uint8] | NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the red values of an image as they are stored, 0 to 1."""
    scale = np.float32(255.0 if image.dtype == np.uint8 else 1.0)
    return np.asarray(image[..., 0], np.float32) / scale


def _with_transmission(base: Texture | None, texture: Texture | None, share: float) -> Texture | None:
    """Return the base colour texture with the alpha 1 - share x transmission texture."""
    if texture is None:
        return (
            base if base is None or _lowest_alpha(base) == 1.0 else replace(base, image=_opaque(base.image))
        )
    if base is None:
        image = np.full((*texture.image.shape[:2], 4), 255, np.uint8)
        image[..., 3] = np.rint(255.0 * (1.0 - share * _red(texture.image)))
        return replace(texture, image=image)
    height = max(base.image.shape[0], texture.image.shape[0])
    width = max(base.image.shape[1], texture.image.shape[1])
    red = _red(resized(texture.image, width, height))
    image = _opaque(resized(base.image, width, height))
    full = 255.0 if image.dtype == np.uint8 else 1.0
    image[..., 3] = np.rint(full * (1.0 - share * red)) if full > 1.0 else 1.0 - share * red
    return replace(base, image=image)


def _opaque(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    out = image.copy()
    out[..., 3] = 255 if image.dtype == np.uint8 else 1
    return out
