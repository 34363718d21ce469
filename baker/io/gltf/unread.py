"""Warns about data of a glTF file that is missing or broken and not needed for baking.

Examples are normal maps and unused files. Such data does not stop a bake, but it is missing when another
program displays `scene.glb`.
"""

from __future__ import annotations

from collections.abc import Iterator, Set

from baker.core.errors import InputError
from baker.core.scene import SceneWarning
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject

# First bytes of PNG, JPEG, WebP, KTX2, DDS, Basis, BMP, GIF and TIFF files.
_HEADS = (
    b"\x89PNG", b"\xff\xd8\xff", b"RIFF", b"\xabKTX", b"DDS ", b"sB", b"BM", b"GIF8", b"II*\0", b"MM\0*",
)  # fmt: skip


def image_bytes(document: GltfDocument, number: int) -> bytes:
    """Return the content of an image as it is stored.

    Parameters
    ----------
    document : GltfDocument
        The document.
    number : int
        Index of the image.

    Returns
    -------
    bytes
        The encoded image.

    Raises
    ------
    InputError
        If its file or its buffer view cannot be read.
    """
    if number in document.image_files:
        return document.image_files[number]
    if number in document.image_faults:
        raise document.image_faults[number]
    image = document.root.children("images")[number]
    if "bufferView" not in image:
        image.fail("the image has neither a uri nor a bufferView")
    views = len(document.root.children("bufferViews"))
    data, offset, length, _ = document.view(image.index("bufferView", views, "bufferViews"))
    return data[offset : offset + length]


def unreadable_textures(
    document: GltfDocument, material: JsonObject, name: str, read: Set[tuple[str, str]], reported: set[int]
) -> list[SceneWarning]:
    """Return a warning for each unreadable texture of a material, except textures that baking reads.

    Parameters
    ----------
    document : GltfDocument
        The document.
    material : JsonObject
        The material.
    name : str
        Name of the material, for messages.
    read : set of (str, str)
        The textures that are read for baking, each as (path of the JSON object that contains it, its key).
    reported : set of int
        Indices of images. The unreadable image files that the returned warnings name are added.

    Returns
    -------
    list of SceneWarning
        Warnings with the code `missing-texture`.
    """
    found = []
    for holder, key in _texture_infos(material):
        if (holder.where, key) in read:
            continue
        try:
            _check_texture(document, holder.child(key))
        except InputError as error:
            prefix = f"{error.object}: " if error.object else ""
            message = (
                f"the {key} of material '{name}' cannot be read ({prefix}{error.message}); "
                "a bake does not need it, and scene.glb keeps it as it is"
            )
            found.append(SceneWarning("missing-texture", message, name))
            reported.update(k for k, fault in document.image_faults.items() if fault is error)
    return found


def unneeded_faults(document: GltfDocument, reported: Set[int]) -> list[SceneWarning]:
    """Return a warning for each buffer and image file that cannot be read and was not needed.

    Parameters
    ----------
    document : GltfDocument
        The document, after all data for baking is read.
    reported : set of int
        Indices of images that other warnings name already.

    Returns
    -------
    list of SceneWarning
        Warnings with the code `missing-file`.
    """
    images = {k: fault for k, fault in document.image_faults.items() if k not in reported}
    found = []
    for kind, faults in (("buffers", document.buffer_faults), ("images", images)):
        for number, error in faults.items():
            message = f"{error.message}; nothing that is baked needs it, and scene.glb keeps it as it is"
            found.append(SceneWarning("missing-file", message, f"{kind}[{number}]"))
    return found


def _texture_infos(holder: JsonObject) -> Iterator[tuple[JsonObject, str]]:
    """Yield (holder, key) of each texture of a material; `holder.child(key)` is the texture info."""
    for key, value in holder.value.items():
        if key == "extras" or not isinstance(value, dict):
            continue
        if key.endswith("Texture"):
            yield holder, key
        else:
            yield from _texture_infos(holder.child(key))


def _check_texture(document: GltfDocument, info: JsonObject) -> None:
    """Raise `InputError` if the texture's image is missing, a truncated PNG, or in an unknown format."""
    textures, images = document.root.children("textures"), document.root.children("images")
    texture = textures[info.index("index", len(textures), "textures")]
    extensions = texture.child_or_empty("extensions")
    holders = [texture, *(extensions.child(key) for key in extensions.value)]
    holder = next((h for h in holders if "source" in h), None)
    if holder is None:
        texture.fail("the texture has no image")
    number = holder.index("source", len(images), "images")
    data = image_bytes(document, number)
    cut = data.startswith(b"\x89PNG") and b"IEND" not in data[-64:]
    if cut or not (data.startswith(_HEADS) or data[4:8] == b"ftyp"):
        images[number].fail("the image is cut off" if cut else "the data is no image")
