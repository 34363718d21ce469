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

from baker.core.scene import Material, SceneWarning, Texture
from baker.io.alpha_texture import channel, lowest_alpha, same_mapping, with_alpha
from baker.io.gltf.json import JsonObject
from baker.io.gltf.texture import TextureReader

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
    if made.alpha_mode != "OPAQUE" and (made.base_colour[3] < 1.0 or lowest_alpha(base) < 1.0):
        message = (
            f"the material '{made.name}' has alpha and transmits light ({TRANSMISSION}); its alpha is used, "
            "its transmission is not: make it OPAQUE to use its transmission"
        )
        warnings.append(SceneWarning("transmission", message, made.name))
        return made
    texture = textures.read(extension, "transmissionTexture", made.name, warnings)
    if texture is not None and base is not None and not same_mapping(texture, base):
        share *= float(channel(texture, 0).mean())
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


def _with_transmission(base: Texture | None, texture: Texture | None, share: float) -> Texture | None:
    """Return the base colour texture with the alpha 1 - share x transmission texture."""
    if texture is not None:
        return with_alpha(base, texture, np.float32(1.0) - np.float32(share) * channel(texture, 0))
    if base is None or lowest_alpha(base) == 1.0:
        return base
    # The alpha of OPAQUE materials has no effect.
    return with_alpha(base, base, np.ones((1, 1), np.float32))
