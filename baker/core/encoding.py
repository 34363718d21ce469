"""Defines the interface of image encodings: each file of `baker.encodings` writes and reads one image format.

Callers look up an encoding by its name in `ENCODINGS` and do not import it. A new format is therefore added
as one new file. Each field of its options class becomes a setting of a bake: a flag of the command line, a
key of the configuration file and a row of the settings page.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError, ResourceError
from baker.core.registry import Registry
from baker.core.settings_model import Settings

# Largest error of a stored value, as a share of the texel's brightest component, that is not visible. The eye
# distinguishes luminances that differ by 1 to 2 %.
VISIBLE_STEP = 0.01
# Absolute value up to which a texel counts as black, as a share of the mean absolute value of the page's
# texels on surfaces. Errors of black texels are not counted.
BLACK = 0.01
# Encoding of the files that every bake writes.
ALWAYS_WRITTEN = "exr"
# Largest width and height of an image that is read, pixels.
LARGEST_SIDE = 16384
# Rows of a page that `measure_loss` processes at once, to limit its memory.
_ROWS = 256


@dataclass(frozen=True)
class DecodedImage:
    """An image read from a file.

    Attributes
    ----------
    pixels : (H, W, C) float32, row 0 is v = 0
    header : dict of str to str
        Attributes or text chunks of the file.
    dtype : str
        Number format in the file: "half", "float" or "uint".
    channels : tuple of str
        Names of the components in the order of the last axis.
    """

    pixels: NDArray[np.float32]
    header: dict[str, str]
    dtype: str
    channels: tuple[str, ...]


class EncodingOptions(Settings):
    """Base class for the options of an encoding; each option is a field made with `setting`.

    Options are settings of a bake, so their names must differ from those of all other settings. The type of a
    field is str, int, float, bool or Literal, because the command line makes a flag of it.
    """


Options = TypeVar("Options", bound=EncodingOptions)


class Encoding(ABC, Generic[Options]):
    """Writes and reads one image format.

    Attributes
    ----------
    suffix : str
        End of the file names of this format. It must differ from the suffixes of all other encodings.
    components : tuple of int
        Numbers of components per pixel that the format supports.
    signed : bool
        Whether the format can store negative values.
    options_type : type of `EncodingOptions`
        Class of its options.
    largest : int
        Largest width and height of an image in this format, texels.
    when_clipped, when_banded : str
        Advice at the end of the warning about a page that exceeds the limits, or that has visible steps.
    """

    suffix: str
    components: tuple[int, ...]
    signed: bool = False
    largest: int = LARGEST_SIDE
    options_type: type[Options]
    when_clipped: str = "use the EXR"
    when_banded: str = "use the EXR"

    def options_of(self, settings: Settings) -> Options:
        """Return the options of this encoding, taken from the settings of a bake."""
        return self.options_type(**{name: getattr(settings, name) for name in self.options_type.model_fields})

    def fitted(self, options: Options, brightest: float) -> Options:
        """Return the options for a map whose largest value is `brightest`; by default `options` unchanged."""
        return options

    def options_of_image(self, image: DecodedImage) -> Options:
        """Return options with which `encode` writes `image` in the number format that it was read from."""
        return self.options_type()

    @abstractmethod
    def limits(self, options: Options) -> tuple[float, float]:
        """Return the smallest and the largest value that can be stored; other values are clipped to them."""

    @abstractmethod
    def stored(self, pixels: NDArray[np.float32], options: Options) -> NDArray[np.float32]:
        """Return (..., C) float32: the values that `decode` returns after `encode` wrote pixels (..., C)."""

    @abstractmethod
    def tolerance(self, pixels: NDArray[np.float32], options: Options) -> NDArray[np.float64]:
        """Return (..., C) float64: the largest |stored - pixels| for pixels (..., C) within the limits."""

    @abstractmethod
    def encode(
        self,
        path: Path,
        pixels: NDArray[np.float32],
        *,
        options: Options,
        header: Mapping[str, str],
        names: tuple[str, ...] | None = None,
    ) -> None:
        """Write pixels (H, W, C) to `path`, with row 0 as the top row. Equal arguments give equal bytes.

        Parameters
        ----------
        path : Path
            The file; its folder exists.
        pixels : (H, W, C) float32
            Values outside the limits are clipped to them.
        options : EncodingOptions
            Result of `fitted`.
        header : mapping of str to str
            Quantity, unit and other texts, stored in the file for `decode`.
        names : tuple of str, optional
            Names of the components, for formats that store names.

        Raises
        ------
        ValueError
            If `check_pixels` refuses the pixels.
        ResourceError
            If the file cannot be written.
        """

    def size(self, path: Path) -> tuple[int, int] | None:
        """Return width and height from the header of a file, without decoding the pixels.

        Returns
        -------
        (int, int) or None
            Width and height, pixels. None, the default, if the encoding does not read headers.

        Raises
        ------
        InputError
            If the file cannot be read, or its header is not that of an image of this format.
        """
        return None

    @abstractmethod
    def decode(self, path: Path) -> DecodedImage:
        """Read a file of this format. The pixels equal the result of `stored` for the encoded pixels.

        Raises
        ------
        InputError
            If the file cannot be read, is not an image of this format, or is truncated. If it is not an image
            of this format, the message contains "is not a readable".
        """


def check_size(path: Path, width: int, height: int) -> None:
    """Raise an error for an empty or very large image, before its pixels are decoded.

    Parameters
    ----------
    path : Path
        File of the image, which the error names.
    width, height : int
        Size that the header of the file states, pixels.

    Raises
    ------
    InputError
        If width or height is 0 or above `LARGEST_SIDE`.
    """
    if not (1 <= width <= LARGEST_SIDE and 1 <= height <= LARGEST_SIDE):
        message = f"its size is {width} x {height} pixels; at most {LARGEST_SIDE} a side are read"
        raise InputError(message, file=str(path))


@dataclass(frozen=True)
class Loss:
    """Numbers of texels of a page that a format cannot store accurately.

    Attributes
    ----------
    clipped : int
        Number of texels of the whole page with a component outside the limits.
    banded : int
        Number of texels on surfaces that are not clipped and have a visible error, see `measure_loss`.
    surface : int
        Number of texels on surfaces.
    """

    clipped: int
    banded: int
    surface: int


def measure_loss(
    encoding: Encoding[Options], pixels: NDArray[np.float32], surface: NDArray[np.bool_], options: Options
) -> Loss:
    """Count the texels that a format clips, and the texels whose stored value has a visible error.

    Parameters
    ----------
    encoding : Encoding
        The format.
    pixels : (H, W, C) float32
        The page.
    surface : (H, W) bool
        Texels on surfaces.
    options : EncodingOptions
        Options of `encoding`.

    Returns
    -------
    Loss
        Numbers of texels.

    Notes
    -----
    A texel is banded if it is on a surface and not clipped, and the stored value of a component differs from
    the true value by more than `VISIBLE_STEP` times the largest absolute component of the texel. A texel is
    not banded if this component is at most `BLACK` times the mean absolute value of all components of texels
    on surfaces.
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
    """Raise an error if pixels are not (H, W, C) with C in `components`, or if a component is NaN.

    Parameters
    ----------
    pixels : ndarray of float32
        Values to write.
    components : tuple of int
        Numbers of components that the format supports.
    name : str
        Name of the file, for the message.

    Raises
    ------
    ValueError
        If the shape differs, H or W is 0, or a component is NaN.
    """
    if pixels.ndim != 3 or pixels.shape[2] not in components or 0 in pixels.shape:
        shapes = " nor ".join(f"(H, W, {count})" for count in components)
        word = "neither " if len(components) > 1 else "not "
        if len(components) > 3:
            word, shapes = "not ", f"(H, W, {min(components)} to {max(components)})"
        raise ValueError(f"pixels of shape {pixels.shape} are {word}{shapes}")
    # The minimum is NaN if any component is. Testing it first avoids a mask for pages without NaN.
    if np.isnan(pixels.min()) or np.isnan(pixels.max()):
        count = int(np.isnan(pixels).any(axis=2).sum())
        raise ValueError(f"{count} texels are not a number; {name} is not written")


def write_image(path: Path, data: bytes) -> None:
    """Write the content of an image file.

    Parameters
    ----------
    path : Path
        The file; replaced if it exists.
    data : bytes
        The whole content.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    try:
        path.write_bytes(data)
    except OSError as error:
        raise ResourceError(f"the image could not be written ({error.strerror})", file=str(path)) from None


ENCODINGS: Registry[Encoding[Any]] = Registry("baker.encodings")


def encoding_of(name: str) -> Encoding[Any] | None:
    """Find the encoding of a file by its name.

    Parameters
    ----------
    name : str
        Name of the file; case is ignored.

    Returns
    -------
    Encoding or None
        The encoding whose suffix the name ends with. If the name ends with several suffixes, the encoding
        with the longest of them. None if no suffix fits.
    """
    plugins = [ENCODINGS.require(key, "encoding") for key in ENCODINGS.names()]
    fitting = [plugin for plugin in plugins if name.lower().endswith(plugin.suffix)]
    return max(fitting, key=lambda plugin: len(plugin.suffix), default=None)


def encodings_in_words() -> str:
    """Return a text that lists all encodings except the EXR, grouped by their numbers of components."""
    names: dict[tuple[int, ...], list[str]] = {}
    for name in ENCODINGS.names():
        if name != ALWAYS_WRITTEN:
            names.setdefault(ENCODINGS.require(name, "encoding").components, []).append(f"`{name}`")
    words: dict[tuple[int, ...], str] = {
        (3,): "three colours",
        (1,): "one value per texel",
        (1, 3): "one value per texel or three colours",
    }
    return "; ".join(
        f"{', '.join(some)} for maps with {words.get(count) or _numbers(count) + ' components'}"
        for count, some in sorted(names.items(), reverse=True)
    )


def _numbers(count: Sequence[int]) -> str:
    """Return numbers of components as text, such as "1, 2 or 4" or "1 to 4"."""
    if len(count) > 2 and list(count) == list(range(count[0], count[-1] + 1)):
        return f"{count[0]} to {count[-1]}"
    *first, last = map(str, count)
    return f"{', '.join(first)} or {last}" if first else last


def encoding_options() -> dict[str, type[EncodingOptions]]:
    """Return {name of an encoding: class of its options}, for encodings that have options.

    If several encodings share a class of options, only the first of them by name is returned.

    Raises
    ------
    ValueError
        If two encodings have an option of the same name.
    """
    models = {name: ENCODINGS.require(name, "encoding").options_type for name in ENCODINGS.names()}
    found: dict[str, type[EncodingOptions]] = {}
    owner: dict[str, str] = {}
    for name, model in models.items():
        for field in model.model_fields if model not in found.values() else ():
            if field in owner:
                raise ValueError(f"the encodings {owner[field]} and {name} both have an option '{field}'")
            owner[field] = name
            found[name] = model
    return found
