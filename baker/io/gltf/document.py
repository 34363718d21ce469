"""Opens glTF 2.0 documents: JSON, buffers, and the bytes of external images.

A buffer or image that cannot be read is an error only when its data is needed. A file outside the folder of
the scene is always an error.

Based on: Khronos Group, glTF 2.0 Specification, sections 3.2 (asset) and 3.6 (buffers).
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NoReturn

from baker.core.errors import InputError
from baker.io.gltf.chunks import CONVERTER, MAGIC, Chunks, split_glb
from baker.io.gltf.json import JsonObject
from baker.io.gltf.uri import UriError, is_data, read_uri
from baker.io.scene_folder import OutsideError, OutsideName, SceneFolder

# Top-level members that must be lists, because the writer of scene.glb may append to them.
_LISTS = ("accessors", "bufferViews", "materials", "meshes", "nodes", "images", "samplers", "textures")
# Largest depth of nested JSON objects and lists in a top-level member.
_DEEPEST = 100


@dataclass(frozen=True)
class GltfDocument:
    """A parsed document with the content of its external files.

    Attributes
    ----------
    root : JsonObject
    buffers : tuple of bytes
        The bytes of each buffer, truncated to `byteLength`; a buffer in `buffer_faults` may be shorter.
    image_files : dict of int to bytes
        Content of the images that have a URI, by image index.
    buffer_faults, image_faults : dict of int to InputError
        By index, the errors of buffers and image files that cannot be read.
    chunks : tuple of (int, bytes)
        Type and content of GLB chunks other than JSON and BIN.
    folder : SceneFolder
        Folder that relative URIs refer to.
    sha256 : str
        SHA-256 of the scene file, followed by the external buffers (at most `byteLength` bytes of each) and
        the external images.
    data_faults : dict of str to InputError
        The errors of compressed data that cannot be decoded, by the path of the JSON object.
    """

    root: JsonObject
    buffers: tuple[bytes, ...]
    image_files: dict[int, bytes]
    buffer_faults: dict[int, InputError]
    image_faults: dict[int, InputError]
    chunks: tuple[tuple[int, bytes], ...]
    folder: SceneFolder
    sha256: str
    data_faults: dict[str, InputError] = field(default_factory=dict)

    def view(self, index: int) -> tuple[bytes, int, int, int]:
        """Return (buffer, byte offset, byte length, byte stride or 0) of a buffer view.

        Raises
        ------
        InputError
            If the view exceeds its buffer, its data could not be decoded, or the buffer cannot be read.
        """
        view = self.root.children("bufferViews")[index]
        if view.where in self.data_faults:
            raise self.data_faults[view.where]
        number, offset, length = self.span(view)
        return self.buffers[number], offset, length, view.integer("byteStride", 0)

    def span(self, part: JsonObject) -> tuple[int, int, int]:
        """Return (buffer index, byte offset, byte length) of a JSON object with these members.

        Parameters
        ----------
        part : JsonObject
            A buffer view, or the extension of a compressed one.

        Raises
        ------
        InputError
            If the bytes exceed the buffer, or the buffer cannot be read.
        """
        number = part.index("buffer", len(self.buffers), "buffers")
        if number in self.buffer_faults:
            raise self.buffer_faults[number]
        size = len(self.buffers[number])
        offset, length = part.integer("byteOffset", 0), part.integer("byteLength", minimum=1)
        if offset + length > size:
            part.fail(f"bytes {offset} to {offset + length} lie outside its buffer of {size} bytes")
        return number, offset, length


def open_document(path: Path, data: bytes, folder: SceneFolder | None = None) -> GltfDocument:
    """Parse a .glb or .gltf file, and read its external buffers and images.

    Parameters
    ----------
    path : Path
        The file.
    data : bytes
        The file's content.
    folder : SceneFolder, optional
        Folder that relative URIs refer to. By default, it is the folder of `path`, and files outside it are
        refused.

    Returns
    -------
    GltfDocument
        The document; `buffer_faults` and `image_faults` list external files that cannot be read.

    Raises
    ------
    InputError
        For a broken container, malformed JSON, a version other than 2.x, or a file outside of `folder`. Also
        if a top-level member that must be a list is none.
    """
    file, folder = str(path), folder or SceneFolder(path.parent)
    chunks = split_glb(data, file) if data[:4] == MAGIC else Chunks(data, None, ())
    root = JsonObject(_parse_json(chunks.json, file), "", file)
    _check_version(root)
    for key in _LISTS:
        root.children(key)
    digest = hashlib.sha256(data)
    buffers: list[bytes] = []
    buffer_faults: dict[int, InputError] = {}
    for i, buffer in enumerate(root.children("buffers")):
        own = chunks.binary if i == 0 else None
        content, fault = _read_buffer(buffer, own, folder, digest)
        buffers.append(content)
        if fault is not None:
            buffer_faults[i] = fault
    images: dict[int, bytes] = {}
    image_faults: dict[int, InputError] = {}
    for i, image in enumerate(root.children("images")):
        try:
            if "uri" in image:
                images[i] = _read_file(image, folder, digest)
        except OutsideError:
            raise
        except InputError as error:
            image_faults[i] = error
    return GltfDocument(
        root=root,
        buffers=tuple(buffers),
        image_files=images,
        buffer_faults=buffer_faults,
        image_faults=image_faults,
        chunks=chunks.others,
        folder=folder,
        sha256=digest.hexdigest(),
    )


def _parse_json(text: bytes, file: str) -> dict[str, Any]:
    def no_constant(name: str) -> NoReturn:
        raise ValueError(f"{name} is not a JSON number")

    try:
        value = json.loads(text.decode("utf-8-sig"), parse_constant=no_constant)
    except RecursionError:
        raise InputError("the JSON is nested too deeply", file=file) from None
    except ValueError as error:  # JSONDecodeError and UnicodeDecodeError are ValueErrors
        raise InputError(f"the file is not glTF: its JSON is broken ({error})", file=file) from None
    if not isinstance(value, dict):
        raise InputError("the file is not glTF: its JSON is not an object", file=file)
    _check_depth(value, file)
    return value


def _check_depth(root: dict[str, Any], file: str) -> None:
    """Raise `InputError` if a top-level member is nested more deeply than `_DEEPEST` levels."""
    level = {key: value for key, value in root.items() if isinstance(value, dict | list)}
    for key, top in level.items():
        inside: list[Any] = [top]
        for _ in range(_DEEPEST):
            inside = [
                part
                for value in inside
                for part in (value.values() if isinstance(value, dict) else value)
                if isinstance(part, dict | list)
            ]
            if not inside:
                break
        else:
            message = f"the JSON is nested too deeply: more than {_DEEPEST} levels; remove the innermost ones"
            raise InputError(message, file=file, object=key)


def _check_version(root: JsonObject) -> None:
    if "asset" not in root:
        root.fail("the file has no 'asset' member, so it is not glTF 2.0")
    asset = root.child("asset")
    for key in ("version", "minVersion"):
        version = asset.string(key, "2.0") if key == "minVersion" else asset.string(key)
        major, _, minor = version.partition(".")
        if major != "2" or (key == "minVersion" and minor not in ("", "0")):
            how = f"; {CONVERTER}" if major == "1" else ", so export it as glTF 2.0"
            asset.fail(f"this is glTF {version}; only glTF 2.0 is read{how}", key)


def _read_buffer(
    buffer: JsonObject, chunk: bytes | None, folder: SceneFolder, digest: hashlib._Hash
) -> tuple[bytes, InputError | None]:
    """Return the available bytes of a buffer, and the error if the buffer cannot be read completely."""
    data = b""
    try:
        length = buffer.integer("byteLength", minimum=1)
        if "uri" in buffer:
            data = _read_file(buffer, folder, digest, length)
        elif chunk is not None:
            data = chunk
        else:
            buffer.fail("the buffer has neither a uri nor a BIN chunk; export the file again")
        if len(data) < length:
            buffer.fail(f"the buffer is too short: byteLength is {length}, its data has {len(data)} bytes")
    except OutsideError:
        raise
    except InputError as error:
        return data, error
    return (data if len(data) == length else data[:length]), None


def _read_file(
    holder: JsonObject, folder: SceneFolder, digest: hashlib._Hash, first: int | None = None
) -> bytes:
    """Return the bytes that `holder`'s "uri" refers to; if they come from a file, add them to `digest`."""
    uri = holder.string("uri")
    try:
        data = read_uri(uri, folder, first=first)
    except UriError as error:
        holder.fail(str(error), "uri")
    except OutsideName as error:
        raise OutsideError(str(error), file=holder.file, object=holder.path_of("uri")) from None
    if not is_data(uri):
        digest.update(data)
    return data
