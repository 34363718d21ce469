"""Encodes and decodes KTX 2.0 files with one image of shared-exponent pixels, compressed with Zstandard.

Vulkan calls the pixel format VK_FORMAT_E5B9G9R9_UFLOAT_PACK32: in each 32-bit word, red is in the lowest
nine bits, followed by green, blue and the exponent. The file has one mip level, because smaller levels mix
the light of neighbouring charts.

Based on: Khronos, KTX file format specification 2.0.4; Khronos data format specification 1.3.
"""

from __future__ import annotations

import struct
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.encoding import LARGEST_SIDE
from baker.core.errors import InputError
from baker.io.regular_file import read_regular

# VK_FORMAT_E5B9G9R9_UFLOAT_PACK32.
_FORMAT = 123
# First bytes of a file.
KTX2_IDENTIFIER = b"\xabKTX 20\xbb\r\n\x1a\n"
# Identifier; format, bytes of a word, width, height, depth, layers, faces, mip levels, compression; offset
# and size of the data format descriptor, of the texts and of global data of the compression.
_HEAD = struct.Struct("<12s9I4I2Q")
# Offset, size in the file and size after decompression of a mip level.
_LEVEL = struct.Struct("<3Q")
_UNCOMPRESSED, _ZSTANDARD = 0, 2
# Compression level of Zstandard. Level 19 makes the file of a furnished room 7 % smaller, and takes ten times
# as long.
_EFFORT = 9


def encode_ktx2(code: NDArray[np.uint32], text: Mapping[str, str], writer: str) -> bytes:
    """Encode shared-exponent pixels as KTX2.

    Parameters
    ----------
    code : (H, W) uint32
        Pixels, row 0 at the top.
    text : mapping of str to str
        Key and value pairs to store.
    writer : str
        Name and version of this program.

    Returns
    -------
    bytes
        The content of the file.
    """
    height, width = code.shape
    raw = np.ascontiguousarray(code, "<u4").tobytes()
    packed = _compress(raw)
    format_at = _HEAD.size + _LEVEL.size
    described = _description()
    text_at = format_at + len(described)
    # Orientation "rd": columns go to the right, rows go down.
    texts = _key_values({**text, "KTXorientation": "rd", "KTXwriter": writer})
    counts = (_FORMAT, 4, width, height, 0, 0, 1, 1, _ZSTANDARD)
    head = _HEAD.pack(KTX2_IDENTIFIER, *counts, format_at, len(described), text_at, len(texts), 0, 0)
    level = _LEVEL.pack(text_at + len(texts), len(packed), len(raw))
    return b"".join((head, level, described, texts, packed))


def decode_ktx2(path: Path) -> tuple[NDArray[np.uint32], dict[str, str]]:
    """Read the largest mip level of a KTX2 file with shared-exponent pixels.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    code : (H, W) uint32
        Pixels, row 0 at the top.
    text : dict of str to str
        Key and value pairs.

    Raises
    ------
    InputError
        If the file is missing, damaged or not KTX2, or if it is not a two-dimensional image with shared
        exponents.
    """
    with _readable(path):
        return _decoded(read_regular(path))


def ktx2_size(path: Path) -> tuple[int, int]:
    """Return width and height of a KTX2 file from its header.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    (int, int)
        Texels.

    Raises
    ------
    InputError
        If the file is missing or not KTX2.
    """
    with _readable(path):
        width, height = _head(read_regular(path, first=_HEAD.size))[3:5]
    return width, height


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Convert errors about a damaged or missing file to `InputError`."""
    try:
        yield
    except OSError as error:
        raise InputError(f"the image cannot be read ({error.strerror})", file=str(path)) from None
    except (ValueError, struct.error) as error:
        raise InputError(f"this is not a readable KTX2 image ({error})", file=str(path)) from None


def _head(data: bytes) -> tuple[Any, ...]:
    if not data.startswith(KTX2_IDENTIFIER):
        raise ValueError("no KTX2 identifier")
    return _HEAD.unpack_from(data)


def _decoded(data: bytes) -> tuple[NDArray[np.uint32], dict[str, str]]:
    _, kind, _, width, height, depth, layers, faces, _, scheme, *parts = _head(data)
    if kind != _FORMAT or depth or layers > 1 or faces != 1:
        raise ValueError(f"only flat images of format {_FORMAT} are read; its format is {kind}")
    if scheme not in (_UNCOMPRESSED, _ZSTANDARD):
        raise ValueError(f"its compression {scheme} is neither absent nor Zstandard")
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        raise ValueError(f"its size is {width} x {height} texels; at most {LARGEST_SIDE} a side are read")
    text = _texts(_part(data, parts[2], parts[3]))
    if text.get("KTXorientation", "rd") != "rd":
        raise ValueError("its rows do not run from top to bottom")
    at, size, _ = _LEVEL.unpack_from(data, _HEAD.size)
    raw = _part(data, at, size)
    expected = width * height * 4
    raw = _decompress(raw, expected) if scheme == _ZSTANDARD else raw
    if len(raw) != expected:
        raise ValueError(f"it has {len(raw)} bytes of pixels instead of {expected}")
    return np.frombuffer(raw, "<u4").astype(np.uint32).reshape(height, width), text


def _part(data: bytes, at: int, size: int) -> bytes:
    if at + size > len(data):
        raise ValueError("it is truncated")
    return data[at : at + size]


def _description() -> bytes:
    """Return the data format descriptor of the pixel format, as the data format specification lists it.

    The colour model is RGB with linear values and the Rec.709 primaries. Each channel has two samples: its
    nine bits of mantissa and the shared five bits of the exponent, with the exponent's bias as lower limit.
    """
    samples = b""
    for channel in range(3):
        samples += struct.pack("<HBB4B2I", 9 * channel, 9 - 1, channel, 0, 0, 0, 0, 0, 8448)
        samples += struct.pack("<HBB4B2I", 27, 5 - 1, channel | 0x20, 0, 0, 0, 0, 15, 31)
    # Vendor and type 0 (Khronos, basic); 2 for version 1.3; RGBSDA, BT709, linear, straight alpha; texel
    # blocks of 1 x 1 x 1 x 1 (stored minus 1); 4 bytes in plane 0.
    size = 24 + len(samples)
    block = struct.pack("<IHH4B4B8B", 0, 2, size, 1, 1, 1, 0, *(0,) * 4, 4, *(0,) * 7)
    return struct.pack("<I", 4 + size) + block + samples


def _key_values(text: Mapping[str, str]) -> bytes:
    """Return texts sorted by key, each padded to a multiple of four bytes."""
    parts = []
    for key in sorted(text):
        pair = f"{key}\0{text[key]}\0".encode()
        parts.append(struct.pack("<I", len(pair)) + pair + bytes(-len(pair) % 4))
    return b"".join(parts)


def _texts(data: bytes) -> dict[str, str]:
    text = {}
    at = 0
    while at < len(data):
        (size,) = struct.unpack_from("<I", data, at)
        key, zero, value = _part(data, at + 4, size).partition(b"\0")
        if not zero:
            raise ValueError("a key of its texts has no end")
        text[key.decode("utf-8", "replace")] = value.removesuffix(b"\0").decode("utf-8", "replace")
        at += 4 + size + -size % 4
    return text


def _compress(data: bytes) -> bytes:
    packed: bytes = _zstandard().compress(data, level=_EFFORT)
    return packed


def _decompress(data: bytes, size: int) -> bytes:
    """Return decompressed data; raise an error as soon as it has more than `size` bytes."""
    library = _zstandard()
    decompressor = library.ZstdDecompressor()
    try:
        raw: bytes = decompressor.decompress(data, max_length=size + 1)
    except library.ZstdError as error:
        raise ValueError(str(error)) from None
    if not decompressor.eof:
        raise ValueError(f"its pixels are truncated or have more than {size} bytes")
    return raw


def _zstandard() -> ModuleType:
    """Return Python's module for Zstandard, or its backport for Python before 3.14."""
    return import_module("compression.zstd" if sys.version_info >= (3, 14) else "backports.zstd")
