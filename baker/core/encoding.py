"""What an image encoding is: one file of `baker.encodings` that writes and reads one format.

Callers find an encoding by its name in `ENCODINGS` and never import it, so a new format is one new file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baker.core.registry import Registry

# A code that misses its value by more than this share shows as a step: the eye tells 1 to 2 % apart.
VISIBLE_STEP = 0.01
# Texels darker than this share of the page's mean are black on a screen exposed for the page.
BLACK = 0.01
# Rows measured at once, so that a page of 16384 texels a side needs no second page of memory.
_ROWS = 256


@dataclass(frozen=True)
class DecodedImage:
    """An image read back.

    Attributes
    ----------
    pixels : (H, W, C) float32, row 0 is v = 0
    header : dict of str to str, what the file says of itself
    dtype : str
        Number format in the file: "half", "float" or "uint".
    channels : tuple of str, names in the order of the last axis
    """

    pixels: NDArray[np.float32]
    header: dict[str, str]
    dtype: str
    channels: tuple[str, ...]


@dataclass(frozen=True)
class EncodeOptions:
    """What a format may be told.

    Attributes
    ----------
    half : bool
        EXR: 16 bit numbers, otherwise 32 bit.
    compression : str
        EXR: "zip" or "piz".
    top : float
        RGBM: the value stored as all ones.
    """

    half: bool = True
    compression: str = "zip"
    top: float = 1.0


class Encoding(Protocol):
    """Writes and reads one image format.

    `suffix` ends the names of its files and no other encoding's; `components` lists how many channels an
    image of it may have.
    """

    suffix: str
    components: tuple[int, ...]

    def limits(self, options: EncodeOptions) -> tuple[float, float]:
        """Return the lowest and highest value it can hold; what is beyond is stored there."""

    def stored(self, pixels: NDArray[np.float32], options: EncodeOptions) -> NDArray[np.float32]:
        """Return what a reader of the file will get for these pixels."""

    def tolerance(self, pixels: NDArray[np.float32], options: EncodeOptions) -> NDArray[np.float64]:
        """Return how far `stored` may be from pixels within the limits, element by element."""

    def encode(
        self, path: Path, pixels: NDArray[np.float32], *, options: EncodeOptions, header: Mapping[str, str]
    ) -> None:
        """Write pixels (H, W, C) to `path`."""

    def decode(self, path: Path) -> DecodedImage:
        """Read a file of this format."""


@dataclass(frozen=True)
class Loss:
    """What a format costs a page.

    Attributes
    ----------
    clipped : int
        Texels with a channel beyond the limits.
    banded : int
        Texels on surfaces whose code misses the value by a visible step, see `measure_loss`.
    surface : int
        Texels on surfaces.
    """

    clipped: int
    banded: int
    surface: int


def measure_loss(
    encoding: Encoding, pixels: NDArray[np.float32], surface: NDArray[np.bool_], options: EncodeOptions
) -> Loss:
    """Count the texels that a format clips, and those where its steps can be seen.

    Parameters
    ----------
    encoding : Encoding
    pixels : (H, W, C) float32
    surface : (H, W) bool
        Texels that are shown.
    options : EncodeOptions

    Returns
    -------
    Loss

    Notes
    -----
    A texel is banded if a channel is stored more than `VISIBLE_STEP` of its brightest channel away from its
    value, though not clipped. Texels that are as good as black beside the rest of the page do not count.
    """
    low, high = encoding.limits(options)
    n_surface = int(surface.sum())
    black = BLACK * float(np.abs(pixels[surface]).mean(dtype=np.float64)) if n_surface else 0.0
    clipped = banded = 0
    for start in range(0, len(pixels), _ROWS):
        rows, shown = pixels[start : start + _ROWS], surface[start : start + _ROWS]
        beyond = np.asarray(((rows < low) | (rows > high)).any(axis=2))
        clipped += int(beyond.sum())
        size = np.abs(rows).max(axis=2)
        miss = np.abs(encoding.stored(rows, options) - rows).max(axis=2)
        visible = (miss > VISIBLE_STEP * size) & (size > black)
        banded += int((visible & shown & ~beyond).sum())
    return Loss(clipped, banded, n_surface)


def check_pixels(pixels: NDArray[np.float32], components: tuple[int, ...], name: str) -> None:
    """Refuse what is no image of so many channels, or holds what is no number.

    Raises
    ------
    ValueError
    """
    if pixels.ndim != 3 or pixels.shape[2] not in components or 0 in pixels.shape:
        shapes = " nor ".join(f"(H, W, {count})" for count in components)
        word = "neither " if len(components) > 1 else "not "
        raise ValueError(f"pixels of shape {pixels.shape} are {word}{shapes}")
    # One look at the extremes (NaN shows in them) is all that most pages need.
    if np.isnan(pixels.min()) or np.isnan(pixels.max()):
        count = int(np.isnan(pixels).any(axis=2).sum())
        raise ValueError(f"{count} texels are not a number; {name} is not written")


ENCODINGS: Registry[Encoding] = Registry("baker.encodings")


def encoding_of(name: str) -> Encoding | None:
    """Return the encoding whose suffix ends a file's name (the longest one that does), or None."""
    plugins = [ENCODINGS.require(key, "encoding") for key in ENCODINGS.names()]
    fitting = [plugin for plugin in plugins if name.lower().endswith(plugin.suffix)]
    return max(fitting, key=lambda plugin: len(plugin.suffix), default=None)
