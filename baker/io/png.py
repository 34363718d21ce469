"""Makes PNG files in memory; the only file that knows Pillow's writer.

No time is stored, so the same pixels give the same bytes.
"""

from __future__ import annotations

import io
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray


def encode_png(pixels: NDArray[np.uint8]) -> bytes:
    """Return a PNG of (H, W) grey, (H, W, 3) RGB or (H, W, 4) RGBA uint8 pixels, row 0 on top."""
    from PIL import Image

    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, "PNG")
    return stream.getvalue()


def encode_palette_png(
    index: NDArray[np.uint8], colours: Mapping[int, tuple[int, int, int]], text: Mapping[str, str]
) -> bytes:
    """Return a PNG whose pixels are palette numbers.

    Parameters
    ----------
    index : (H, W) uint8
        Row 0 on top.
    colours : mapping of palette number to sRGB red, green, blue (0 to 255)
    text : mapping of str to str
        Text chunks.
    """
    from PIL import Image, PngImagePlugin

    # All 256 places, so that a texel takes eight bits and a reader of raw bytes finds the number itself.
    palette = np.zeros((256, 3), np.uint8)
    for number, colour in colours.items():
        palette[number] = colour
    image = Image.fromarray(index)
    image.putpalette(palette.ravel().tolist())
    info = PngImagePlugin.PngInfo()
    for key, value in text.items():
        info.add_text(key, value)
    stream = io.BytesIO()
    image.save(stream, "PNG", pnginfo=info)
    return stream.getvalue()


def grey_levels(value: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return numbers from 0 to 1 as 0 to 255, rounded; what is outside is clamped."""
    rounded: NDArray[np.uint8] = np.rint(np.clip(value, 0.0, 1.0) * 255.0).astype(np.uint8)
    return rounded


def srgb_levels(linear: NDArray[np.float32]) -> NDArray[np.uint8]:
    """Return linear light from 0 to 1 as sRGB-encoded 0 to 255 (IEC 61966-2-1)."""
    clipped = np.clip(linear.astype(np.float64), 0.0, 1.0)
    encoded = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)
    return np.rint(encoded * 255.0).astype(np.uint8)


def decode_palette_png(data: bytes) -> NDArray[np.uint8]:
    """Return (H, W) uint8: the palette numbers of a PNG with a palette, row 0 on top.

    Raises
    ------
    ValueError
        If the data is no such picture.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(data)) as image:
            if image.mode != "P":
                raise ValueError("the picture has no palette")
            return np.array(image, np.uint8)
    except (UnidentifiedImageError, OSError, SyntaxError) as error:
        raise ValueError(str(error)) from None
