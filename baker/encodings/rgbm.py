"""Encodes high dynamic range in 8-bit RGBA pictures (RGBM), for engines and phones without float textures.

`rgbm` registers PNG files, and `webp` lossless WebP files, which are smaller.

`value = top * (rgb * a)^GAMMA`, where rgb and a are the stored bytes / 255, without sRGB decoding. The alpha
channel `a` is the largest of the three `(value / top)^(1 / GAMMA)`, rounded up, so that rgb never exceeds 1.
`top`, the value of `rgbm_range` in lx, and GAMMA are among the texts of the file.

Based on: B. Karis, RGBM color encoding, 2009; Unity's RGBM lightmaps, which also use a gamma of 2.2.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.encoding import (
    ENCODINGS,
    LARGEST_SIDE,
    DecodedImage,
    Encoding,
    EncodingOptions,
    check_pixels,
    write_image,
)
from baker.core.errors import InputError, SettingsError
from baker.core.settings_model import FILES, Text, setting
from baker.io.png import decode_png, encode_png, png_size

GAMMA = 2.2


@dataclass(frozen=True)
class PictureFormat:
    """A lossless file format for pictures with four components of 8 bits.

    Attributes
    ----------
    suffix : str
        End of the file names.
    encode : callable
        Returns the bytes of a file with pixels (H, W, 4) uint8 and texts.
    decode : callable
        Reads a file and returns its pixels and texts.
    size : callable
        Reads the header of a file and returns width and height.
    largest : int
        Largest width and height, pixels.
    """

    suffix: str
    encode: Callable[[NDArray[np.uint8], Mapping[str, str]], bytes]
    decode: Callable[[Path], tuple[NDArray[np.unsignedinteger[Any]], dict[str, str]]]
    size: Callable[[Path], tuple[int, int]]
    largest: int = LARGEST_SIDE


class RgbmOptions(EncodingOptions):
    """The irradiance that is stored as R = G = B = A = 255."""

    rgbm_range: Text = setting(
        "auto",
        "Largest irradiance that RGBM can store, lx; `auto` uses the brightest texel.",
        unit="lx",
        group=FILES,
        metavar="LX|auto",
    )

    def check(self) -> None:
        """Raise `SettingsError` if the range is neither auto nor a number above 0."""
        super().check()
        try:
            fits = self.is_auto or 0 < float(self.rgbm_range) < float("inf")
        except ValueError:
            fits = False
        if not fits:
            why = f"`rgbm_range` is neither auto nor a number of lx above 0 (was '{self.rgbm_range}')"
            raise SettingsError(why, object="rgbm_range")

    @property
    def is_auto(self) -> bool:
        """Return whether `rgbm_range` is "auto", so that the largest value of the map is used."""
        return self.rgbm_range.strip() == "auto"

    @property
    def top(self) -> float:
        """Return the irradiance stored as R = G = B = A = 255, lx."""
        return float(self.rgbm_range)


class RgbmEncoding(Encoding[RgbmOptions]):
    """Writes and reads RGBM pictures in a file format."""

    components: tuple[int, ...] = (3,)
    options_type = RgbmOptions
    when_clipped = "raise `rgbm_range` or set it to auto"
    when_banded = "lower `rgbm_range` or use the EXR"

    def __init__(self, format: PictureFormat) -> None:
        self.suffix, self.largest = format.suffix, format.largest
        self._format = format

    def fitted(self, options: RgbmOptions, brightest: float) -> RgbmOptions:
        """Replace `auto` by the map's largest value, or by 1 for a black map."""
        if not options.is_auto:
            return options
        return RgbmOptions(rgbm_range=repr(brightest if brightest > 0 else 1.0))

    def limits(self, options: RgbmOptions) -> tuple[float, float]:
        """Return 0 and `options.top`."""
        return 0.0, options.top

    def stored(self, pixels: NDArray[np.float32], options: RgbmOptions) -> NDArray[np.float32]:
        """Return pixels after encoding and decoding, with `a` and rgb rounded to 8 bits."""
        return _from_rgbm(_to_rgbm(pixels, options.top), options.top)

    def tolerance(self, pixels: NDArray[np.float32], options: RgbmOptions) -> NDArray[np.float64]:
        """Return a bound of the error: half an 8-bit step of rgb, times `a`, propagated through the power."""
        root = _root(pixels, options.top)
        multiplier = root.max(axis=-1, keepdims=True) + 1.0 / 255.0
        upper = (root + multiplier * (0.5 / 255.0)) ** GAMMA
        # Add the rounding error of decoding to single precision.
        bound: NDArray[np.float64] = options.top * (upper - root**GAMMA) + 1e-6 * pixels
        return bound

    def encode(
        self,
        path: Path,
        pixels: NDArray[np.float32],
        *,
        options: RgbmOptions,
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
        about = {**header, "rgbm": "value = top * (rgb * a)^gamma", "top": repr(options.top)}
        data = self._format.encode(_to_rgbm(pixels, options.top), {**about, "gamma": repr(GAMMA)})
        write_image(path, data)

    def size(self, path: Path) -> tuple[int, int]:
        """Return width and height."""
        return self._format.size(path)

    def decode(self, path: Path) -> DecodedImage:
        """Read a file whose texts contain `top` and `gamma`.

        Raises
        ------
        InputError
            If the file is missing, has another format, or lacks these texts.
        """
        pixels, header = self._format.decode(path)
        try:
            top, gamma = float(header["top"]), float(header["gamma"])
        except (KeyError, ValueError):
            raise InputError("the picture does not say top and gamma of its RGBM", file=str(path)) from None
        if pixels.dtype != np.uint8 or pixels.ndim != 3 or pixels.shape[2] != 4:
            raise InputError("the picture is not 8-bit RGBA, so it cannot be RGBM", file=str(path))
        return DecodedImage(_from_rgbm(pixels, top, gamma), header, "uint", ("R", "G", "B"))


ENCODINGS.register("rgbm")(RgbmEncoding(PictureFormat(".rgbm.png", encode_png, decode_png, png_size)))


def _root(pixels: NDArray[np.float32], top: float) -> NDArray[np.float64]:
    scaled = np.clip(pixels.astype(np.float64) / top, 0.0, 1.0)
    root: NDArray[np.float64] = scaled ** (1.0 / GAMMA)
    return root


def _to_rgbm(pixels: NDArray[np.float32], top: float) -> NDArray[np.uint8]:
    root = _root(pixels, top)
    # The multiplier is at least 1, so that black texels cause no division by zero.
    multiplier = np.maximum(np.ceil(root.max(axis=-1, keepdims=True) * 255.0 - 1e-9), 1.0)
    colour = np.rint(np.minimum(root * 255.0 / multiplier, 1.0) * 255.0)
    return np.concatenate([colour, multiplier], axis=-1).astype(np.uint8)


def _from_rgbm(
    code: NDArray[np.unsignedinteger[Any]], top: float, gamma: float = GAMMA
) -> NDArray[np.float32]:
    share = code.astype(np.float64) / 255.0
    value: NDArray[np.float32] = (top * (share[..., :3] * share[..., 3:]) ** gamma).astype(np.float32)
    return value
