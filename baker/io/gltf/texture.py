"""Reads glTF textures: image, uv set, KHR_texture_transform and sampler.

A texture is read at `T R S uv` (KHR_texture_transform). A texture may name several images: that of
EXT_texture_webp, of EXT_texture_avif, its own, and that of KHR_texture_basisu. The first of these that can be
decoded is used. Basis Universal is the last one, because it loses more detail than a PNG or JPEG.

Based on: Khronos Group, glTF 2.0 Specification, section 3.8; KHR_texture_transform; KHR_texture_basisu;
EXT_texture_webp; EXT_texture_avif.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.scene import SceneWarning, Texture
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject
from baker.io.gltf.unread import image_bytes
from baker.io.images import decode_image, stand_in

# Number of TEXCOORD sets that are read: TEXCOORD_0 to TEXCOORD_15.
MAX_TEXCOORDS = 16
_WRAP = {10497: "repeat", 33071: "clamp", 33648: "mirror"}
# Values of a sampler's magFilter.
_NEAREST, _LINEAR = 9728, 9729


class TextureReader:
    """Reads the textures of a document, each image once.

    Parameters
    ----------
    document : GltfDocument
        The document.
    missing : str
        "error", or the colour of images that cannot be read; see `stand_in`.

    Attributes
    ----------
    reported : set of int
        Indices of the images that warnings name already.
    """

    def __init__(self, document: GltfDocument, missing: str = "error") -> None:
        self._document = document
        self._missing = missing
        self._images: dict[int, NDArray[np.uint8]] = {}
        self.reported: set[int] = set()

    def read(
        self, holder: JsonObject, key: str, name: str, warnings: list[SceneWarning], *, needed: bool = True
    ) -> Texture | None:
        """Return the texture of a material.

        Parameters
        ----------
        holder : JsonObject
            The object that contains the texture info.
        key : str
            Key of the texture info, such as "baseColorTexture".
        name : str
            Name of the material, for warnings.
        warnings : list of SceneWarning
            A warning is added if the image cannot be read and another colour replaces it.
        needed : bool
            Whether a bake needs the texture. If not, None replaces a texture that cannot be read.

        Returns
        -------
        Texture or None
            None if there is no such texture.

        Raises
        ------
        InputError
            If the texture is needed and malformed, or its image cannot be read and no colour replaces it.
        """
        try:
            return self._texture(holder, key, name, warnings, needed)
        except InputError:
            if needed:
                raise
            return None

    def _texture(
        self, holder: JsonObject, key: str, name: str, warnings: list[SceneWarning], needed: bool
    ) -> Texture | None:
        if key not in holder:
            return None
        info = holder.child(key)
        textures = self._document.root.children("textures")
        texture = textures[info.index("index", len(textures), "textures")]
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
        sampler = _sampler(self._document, texture)
        try:
            image = self._image(texture)
        except InputError as error:
            if self._missing == "error" or not needed:
                raise
            prefix = f"{error.object}: " if error.object else ""
            message = f"the {key} of material '{name}' cannot be read ({prefix}{error.message})"
            warnings.append(SceneWarning("missing-texture", f"{message}; {self._missing} replaces it", name))
            self.reported.update(k for k, fault in self._document.image_faults.items() if fault is error)
            return Texture(stand_in(self._missing), texcoord)
        return Texture(image, texcoord, transform, *sampler)

    def _image(self, texture: JsonObject) -> NDArray[np.uint8]:
        """Return the pixels of the first image of a texture that can be decoded."""
        known = self._document.root.children("images")
        sources = [
            holder.index("source", len(known), "images")
            for holder in image_holders(texture)
            if "source" in holder
        ]
        if not sources:
            names = ", ".join(texture.child_or_empty("extensions").value)
            texture.fail(f"the texture has no image that can be read ({names or 'source is missing'})")
        first: InputError | None = None
        for number in sources:
            try:
                return self._decoded(known[number], number)
            except InputError as error:
                first = first or error
        assert first is not None
        raise first

    def _decoded(self, image: JsonObject, number: int) -> NDArray[np.uint8]:
        if number not in self._images:
            data = image_bytes(self._document, number)
            self._images[number] = decode_image(data, file=image.file, object=image.where)
        return self._images[number]


def image_holders(texture: JsonObject) -> list[JsonObject]:
    """Return the objects of a texture that may name its image in `source`, the preferred one first.

    Parameters
    ----------
    texture : JsonObject
        A texture.

    Returns
    -------
    list of JsonObject
        Extensions of the texture, and the texture itself.
    """
    webp, avif, basis = (
        texture.extension(name) for name in ("EXT_texture_webp", "EXT_texture_avif", "KHR_texture_basisu")
    )
    return [holder for holder in (webp, avif, texture, basis) if holder is not None]


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
