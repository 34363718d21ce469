"""Reads the base colour of a glTF material: metallic-roughness, specular-glossiness, or neither.

The base colour is `baseColorFactor x baseColorTexture`. If a material has KHR_materials_pbrSpecularGlossiness
and is not unlit, its base colour is `diffuseFactor x diffuseTexture`, and its pbrMetallicRoughness is
ignored.

Based on: Khronos Group, glTF 2.0 Specification, section 3.9.2; KHR_materials_pbrSpecularGlossiness.
"""

from __future__ import annotations

from typing import NamedTuple

from baker.core.scene import SceneWarning
from baker.io.gltf.json import JsonObject
from baker.io.gltf.known_extensions import extension_of

# Albedo of a material whose reflection model is unknown, 0 to 1.
UNKNOWN_ALBEDO = 0.5
_GLOSSY = "KHR_materials_pbrSpecularGlossiness"


class PbrSurface(NamedTuple):
    """Base colour, metallic and roughness of a material.

    Attributes
    ----------
    colour : (4,) tuple, linear RGB and alpha
    holder : JsonObject
        The JSON object that contains the base colour texture, if there is one.
    texture : str
        Key of the texture in that object.
    metallic, roughness : float
    """

    colour: tuple[float, float, float, float]
    holder: JsonObject
    texture: str
    metallic: float
    roughness: float


def read_surface(material: JsonObject, name: str, warnings: list[SceneWarning]) -> PbrSurface:
    """Read base colour, metallic and roughness; an unknown reflection model gets albedo 0.5 and a warning.

    Parameters
    ----------
    material : JsonObject
        The material.
    name : str
        Name of the material, for the warning.
    warnings : list of SceneWarning
        A warning is added if the reflection model is unknown.

    Returns
    -------
    PbrSurface
        Base colour, its texture, metallic and roughness.
    """
    metallic_roughness = material.child_or_empty("pbrMetallicRoughness")
    unlit = material.extension("KHR_materials_unlit") is not None
    glossy = material.extension(_GLOSSY)
    if glossy is not None and not unlit:
        return PbrSurface(
            _four(glossy.numbers("diffuseFactor", 4, (1.0, 1.0, 1.0, 1.0))),
            glossy,
            "diffuseTexture",
            0.0,
            1.0 - glossy.number("glossinessFactor", 1.0, low=0.0, high=1.0),
        )
    colour = _four(metallic_roughness.numbers("baseColorFactor", 4, (1.0, 1.0, 1.0, 1.0)))
    if "baseColorFactor" not in metallic_roughness and "baseColorTexture" not in metallic_roughness:
        unknown = [name for name in sorted(material.child_or_empty("extensions").value) if _replaces(name)]
        if unknown:
            message = (
                f"the material '{name}' has no base colour but {unknown[0]}, which is not understood; "
                f"it reflects {UNKNOWN_ALBEDO}: export it with a baseColorFactor or baseColorTexture"
            )
            warnings.append(SceneWarning("unknown-material", message, name))
            colour = (UNKNOWN_ALBEDO, UNKNOWN_ALBEDO, UNKNOWN_ALBEDO, 1.0)
    return PbrSurface(
        colour,
        metallic_roughness,
        "baseColorTexture",
        metallic_roughness.number("metallicFactor", 1.0, low=0.0, high=1.0),
        metallic_roughness.number("roughnessFactor", 1.0, low=0.0, high=1.0),
    )


def _replaces(name: str) -> bool:
    """Return whether an extension may contain the base colour; if not, glTF's default white applies."""
    extension = extension_of(name)
    return extension is None or extension.replaces_colour


def _four(value: tuple[float, ...]) -> tuple[float, float, float, float]:
    red, green, blue, alpha = value
    return red, green, blue, alpha
