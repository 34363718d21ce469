"""Reads glTF materials: base colour, emission, metallic and roughness, sidedness, alpha, and textures.

uv_image = T R S uv, KHR_texture_transform; L = emissiveFactor x texture x emissiveStrength.

Based on: Khronos Group, glTF 2.0 Specification, section 3.9; KHR_texture_transform; KHR_materials_unlit.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Material, Texture
from baker.io.gltf_document import GltfDocument
from baker.io.gltf_json import JsonObject
from baker.io.images import decode_image

DEFAULT_MATERIAL = Material(name="default")
# Sets above this number are a broken file, not a mesh that somebody made.
MOST_TEXCOORDS = 16
_WRAP = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
_ALPHA = ("OPAQUE", "MASK", "BLEND")


def read_materials(document: GltfDocument, *, reflections: bool = False) -> list[Material]:
    """Return the file's materials in its order.

    Parameters
    ----------
    document : GltfDocument
    reflections : bool
        Also decode textures that only say how mirror-like a surface is.

    Raises
    ------
    InputError
        For values of a wrong type or out of range, and images that cannot be decoded.
    """
    images: dict[int, NDArray[np.uint8]] = {}
    materials = document.root.children("materials")
    return [_material(document, m, i, images, reflections) for i, m in enumerate(materials)]


def _material(
    document: GltfDocument,
    material: JsonObject,
    number: int,
    images: dict[int, NDArray[np.uint8]],
    reflections: bool,
) -> Material:
    surface = material.child_or_empty("pbrMetallicRoughness")
    red, green, blue, alpha = surface.numbers("baseColorFactor", 4, (1.0, 1.0, 1.0, 1.0))
    emission = material.numbers("emissiveFactor", 3, (0.0, 0.0, 0.0))
    if min(red, green, blue, alpha) < 0 or min(emission) < 0:
        material.fail("a colour factor is negative")
    glow = material.extension("KHR_materials_emissive_strength")
    strength = glow.number("emissiveStrength", 1.0, low=0.0) if glow is not None else 1.0
    mode = material.string("alphaMode", "OPAQUE")
    if mode not in _ALPHA:
        material.fail(f"'{mode[:20]}' is none of {', '.join(_ALPHA)}", "alphaMode")
    emission_texture = _texture(document, material, "emissiveTexture", images)
    if material.extension("KHR_materials_unlit") is not None:
        # An unlit surface shows its base colour and nothing else; here that colour reflects.
        strength, emission_texture = 0.0, None
    return Material(
        name=material.string("name", f"material_{number}"),
        base_colour=(red, green, blue, alpha),
        base_colour_texture=_texture(document, surface, "baseColorTexture", images),
        emission=(emission[0] * strength, emission[1] * strength, emission[2] * strength),
        emission_texture=emission_texture,
        double_sided=material.boolean("doubleSided", False),
        alpha_mode=mode,
        alpha_cutoff=material.number("alphaCutoff", 0.5, low=0.0),
        metallic=surface.number("metallicFactor", 1.0, low=0.0, high=1.0),
        roughness=surface.number("roughnessFactor", 1.0, low=0.0, high=1.0),
        metallic_roughness_texture=(
            _texture(document, surface, "metallicRoughnessTexture", images) if reflections else None
        ),
    )


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
    if texcoord >= MOST_TEXCOORDS:
        info.fail(f"set {texcoord} is not read; there may be {MOST_TEXCOORDS}", "texCoord")
    return Texture(image, texcoord, transform, _wrap(document, texture))


def texture_transform(
    offset: tuple[float, ...], rotation: float, scale: tuple[float, ...]
) -> NDArray[np.float64]:
    """Return KHR_texture_transform as a (2, 3) matrix, image uv from mesh uv.

    Parameters
    ----------
    offset, scale : (2,) tuple
    rotation : float
        Radians, counter-clockwise as seen on the image, whose v points down.

    Notes
    -----
    The extension's text, its example of a turned quadrant and its test model agree on
    u' = u cos + v sin, v' = -u sin + v cos; its GLSL lines, read as column-major, turn the other way.
    """
    c, s = math.cos(rotation), math.sin(rotation)
    return np.array(
        [[c * scale[0], s * scale[1], offset[0]], [-s * scale[0], c * scale[1], offset[1]]], np.float64
    )


def _wrap(document: GltfDocument, texture: JsonObject) -> tuple[str, str]:
    if "sampler" not in texture:
        return ("repeat", "repeat")
    samplers = document.root.children("samplers")
    sampler = samplers[texture.index("sampler", len(samplers), "samplers")]
    modes = []
    for key in ("wrapS", "wrapT"):
        code = sampler.integer(key, 10497)
        if code not in _WRAP:
            sampler.fail(f"{code} is not a wrap mode; known are {', '.join(map(str, _WRAP))}", key)
        modes.append(_WRAP[code])
    return (modes[0], modes[1])


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
            _image_bytes(document, known[number], number), file=known[number].file, object=known[number].where
        )
    return images[number]


def _image_bytes(document: GltfDocument, image: JsonObject, number: int) -> bytes:
    if number in document.image_files:
        return document.image_files[number]
    if "bufferView" not in image:
        image.fail("the image has neither a uri nor a bufferView")
    views = len(document.root.children("bufferViews"))
    data, offset, length, _ = document.view(image.index("bufferView", views, "bufferViews"))
    return data[offset : offset + length]
