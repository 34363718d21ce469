"""Decodes image files (PNG, JPEG, WebP, AVIF, KTX2 and others) to RGBA, most of them with Pillow.

A rotation in EXIF data is ignored, as glTF demands.
"""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from baker.core.budget import LARGEST_IMAGE_SIDE
from baker.core.colour import linear_from_srgb
from baker.core.errors import InputError
from baker.io.basis import BasisError, basis_size, decode_basis
from baker.io.ktx2 import KTX2_IDENTIFIER
from baker.io.png import srgb_levels

if TYPE_CHECKING:
    from PIL.Image import Image

_FORMATS = ("PNG", "JPEG", "WEBP", "AVIF", "BMP", "TGA", "TIFF", "GIF")
# Largest width and height of an image that is read, texels.
_LARGEST = 16384
# Linear RGB of the colours that can replace an image that cannot be read.
STAND_INS = {"white": (1.0, 1.0, 1.0), "grey": (0.5, 0.5, 0.5), "magenta": (1.0, 0.0, 1.0)}
# Number of image rows that are converted at a time. It is even, so that each block of 2 x 2 texels lies in
# one strip.
_STRIP = 32


def decode_image(data: bytes, *, file: str, object: str) -> NDArray[np.uint8]:
    """Return an image's pixels as they are stored: sRGB-encoded colour, linear alpha, row 0 at the top.

    If the width or height exceeds 8192 texels and the other is above 1, the image is halved: each block of
    2 x 2 texels is averaged in linear light. An odd last row or column is dropped.

    Parameters
    ----------
    data : bytes
        The content of an image file.
    file, object : str
        Names of the file and of the image in it, for messages.

    Returns
    -------
    (H, W, 4) uint8
        RGBA, 0 to 255; 16-bit grey is rounded to 8 bits.

    Raises
    ------
    InputError
        If the data is not an image that can be decoded, or if its width or height exceeds 16384 texels.
    """
    if data.startswith(KTX2_IDENTIFIER):
        return _decode_ktx2(data, file, object)
    import PIL.Image

    # A Pillow that was built without AVIF may not know its name.
    PIL.Image.init()
    formats = [name for name in _FORMATS if name in PIL.Image.OPEN]
    try:
        with warnings.catch_warnings():
            # Suppress Pillow's warning about large images; the size is checked below.
            warnings.simplefilter("ignore")
            with PIL.Image.open(io.BytesIO(data), formats=formats) as image:
                _check_size(*image.size, file, object)
                return _to_rgba(image)
    except InputError:
        raise
    except MemoryError:
        raise
    except Exception as error:  # Pillow's decoders raise many kinds of exceptions on broken data
        name = type(error).__name__
        raise InputError(
            f"the image cannot be decoded ({name}); save it again as PNG or JPEG", file=file, object=object
        ) from None


def stand_in(colour: str) -> NDArray[np.float32]:
    """Return an image of one texel that replaces an image that cannot be read.

    Parameters
    ----------
    colour : str
        A key of `STAND_INS`.

    Returns
    -------
    (1, 1, 4) float32
        Linear RGB, and alpha 1.
    """
    return np.array([[[*STAND_INS[colour], 1.0]]], np.float32)


def resized(image: NDArray[Any], width: int, height: int) -> NDArray[Any]:
    """Return an image with more texels, each of which has the value of the nearest texel of the image.

    Parameters
    ----------
    image : (H, W, C)
        Pixels.
    width, height : int
        The new size, texels.

    Returns
    -------
    (height, width, C)
        Pixels of the same type.
    """
    if image.shape[:2] == (height, width):
        return image
    row = (np.arange(height) * image.shape[0]) // height
    column = (np.arange(width) * image.shape[1]) // width
    return np.asarray(image[row[:, None], column])


def _check_size(width: int, height: int, file: str, object: str) -> None:
    if max(width, height) > _LARGEST:
        message = f"the image has {width} x {height} texels; at most {_LARGEST} a side are read"
        raise InputError(message, file=file, object=object)


def _decode_ktx2(data: bytes, file: str, object: str) -> NDArray[np.uint8]:
    """Return the pixels of a KTX2 file; if it has more than 8192 texels a side, halve it."""
    import PIL.Image

    try:
        _check_size(*basis_size(data), file, object)
        pixels = decode_basis(data)
    except BasisError as error:
        raise InputError(str(error), file=file, object=object) from None
    return _to_rgba(PIL.Image.fromarray(pixels))


def _to_rgba(image: Image) -> NDArray[np.uint8]:
    """Convert an image to RGBA in strips of rows, so that no further copy of the whole image is needed."""
    width, height = image.size
    step = 2 if max(width, height) > LARGEST_IMAGE_SIDE and min(width, height) > 1 else 1
    pixels = np.zeros((height // step, width // step, 4), np.uint8)
    for top in range(0, height // step * step, _STRIP):
        rows = _rows(image, top, min(top + _STRIP, height // step * step))
        pixels[top // step : (top + len(rows)) // step] = rows if step == 1 else _halved(rows)
    return pixels


def _rows(image: Image, top: int, end: int) -> NDArray[np.uint8]:
    """Return the rows from `top` to `end` of an image as RGBA."""
    strip = image.crop((0, top, image.width, end))
    if image.mode.startswith("I;16") or image.mode == "I":
        # Scale 16-bit grey to 8 bits: (v + 128) // 257 is v / 257, rounded. Pillow would clip at 255 instead.
        level = np.clip((np.asarray(strip).astype(np.int64) + 128) // 257, 0, 255).astype(np.uint8)
        return np.stack([level, level, level, np.full_like(level, 255)], axis=-1)
    return np.array(strip.convert("RGBA"), np.uint8)


def _halved(rows: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Average blocks of 2 x 2 texels: RGB in linear light, alpha without conversion."""
    linear = np.concatenate([linear_from_srgb(np.arange(256) / 255.0)[rows[..., :3]], rows[..., 3:]], axis=-1)
    wide = linear[:, : linear.shape[1] // 2 * 2]
    mean = (wide[::2, ::2] + wide[1::2, ::2] + wide[::2, 1::2] + wide[1::2, 1::2]) * np.float32(0.25)
    return np.concatenate([srgb_levels(mean[..., :3]), np.rint(mean[..., 3:]).astype(np.uint8)], axis=-1)
