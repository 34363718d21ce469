"""Splits a binary glTF file into its chunks.

Based on: Khronos Group, glTF 2.0 Specification, section 4 (GLB).
"""

from __future__ import annotations

import struct
from typing import NamedTuple, NoReturn

from baker.core.errors import InputError

MAGIC = b"glTF"
CONVERTER = "convert the file with `npx gltf-pipeline -i OLD -o NEW.glb`"
CHUNK_JSON, CHUNK_BIN = 0x4E4F534A, 0x004E4942


class Chunks(NamedTuple):
    """The chunks of a GLB file.

    Attributes
    ----------
    json : bytes
    binary : bytes or None
        The first BIN chunk; None if there is none.
    others : tuple of (int, bytes)
        Type and content of the chunks that glTF 2.0 does not define.
    """

    json: bytes
    binary: bytes | None
    others: tuple[tuple[int, bytes], ...]


def split_glb(data: bytes, file: str) -> Chunks:
    """Split a GLB file; bytes after the length in its header are ignored.

    Parameters
    ----------
    data : bytes
        Content of the file.
    file : str
        Name of the file, for messages.

    Returns
    -------
    Chunks
        The JSON chunk, the first BIN chunk, and the chunks of other types.

    Raises
    ------
    InputError
        If the header or a chunk is truncated, the version is not 2, or the first chunk is not JSON.
    """

    def fail(message: str) -> NoReturn:
        raise InputError(message, file=file)

    if len(data) < 20:
        fail(f"the GLB is cut off after {len(data)} bytes, inside its header; export it again")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        how = f"; {CONVERTER}" if version == 1 else ", so export it as glTF 2.0"
        fail(f"this is binary glTF version {version}; only glTF 2.0 is read{how}")
    if length > len(data):
        fail(f"the GLB is cut off: its header says {length} bytes, the file has {len(data)}")
    text: bytes | None = None
    binary: bytes | None = None
    others: list[tuple[int, bytes]] = []
    offset = 12
    while offset + 8 <= length:
        size, kind = struct.unpack_from("<II", data, offset)
        offset += 8
        if offset + size > length:
            fail(
                f"a GLB chunk of {size} bytes at byte {offset} runs past the end of the file; export it again"
            )
        chunk = data[offset : offset + size]
        if text is None:
            if kind != CHUNK_JSON:
                fail("the first chunk of the GLB is not JSON; export it again")
            text = chunk
        elif kind == CHUNK_BIN and binary is None:
            binary = chunk
        elif kind not in (CHUNK_JSON, CHUNK_BIN):
            others.append((kind, chunk))
        offset += size
    if text is None:
        fail("the GLB has no JSON chunk; export it again")
    return Chunks(text, binary, tuple(others))
