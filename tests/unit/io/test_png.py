"""PNG files are decoded by Pillow and compared with the encoded pixels."""

from __future__ import annotations

import io
import struct
import zlib

import numpy as np
from PIL import Image

from baker.io.png import encode_palette_png, encode_png, grey_levels, srgb_levels


def chunks(data: bytes) -> dict[bytes, bytes]:
    """Return {type: data} of the chunks of a PNG. Asserts that their checksums are correct."""
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    found, at = {}, 8
    while at < len(data):
        size, kind = struct.unpack_from(">I4s", data, at)
        body = data[at + 8 : at + 8 + size]
        assert zlib.crc32(kind + body) == struct.unpack_from(">I", data, at + 8 + size)[0]
        found[kind] = found.get(kind, b"") + body
        at += 12 + size
    return found


def test_pixels_read_back() -> None:
    rng = np.random.default_rng(3)
    for shape in ((5, 7), (5, 7, 3), (5, 7, 4)):
        pixels = rng.integers(0, 256, shape).astype(np.uint8)
        assert np.array_equal(np.asarray(Image.open(io.BytesIO(encode_png(pixels)))), pixels)


def test_palette_numbers_are_the_stored_bytes() -> None:
    index = np.array([[0, 1, 4], [3, 2, 0]], np.uint8)
    colours = {0: (1, 2, 3), 1: (4, 5, 6), 2: (7, 8, 9), 3: (10, 11, 12), 4: (13, 14, 15)}
    found = chunks(encode_palette_png(index, colours, {"Legend": "0 nothing"}))
    width, height, depth, colour = struct.unpack_from(">IIBB", found[b"IHDR"])
    assert (width, height, depth, colour) == (3, 2, 8, 3)
    lines = np.frombuffer(zlib.decompress(found[b"IDAT"]), np.uint8).reshape(2, 4)
    assert (lines[:, 0] == 0).all(), "no filter, so that the bytes are the numbers"
    assert np.array_equal(lines[:, 1:], index)
    assert found[b"PLTE"][:15] == bytes(range(1, 16))
    assert found[b"tEXt"] == b"Legend\x000 nothing"


def test_levels_round_and_clamp() -> None:
    assert grey_levels(np.float32([-1, 0, 0.5 / 255 - 1e-5, 0.5 / 255 + 1e-5, 1, 7])).tolist() == [
        0,
        0,
        0,
        1,
        255,
        255,
    ]
    # `linear` has the linear values of these sRGB codes. The linear segment of sRGB ends between 10 and 11.
    code = np.array([0, 10, 11, 128, 255]) / 255
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    assert srgb_levels(linear.astype(np.float32)).tolist() == [0, 10, 11, 128, 255]
