"""Decodes image files (PNG, JPEG, WebP and others) to RGBA with Pillow."""

from __future__ import annotations

import io
import warnings

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError

_FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF")
# Largest width and height of an image that is read, texels.
_LARGEST = 16384


def decode_image(data: bytes, *, file: str, object: str) -> NDArray[np.uint8]:
    """Return an image's pixels as they are stored: sRGB-encoded colour, linear alpha, row 0 at the top.

    Parameters
    ----------
    data : bytes
        The content of an image file.
    file, object : str
        The file and the image, for messages.

    Returns
    -------
    (H, W, 4) uint8
        RGBA, 0 to 255; 16-bit images are rounded to 8 bits.

    Raises
    ------
    InputError
        If the data is not an image that can be decoded, or if its width or height exceeds 16384 texels.
    """
    from PIL import Image

    try:
        with warnings.catch_warnings():
            # Suppress Pillow's warning about large images; the size is checked below.
            warnings.simplefilter("ignore")
            with Image.open(io.BytesIO(data), formats=_FORMATS) as image:
                width, height = image.size
                if max(width, height) > _LARGEST:
                    message = f"the image has {width} x {height} texels; at most {_LARGEST} a side are read"
                    raise InputError(message, file=file, object=object)
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


def _to_rgba(image: object) -> NDArray[np.uint8]:
    from PIL import Image

    assert isinstance(image, Image.Image)
    if image.mode.startswith("I;16") or image.mode == "I":
        # Scale 16-bit grey to 8 bits: (v + 128) // 257 rounds 65535 to 255. Pillow would clip it at 255.
        level = np.clip((np.asarray(image).astype(np.int64) + 128) // 257, 0, 255).astype(np.uint8)
        return np.stack([level, level, level, np.full_like(level, 255)], axis=-1)
    return np.array(image.convert("RGBA"), np.uint8)
