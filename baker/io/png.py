"""Encodes and decodes PNG files with Pillow.

No time stamp is written, so that equal pixels give equal bytes.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.io.picture_file import open_picture


def encode_png(pixels: NDArray[np.unsignedinteger[Any]], text: Mapping[str, str] | None = None) -> bytes:
    """Encode an image as PNG.

    Parameters
    ----------
    pixels : (H, W), (H, W, 3) or (H, W, 4) uint8, or (H, W) uint16
        Grey, RGB or RGBA, row 0 at the top.
    text : mapping of str to str, optional
        Text chunks.

    Returns
    -------
    bytes
        The content of the file.
    """
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG", pnginfo=_chunks(text or {}))
    return stream.getvalue()


def decode_png(path: Path) -> tuple[NDArray[np.unsignedinteger[Any]], dict[str, str]]:
    """Return the unconverted pixel values of a PNG without a palette, and its text chunks.

    Parameters
    ----------
    path : Path
        The file.

    Returns
    -------
    pixels : (H, W) or (H, W, C) uint8, or (H, W) uint16
        The stored values, row 0 at the top.
    text : dict of str to str
        Text chunks.

    Raises
    ------
    InputError
        If the file is missing, is no PNG, is too large, or has a palette or another unsupported pixel type.
    """
    from PIL.PngImagePlugin import PngImageFile

    with open_picture(path, PngImageFile, "PNG") as image:
        image.load()
        if image.mode not in ("L", "RGB", "RGBA", "I;16", "I"):
            raise InputError(f"its pixels are of the kind {image.mode}", file=str(path))
        pixels = np.array(image)
        text = {str(key): str(value) for key, value in image.text.items()}
    return (pixels.astype(np.uint16) if pixels.dtype != np.uint8 else pixels), text


def encode_palette_png(
    index: NDArray[np.uint8], colours: Mapping[int, tuple[int, int, int]], text: Mapping[str, str]
) -> bytes:
    """Return the bytes of a PNG with a palette.

    Parameters
    ----------
    index : (H, W) uint8
        Palette index of each pixel, row 0 at the top.
    colours : mapping of palette index to sRGB red, green, blue (0 to 255)
    text : mapping of str to str
        Text chunks.
    """
    from PIL import Image

    # Write all 256 palette entries: otherwise Pillow may store fewer than eight bits for each pixel.
    palette = np.zeros((256, 3), np.uint8)
    for number, colour in colours.items():
        palette[number] = colour
    image = Image.fromarray(index)
    image.putpalette(palette.ravel().tolist())
    stream = io.BytesIO()
    image.save(stream, "PNG", pnginfo=_chunks(text))
    return stream.getvalue()


def grey_levels(value: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Quantise values to eight bits.

    Parameters
    ----------
    value : array of float32, any shape
        Values, clamped to 0 to 1.

    Returns
    -------
    array of uint8, same shape
        `round(255 * value)`.
    """
    rounded: NDArray[np.uint8] = np.rint(np.clip(value, 0.0, 1.0) * 255.0).astype(np.uint8)
    return rounded


def srgb_levels(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Encode linear light as sRGB with eight bits (IEC 61966-2-1).

    Parameters
    ----------
    linear : array of float32, any shape
        Values, clamped to 0 to 1.

    Returns
    -------
    array of uint8, same shape
        sRGB-encoded values, 0 to 255, rounded.
    """
    clipped = np.clip(linear.astype(np.float64), 0.0, 1.0)
    encoded = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255.0).astype(np.uint8)


def decode_palette_png(path: Path, side: int | None = None) -> NDArray[np.uint8]:
    """Return the palette index of each pixel of a PNG with a palette.

    Parameters
    ----------
    path : Path
        The file.
    side : int, optional
        Required width and height, checked before the pixels are decoded.

    Returns
    -------
    (H, W) uint8
        Row 0 at the top.

    Raises
    ------
    InputError
        If the file is missing, is no PNG with a palette, or has another size.
    """
    from PIL.PngImagePlugin import PngImageFile

    with open_picture(path, PngImageFile, "PNG") as image:
        if image.mode != "P" or (side is not None and image.size != (side, side)):
            size = "" if side is None else f" of {side} x {side} texels"
            raise InputError(f"the picture has no palette numbers{size}", file=str(path))
        return np.array(image, np.uint8)


def png_size(path: Path) -> tuple[int, int]:
    """Return width and height of a PNG from its header.

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
        If the file is missing, is no PNG, or is larger than 16384 x 16384 pixels.
    """
    from PIL.PngImagePlugin import PngImageFile

    with open_picture(path, PngImageFile, "PNG") as image:
        return image.size


def _chunks(text: Mapping[str, str]) -> Any:
    from PIL import PngImagePlugin

    info = PngImagePlugin.PngInfo()
    for key, value in sorted(text.items()):
        info.add_text(key, value)
    return info
