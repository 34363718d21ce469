"""Encodes and decodes lossless WebP pictures with Pillow.

WebP has no text chunks, so texts are stored as JSON in the Exif tag ImageDescription.
"""

from __future__ import annotations

import io
import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.io.picture_file import open_picture

# Largest width and height of a WebP picture, pixels.
WEBP_LARGEST = 16383
_DESCRIPTION = 0x010E
# `exact` keeps the colours of transparent pixels. In lossless files, `quality` is the effort.
_LOSSLESS: dict[str, Any] = {"lossless": True, "exact": True, "quality": 50, "method": 4}


def encode_webp(pixels: NDArray[np.uint8], text: Mapping[str, str]) -> bytes:
    """Encode an image as lossless WebP.

    Parameters
    ----------
    pixels : (H, W, 4) uint8
        RGBA, row 0 at the top; at most `WEBP_LARGEST` pixels a side.
    text : mapping of str to str
        Texts for `decode_webp`.

    Returns
    -------
    bytes
        The content of the file.
    """
    from PIL import Image

    exif = Image.Exif()
    exif[_DESCRIPTION] = json.dumps(dict(text), sort_keys=True)
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "WEBP", exif=exif.tobytes(), **_LOSSLESS)
    return stream.getvalue()


def decode_webp(path: Path) -> tuple[NDArray[np.unsignedinteger[Any]], dict[str, str]]:
    """Return the pixels of a WebP picture, and the texts that `encode_webp` stored.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    pixels : (H, W, 3) or (H, W, 4) uint8
        The stored values, row 0 at the top.
    text : dict of str to str
        Texts; empty if the file has none.

    Raises
    ------
    InputError
        If the file is missing or no WebP picture.
    """
    from PIL.WebPImagePlugin import WebPImageFile

    with open_picture(path, WebPImageFile, "WebP") as image, warnings.catch_warnings():
        # Pillow warns of damaged Exif data, and returns what it can read.
        warnings.simplefilter("ignore")
        pixels = np.array(image)
        described = image.getexif().get(_DESCRIPTION, "{}")
    try:
        found = json.loads(described)
        text = {str(key): str(value) for key, value in found.items()}
    except (TypeError, ValueError, AttributeError):
        text = {}
    return pixels, text


def webp_size(path: Path) -> tuple[int, int]:
    """Return width and height of a WebP picture from its header.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    (int, int)
        Pixels.

    Raises
    ------
    InputError
        If the file is missing or no WebP picture.
    """
    from PIL.WebPImagePlugin import WebPImageFile

    with open_picture(path, WebPImageFile, "WebP") as image:
        return image.size
