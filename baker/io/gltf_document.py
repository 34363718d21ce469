"""Opens glTF 2.0 containers: GLB chunks, JSON, buffers, and the bytes of images.

Based on: Khronos Group, glTF 2.0 Specification, sections 3.2 (asset), 3.6 (buffers), 4 (GLB).
"""

from __future__ import annotations

import base64
import binascii
import hashlib
import json
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn
from urllib.parse import unquote, unquote_to_bytes

from baker.core.errors import InputError
from baker.core.scene import SceneWarning
from baker.io.gltf_json import JsonObject

_MAGIC = b"glTF"
_CHUNK_JSON = 0x4E4F534A
_CHUNK_BIN = 0x004E4942

UNDERSTOOD = frozenset(
    {
        "KHR_lights_punctual",
        "KHR_materials_emissive_strength",
        "KHR_materials_unlit",
        "KHR_mesh_quantization",
        "KHR_texture_transform",
        "EXT_texture_webp",
    }
)
# Change neither geometry nor base colour nor emission, which is all that a bake reads: safe to pass by.
IRRELEVANT = frozenset(
    {
        "KHR_animation_pointer",
        "KHR_materials_anisotropy",
        "KHR_materials_clearcoat",
        "KHR_materials_dispersion",
        "KHR_materials_ior",
        "KHR_materials_iridescence",
        "KHR_materials_sheen",
        "KHR_materials_specular",
        "KHR_materials_variants",
        "KHR_xmp_json_ld",
    }
)
_COMPRESSED_VIEW = ("EXT_meshopt_compression", "KHR_meshopt_compression")


@dataclass(frozen=True)
class GltfDocument:
    """A parsed document with its outside files read.

    Attributes
    ----------
    root : JsonObject
    buffers : tuple of bytes
        Each cut to its `byteLength`.
    image_files : dict of int to bytes
        Content of the images that have a URI, by image index.
    sha256 : str
        Over the scene file, then its outside buffers, then its outside images.
    warnings : tuple of SceneWarning
    """

    root: JsonObject
    buffers: tuple[bytes, ...]
    image_files: dict[int, bytes]
    folder: Path
    sha256: str
    warnings: tuple[SceneWarning, ...]

    def view(self, index: int) -> tuple[bytes, int, int, int]:
        """Return (buffer, byte offset, byte length, byte stride or 0) of a buffer view.

        Raises
        ------
        InputError
            If the view leaves its buffer or is compressed by an extension.
        """
        view = self.root.children("bufferViews")[index]
        for name in _COMPRESSED_VIEW:
            if view.extension(name) is not None:
                buffer = self.root.children("buffers")[view.index("buffer", len(self.buffers), "buffers")]
                fallback = buffer.extension(name)
                if fallback is not None and fallback.boolean("fallback", False):
                    view.fail(
                        f"the data is compressed with {name}, which is not understood; export without it"
                    )
        data = self.buffers[view.index("buffer", len(self.buffers), "buffers")]
        offset, length = view.integer("byteOffset", 0), view.integer("byteLength", minimum=1)
        if offset + length > len(data):
            view.fail(f"bytes {offset} to {offset + length} lie outside its buffer of {len(data)} bytes")
        return data, offset, length, view.integer("byteStride", 0)


def open_document(path: Path, data: bytes) -> GltfDocument:
    """Parse a .glb or .gltf file and read every file that it names.

    Parameters
    ----------
    path : Path
        For messages, and as the folder where relative URIs begin.
    data : bytes
        The file's content.

    Raises
    ------
    InputError
        For a broken container, JSON that is none, another version than 2.x, a required extension that is
        not understood, and a missing or short buffer or image file.
    """
    file = str(path)
    text, chunk = _split_glb(data, file) if data[:4] == _MAGIC else (data, None)
    root = JsonObject(_parse_json(text, file), "", file)
    _check_version(root)
    warnings = _check_extensions(root)
    digest = hashlib.sha256(data)
    buffers = tuple(_read_buffers(root, chunk, path.parent, digest))
    images = _read_image_files(root, path.parent, digest)
    return GltfDocument(root, buffers, images, path.parent, digest.hexdigest(), tuple(warnings))


def _split_glb(data: bytes, file: str) -> tuple[bytes, bytes | None]:
    def fail(message: str) -> NoReturn:
        raise InputError(message, file=file)

    if len(data) < 20:
        fail(f"the GLB is cut off after {len(data)} bytes, inside its header; export it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        fail(f"this is binary glTF version {version}; only glTF 2.0 is read, so convert it first")
    if length > len(data):
        fail(f"the GLB is cut off: its header says {length} bytes, the file has {len(data)}")
    text: bytes | None = None
    chunk: bytes | None = None
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        offset += 8
        if offset + size > length:
            fail(f"a GLB chunk of {size} bytes at byte {offset} runs past the end of the file")
        if text is None:
            if kind != _CHUNK_JSON:
                fail("the first chunk of the GLB is not JSON")
            text = data[offset : offset + size]
        elif kind == _CHUNK_BIN and chunk is None:
            chunk = data[offset : offset + size]
        offset += size
    if text is None:
        fail("the GLB has no JSON chunk")
    return text, chunk


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
    return value


def _check_version(root: JsonObject) -> None:
    if "asset" not in root:
        root.fail("the file has no 'asset' member, so it is not glTF 2.0")
    asset = root.child("asset")
    for key in ("version", "minVersion"):
        version = asset.string(key, "2.0") if key == "minVersion" else asset.string(key)
        major, _, minor = version.partition(".")
        if major != "2" or (key == "minVersion" and minor not in ("", "0")):
            asset.fail(f"this is glTF {version}; only glTF 2.0 is read, so convert it first", key)


def _check_extensions(root: JsonObject) -> list[SceneWarning]:
    known = UNDERSTOOD | IRRELEVANT
    for name in root.strings("extensionsRequired"):
        if name not in known:
            raise InputError(
                f"the file requires the extension {name}, which is not understood; export without it",
                file=root.file,
                object=name,
            )
    return [
        SceneWarning("extension-ignored", f"the extension {name} is not understood and was ignored", name)
        for name in root.strings("extensionsUsed")
        if name not in known
    ]


def _read_buffers(root: JsonObject, chunk: bytes | None, folder: Path, digest: hashlib._Hash) -> list[bytes]:
    buffers = []
    for i, buffer in enumerate(root.children("buffers")):
        length = buffer.integer("byteLength", minimum=1)
        if "uri" in buffer:
            data = read_uri(buffer, folder, digest)
        elif i == 0 and chunk is not None:
            data = chunk
        else:
            for name in _COMPRESSED_VIEW:
                if buffer.extension(name) is not None:
                    buffer.fail(
                        f"the data is compressed with {name}, which is not understood; export without it"
                    )
            buffer.fail("the buffer has neither a uri nor a BIN chunk")
        if len(data) < length:
            buffer.fail(f"the buffer is too short: byteLength is {length}, its data has {len(data)} bytes")
        buffers.append(data if len(data) == length else data[:length])
    return buffers


def _read_image_files(root: JsonObject, folder: Path, digest: hashlib._Hash) -> dict[int, bytes]:
    images = root.children("images")
    return {i: read_uri(image, folder, digest) for i, image in enumerate(images) if "uri" in image}


def read_uri(holder: JsonObject, folder: Path, digest: hashlib._Hash) -> bytes:
    """Return the bytes behind `holder`'s "uri": a data URI, or a file that is also added to `digest`."""
    uri = holder.string("uri")
    if uri[:5].lower() == "data:":
        return _decode_data_uri(holder, uri)
    scheme, colon, _ = uri.partition("://")
    if colon and scheme.isalnum():
        holder.fail(f"'{uri[:80]}' is not a file beside the scene; store it there", "uri")
    # A name may hold a bare % sign, against the rules: the literal name counts if such a file exists.
    names = dict.fromkeys((unquote(uri), uri))
    for name in names:
        try:
            data = (folder / name).read_bytes()
        except FileNotFoundError:
            continue
        except (OSError, ValueError) as error:
            why = getattr(error, "strerror", None) or error
            holder.fail(f"the file '{uri[:80]}' cannot be read: {why}", "uri")
        digest.update(data)
        return data
    holder.fail(f"the file '{uri[:80]}' is missing; put it beside the scene", "uri")


def _decode_data_uri(holder: JsonObject, uri: str) -> bytes:
    head, comma, body = uri.partition(",")
    if not comma:
        holder.fail("the data URI has no comma before its data", "uri")
    if not head.lower().endswith(";base64"):
        return unquote_to_bytes(body)
    try:
        return base64.b64decode(unquote(body) if "%" in body else body, validate=True)
    except (binascii.Error, ValueError) as error:
        holder.fail(f"the data URI is not valid base64 ({error})", "uri")
