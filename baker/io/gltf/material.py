"""Reads glTF materials: base colour, emission, metallic and roughness, sidedness, alpha, and textures.

A texture is read at `T R S uv` (KHR_texture_transform).
The emitted radiance is `emissiveFactor x texture x emissiveStrength`, cd/m2; unlit materials emit nothing.

Based on: Khronos Group, glTF 2.0 Specification, section 3.9; KHR_texture_transform; KHR_materials_unlit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.scene import Material, SceneWarning, Texture
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject
from baker.io.gltf.surface import read_surface
from baker.io.gltf.unread import image_bytes, unreadable_textures
from baker.io.images import decode_image

DEFAULT_MATERIAL = Material(name="default")
# Number of TEXCOORD sets that are read: TEXCOORD_0 to TEXCOORD_15.
MAX_TEXCOORDS = 16
_WRAP = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
# Values of a sampler's magFilter.
_NEAREST, _LINEAR = 9728, 9729
_ALPHA = ("OPAQUE", "MASK", "BLEND")


class MaterialReader:
    """Reads the materials of a file, each at the first call of `need` for it.

    Parameters
    ----------
    document : GltfDocument
        The document.
    reflections : bool
        Also decode metallic-roughness textures.

    Attributes
    ----------
    materials : list of Material
        In the file's order. A material for which `need` was not called has default values. The default
        material is appended if it was needed.
    warnings : list of SceneWarning
        Warnings about the materials that were read.
    reported : set of int
        Indices of the images that these warnings name.
    """

    def __init__(self, document: GltfDocument, *, reflections: bool = False) -> None:
        self._document = document
        self._reflections = reflections
        self._images: dict[int, NDArray[np.uint8]] = {}
        self._unread = document.root.children("materials")
        self.materials = [Material(name=_name(m, i)) for i, m in enumerate(self._unread)]
        self._read: set[int] = set()
        self.warnings: list[SceneWarning] = []
        self.reported: set[int] = set()

    def need(self, number: int) -> Material:
        """Return a material by its index; the index after the last one returns glTF's default material.

        Raises
        ------
        InputError
            If a value has a wrong type or is out of range. If the texture of the base colour cannot be read,
            or that of the emission of a material that emits.
        """
        if number == len(self._unread):
            if len(self.materials) == number:
                self.materials.append(DEFAULT_MATERIAL)
        elif number not in self._read:
            self._read.add(number)
            self.materials[number] = self._material(self._unread[number], number)
        return self.materials[number]

    def _material(self, material: JsonObject, number: int) -> Material:
        name = material.string("name", f"material_{number}")
        unlit = material.extension("KHR_materials_unlit") is not None
        surface = read_surface(material, name, self.warnings)
        emission = material.numbers("emissiveFactor", 3, (0.0, 0.0, 0.0))
        if min(surface.colour) < 0 or min(emission) < 0:
            material.fail("a colour factor is negative")
        factor = material.extension("KHR_materials_emissive_strength")
        strength = factor.number("emissiveStrength", 1.0, low=0.0) if factor is not None else 1.0
        # An unlit material reflects its base colour and emits nothing.
        strength = 0.0 if unlit else strength
        mode = material.string("alphaMode", "OPAQUE")
        if mode not in _ALPHA:
            material.fail(f"'{mode[:20]}' is none of {', '.join(_ALPHA)}", "alphaMode")
        through = material.extension("KHR_materials_transmission")
        if mode == "OPAQUE" and through is not None and through.number("transmissionFactor", 0.0) > 0:
            message = (
                f"the material '{name}' transmits light (KHR_materials_transmission), which a bake does not "
                "read: it blocks light; let light through with alphaMode BLEND and an alpha below 1"
            )
            self.warnings.append(SceneWarning("transmission", message, name))
        read = {(surface.holder.where, surface.texture)}
        emits = strength > 0 and max(emission) > 0
        if emits:
            read.add((material.where, "emissiveTexture"))
        self.warnings += unreadable_textures(self._document, material, name, read, self.reported)
        return Material(
            name=name,
            base_colour=surface.colour,
            base_colour_texture=self._texture(surface.holder, surface.texture),
            emission=(emission[0] * strength, emission[1] * strength, emission[2] * strength),
            emission_texture=(None if unlit else self._texture(material, "emissiveTexture", needed=emits)),
            double_sided=material.boolean("doubleSided", False),
            alpha_mode=mode,
            alpha_cutoff=material.number("alphaCutoff", 0.5, low=0.0),
            metallic=surface.metallic,
            roughness=surface.roughness,
            metallic_roughness_texture=(
                self._texture(surface.holder, "metallicRoughnessTexture", needed=False)
                if self._reflections
                else None
            ),
        )

    def _texture(self, holder: JsonObject, key: str, *, needed: bool = True) -> Texture | None:
        try:
            return _texture(self._document, holder, key, self._images)
        except InputError:
            if needed:
                raise
            return None


def _name(material: JsonObject, number: int) -> str:
    """Return the name of a material, or `material_<number>` if its name is malformed."""
    try:
        return material.string("name", f"material_{number}")
    except InputError:
        return f"material_{number}"


def _texture(
    document: GltfDocument, holder: JsonObject, key: str, images: dict[int, NDArray[np.uint8]]
) -> Texture | None:
    if key not in holder:
        return None
    info = holder.child(key)
    textures = document.root.children("textures")
    texture = textures[info.index("index", len(textures), "textures")]
    image = _image(document, texture, images)
    texcoord = info.integer("texCoord", 0)
    transform = np.eye(2, 3)
    moved = info.extension("KHR_texture_transform")
    if moved is not None:
        texcoord = moved.integer("texCoord", texcoord)
        transform = texture_transform(
            moved.numbers("offset", 2, (0.0, 0.0)),
            moved.number("rotation", 0.0),
            moved.numbers("scale", 2, (1.0, 1.0)),
        )
    if texcoord >= MAX_TEXCOORDS:
        info.fail(f"set {texcoord} is not read; there may be {MAX_TEXCOORDS}", "texCoord")
    return Texture(image, texcoord, transform, *_sampler(document, texture))


def texture_transform(
    offset: tuple[float, ...], rotation: float, scale: tuple[float, ...]
) -> NDArray[np.float64]:
    """Return KHR_texture_transform as a matrix.

    Parameters
    ----------
    offset, scale : (2,) tuple
        Members of the extension.
    rotation : float
        Radians, counter-clockwise on the image, whose v points down.

    Returns
    -------
    (2, 3) float64
        The matrix that maps mesh uv to image uv.

    Notes
    -----
    The text of the extension, its example of a rotated quadrant and its test model agree on
    u' = u cos + v sin, v' = -u sin + v cos. The extension's GLSL code, read as column-major, rotates
    the other way.
    """
    c, s = math.cos(rotation), math.sin(rotation)
    return np.array(
        [[c * scale[0], s * scale[1], offset[0]], [-s * scale[0], c * scale[1], offset[1]]], np.float64
    )


def _sampler(document: GltfDocument, texture: JsonObject) -> tuple[tuple[str, str], bool]:
    """Return the wrap modes along u and v, and whether magnification uses nearest-texel filtering."""
    if "sampler" not in texture:
        return ("repeat", "repeat"), False
    samplers = document.root.children("samplers")
    sampler = samplers[texture.index("sampler", len(samplers), "samplers")]
    modes = []
    for key in ("wrapS", "wrapT"):
        code = sampler.integer(key, 10497)
        if code not in _WRAP:
            sampler.fail(f"{code} is not a wrap mode; known are {', '.join(map(str, _WRAP))}", key)
        modes.append(_WRAP[code])
    return (modes[0], modes[1]), sampler.integer("magFilter", _LINEAR) == _NEAREST


def _image(
    document: GltfDocument, texture: JsonObject, images: dict[int, NDArray[np.uint8]]
) -> NDArray[np.uint8]:
    known = document.root.children("images")
    source = texture.extension("EXT_texture_webp") or texture
    if "source" not in source:
        names = ", ".join(texture.child_or_empty("extensions").value)
        texture.fail(f"the texture has no image that can be read ({names or 'source is missing'})")
    number = source.index("source", len(known), "images")
    if number not in images:
        images[number] = decode_image(
            image_bytes(document, number), file=known[number].file, object=known[number].where
        )
    return images[number]
