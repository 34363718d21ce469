"""Tells what of a glTF file is missing or broken although no bake needs it: normal maps, unused files.

Such things never stop a bake. They are named, for whoever shows `scene.glb` will miss them.
"""

from __future__ import annotations

from collections.abc import Iterator, Set

from baker.core.errors import InputError
from baker.core.scene import SceneWarning
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject

# First bytes of the image formats that glTF and its extensions name, and of others that loaders take.
_HEADS = (
    b"\x89PNG", b"\xff\xd8\xff", b"RIFF", b"\xabKTX", b"DDS ", b"sB", b"BM", b"GIF8", b"II*\0", b"MM\0*",
)  # fmt: skip


def image_bytes(document: GltfDocument, number: int) -> bytes:
    """Return the content of an image as it is stored.

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
    document: GltfDocument, material: JsonObject, name: str, read: Set[tuple[str, str]], told: set[int]
) -> list[SceneWarning]:
    """Return a warning for each texture of a material that a bake does not read and nobody could.

    Parameters
    ----------
    document : GltfDocument
    material : JsonObject
    name : str
        The material's.
    read : set of (str, str)
        Place and key of the textures that the bake does read.
    told : set of int
        Added to: the images whose faults are told here.
    """
    found = []
    for holder, key in _texture_infos(material):
        if (holder.where, key) in read:
            continue
        try:
            _check_texture(document, holder.child(key))
        except InputError as error:
            place = f"{error.object}: " if error.object else ""
            message = (
                f"the {key} of material '{name}' cannot be read ({place}{error.message}); "
                "a bake does not need it, and scene.glb keeps it as it is"
            )
            found.append(SceneWarning("missing-texture", message, name))
            told.update(k for k, fault in document.image_faults.items() if fault is error)
    return found


def unneeded_faults(document: GltfDocument, told: Set[int]) -> list[SceneWarning]:
    """Return a warning for each buffer and image file that cannot be read and turned out not to be needed.

    Parameters
    ----------
    document : GltfDocument
    told : set of int
        Images whose faults are known already.
    """
    images = {k: fault for k, fault in document.image_faults.items() if k not in told}
    found = []
    for kind, faults in (("buffers", document.buffer_faults), ("images", images)):
        for number, error in faults.items():
            message = f"{error.message}; nothing that is baked needs it, and scene.glb keeps it as it is"
            found.append(SceneWarning("missing-file", message, f"{kind}[{number}]"))
    return found


def _texture_infos(holder: JsonObject) -> Iterator[tuple[JsonObject, str]]:
    """List the texture references of a material, those inside its extensions included."""
    for key, value in holder.value.items():
        if key == "extras" or not isinstance(value, dict):
            continue
        if key.endswith("Texture"):
            yield holder, key
        else:
            yield from _texture_infos(holder.child(key))


def _check_texture(document: GltfDocument, info: JsonObject) -> None:
    """Raise `InputError` if the texture's image is not there or is no image by its first bytes."""
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
