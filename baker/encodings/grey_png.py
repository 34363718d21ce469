"""Encodes values from 0 to 1 as a grey PNG with 8 or 16 bits: linear, 0 is black, row 0 at the top.

`png8` and `png16` register instances of this encoding.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.encoding import DecodedImage, Encoding, EncodingOptions, check_pixels, write_image
from baker.core.errors import InputError
from baker.io.png import decode_png, encode_png, png_size


class GreyPng(Encoding[EncodingOptions]):
    """Writes and reads grey PNG files with 8 or 16 bits per texel.

    Parameters
    ----------
    bits : int
        8 or 16.
    remedy : str
        Advice in the warnings about clipped texels and visible steps between grey levels.
    """

    components: tuple[int, ...] = (1,)
    options_type = EncodingOptions

    def __init__(self, bits: int, remedy: str = "use the EXR") -> None:
        self.when_clipped = self.when_banded = remedy
        self.suffix = f".{bits}bit.png"
        self._dtype = np.dtype(f"uint{bits}")
        self._steps = 2**bits - 1

    def limits(self, options: EncodingOptions) -> tuple[float, float]:
        """Return 0 and 1."""
        return 0.0, 1.0

    def stored(self, pixels: NDArray[np.float32], options: EncodingOptions) -> NDArray[np.float32]:
        """Return pixels clamped to 0 to 1 and rounded to the nearest grey level."""
        return self._value(self._code(pixels))

    def tolerance(self, pixels: NDArray[np.float32], options: EncodingOptions) -> NDArray[np.float64]:
        """Return half the distance of two grey levels, plus 1e-7 for rounding to float32."""
        return np.full(pixels.shape, 0.5 / self._steps + 1e-7)

    def encode(
        self,
        path: Path,
        pixels: NDArray[np.float32],
        *,
        options: EncodingOptions,
        header: Mapping[str, str],
        names: tuple[str, ...] | None = None,
    ) -> None:
        """Write pixels (H, W, 1).

        Raises
        ------
        ValueError
            If a pixel is not a number, or the shape is not (H, W, 1).
        ResourceError
            If the file cannot be written.
        """
        check_pixels(pixels, self.components, path.name)
        write_image(path, encode_png(self._code(pixels)[:, :, 0], header))

    def size(self, path: Path) -> tuple[int, int]:
        """Return width and height; see `png_size`."""
        return png_size(path)

    def decode(self, path: Path) -> DecodedImage:
        """Read a file.

        Raises
        ------
        InputError
            If the file is missing, no PNG, or not a grey image with this number of bits.
        """
        code, header = decode_png(path)
        if code.dtype != self._dtype or code.ndim != 2:
            bits = self._dtype.itemsize * 8
            raise InputError(f"the picture is not grey with {bits} bits a texel", file=str(path))
        return DecodedImage(self._value(code)[:, :, None], header, "uint", ("Y",))

    def _code(self, pixels: NDArray[np.float32]) -> NDArray[np.unsignedinteger[Any]]:
        scaled = np.clip(pixels.astype(np.float64), 0.0, 1.0) * self._steps
        code: NDArray[np.unsignedinteger[Any]] = np.rint(scaled).astype(self._dtype)
        return code

    def _value(self, code: NDArray[np.unsignedinteger[Any]]) -> NDArray[np.float32]:
        value: NDArray[np.float32] = (code.astype(np.float64) / self._steps).astype(np.float32)
        return value
