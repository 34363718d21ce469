"""Encodes maps as KTX2 textures with shared exponents (RGB9E5), which GPUs read without conversion.

`value = mantissa * 2^(exponent - 24)` with three mantissas of 9 bits and a shared exponent of 5 bits. A texel
takes 4 bytes in the memory of a GPU, half as much as half floats with four channels.

Based on: Khronos, OpenGL extension EXT_texture_shared_exponent, which defines the conversion.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baker.core.encoding import ENCODINGS, DecodedImage, Encoding, EncodingOptions, check_pixels, write_image
from baker.core.version import VERSION
from baker.io.ktx2 import decode_ktx2, encode_ktx2, ktx2_size

_MANTISSA_BITS, _BIAS = 9, 15
# Largest value: mantissa 511 with exponent 31.
RGB9E5_MAX = 65408.0


class Ktx2Encoding(Encoding[EncodingOptions]):
    """KTX2 files with RGB9E5 pixels; registered as `ktx2`."""

    suffix = ".ktx2"
    components: tuple[int, ...] = (3,)
    options_type = EncodingOptions
    when_clipped = "use `dtype='float'` and the EXR"

    def limits(self, options: EncodingOptions) -> tuple[float, float]:
        """Return 0 and 65408."""
        return 0.0, RGB9E5_MAX

    def stored(self, pixels: NDArray[np.float32], options: EncodingOptions) -> NDArray[np.float32]:
        """Return pixels after encoding and decoding."""
        return _from_rgb9e5(_to_rgb9e5(pixels))

    def tolerance(self, pixels: NDArray[np.float32], options: EncodingOptions) -> NDArray[np.float64]:
        """Return the largest rounding error: 1/511.5 of the texel's brightest channel, at least 2^-25.

        The error is half a step of the mantissas. The brightest mantissa is at least 256, or 255.75 before it
        was rounded with the next larger exponent.
        """
        brightest = pixels.max(axis=-1, keepdims=True).astype(np.float64)
        return np.broadcast_to(np.maximum(brightest / 511.5, 2.0**-25), pixels.shape)

    def encode(
        self,
        path: Path,
        pixels: NDArray[np.float32],
        *,
        options: EncodingOptions,
        header: Mapping[str, str],
        names: tuple[str, ...] | None = None,
    ) -> None:
        """Write pixels (H, W, 3).

        Raises
        ------
        ValueError
            If a pixel is not a number, or the shape is not (H, W, 3).
        ResourceError
            If the file cannot be written.
        """
        check_pixels(pixels, self.components, path.name)
        write_image(path, encode_ktx2(_to_rgb9e5(pixels), header, f"baker {VERSION}"))

    def size(self, path: Path) -> tuple[int, int]:
        """Return width and height; see `ktx2_size`."""
        return ktx2_size(path)

    def decode(self, path: Path) -> DecodedImage:
        """Read a file.

        Raises
        ------
        InputError
            If the file is missing, damaged, or not a KTX2 file with RGB9E5 pixels.
        """
        code, header = decode_ktx2(path)
        return DecodedImage(_from_rgb9e5(code), header, "uint", ("R", "G", "B"))


ENCODINGS.register("ktx2")(Ktx2Encoding())


def _to_rgb9e5(pixels: NDArray[np.float32]) -> NDArray[np.uint32]:
    """Return pixels (..., 3) as 32-bit words (...): red in the lowest bits, the exponent in the highest."""
    value = np.clip(pixels.astype(np.float64), 0.0, RGB9E5_MAX)
    brightest = value.max(axis=-1)
    # frexp returns floor(log2) + 1. It returns 0 for 0, whose exponent must be 0, too.
    exponent = np.where(brightest > 0.0, np.maximum(np.frexp(brightest)[1] + _BIAS, 0), 0)
    # If the brightest mantissa is rounded to 512, increase the exponent; the mantissa is then 256.
    exponent = exponent + (_mantissa(brightest, exponent) == 2**_MANTISSA_BITS)
    red, green, blue = np.moveaxis(_mantissa(value, exponent[..., None]), -1, 0)
    code: NDArray[np.uint32] = red | green << 9 | blue << 18 | exponent.astype(np.uint32) << 27
    return code


def _mantissa(value: NDArray[np.float64], exponent: NDArray[np.int32]) -> NDArray[np.uint32]:
    mantissa = np.floor(np.ldexp(value, _BIAS + _MANTISSA_BITS - exponent) + 0.5)
    return mantissa.astype(np.uint32)


def _from_rgb9e5(code: NDArray[np.uint32]) -> NDArray[np.float32]:
    mantissa = np.stack([code >> shift & 511 for shift in (0, 9, 18)], axis=-1)
    exponent = (code >> 27).astype(np.int32) - _BIAS - _MANTISSA_BITS
    value: NDArray[np.float32] = np.ldexp(mantissa.astype(np.float32), exponent[..., None])
    return value
