"""The interface of image encodings: one file of `baker.encodings` writes and reads one format.

Callers find an encoding by its name in `ENCODINGS` and never import it. A new format is one new file, its
settings included: each field of its options is a setting of a bake, with a flag, a key of the configuration
file and a row of the settings page.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import ResourceError
from baker.core.registry import Registry
from baker.core.settings_model import Settings

# Relative error of a stored value above which steps are visible: the eye distinguishes 1 to 2 %.
VISIBLE_STEP = 0.01
# Texels darker than this share of the page's mean are black on a screen exposed for the page.
BLACK = 0.01
# The encoding of the files that every bake has.
ALWAYS_WRITTEN = "exr"
# Rows measured at once, so that a page of 16384 texels a side needs no second page of memory.
_ROWS = 256


@dataclass(frozen=True)
class DecodedImage:
    """An image read back.

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
    """Settings of one encoding; a subclass has a field with default, range and description for each.

    The names are settings of a bake and must differ from all other settings. The types are those that a flag
    can have: str, int, float, bool, Literal.
    """


Options = TypeVar("Options", bound=EncodingOptions)


class Encoding(ABC, Generic[Options]):
    """Writes and reads one image format.

    Attributes
    ----------
    suffix : str
        Ends the names of its files and those of no other encoding.
    components : tuple of int
        Numbers of components that an image of it may have.
    signed : bool
        Whether it holds negative numbers.
    options_type : type of `EncodingOptions`
    when_clipped, when_banded : str
        Advice if a page exceeds the limits, or has visible steps; ends the sentence of the warning.
    """

    suffix: str
    components: tuple[int, ...]
    signed: bool = False
    options_type: type[Options]
    when_clipped: str = "use the EXR"
    when_banded: str = "use the EXR"

    def options_of(self, settings: Settings) -> Options:
        """Return the options of this encoding among the settings of a bake."""
        return self.options_type(**{name: getattr(settings, name) for name in self.options_type.model_fields})

    def fitted(self, options: Options, brightest: float) -> Options:
        """Return the options for one map, with those set that depend on its largest value."""
        return options

    def options_of_image(self, image: DecodedImage) -> Options:
        """Return options that write an image in the number format of its file."""
        return self.options_type()

    @abstractmethod
    def limits(self, options: Options) -> tuple[float, float]:
        """Return the lowest and highest value it can hold; values beyond are stored as these."""

    @abstractmethod
    def stored(self, pixels: NDArray[np.float32], options: Options) -> NDArray[np.float32]:
        """Return (..., C) float32: the values decoded from the file for pixels (..., C)."""

    @abstractmethod
    def tolerance(self, pixels: NDArray[np.float32], options: Options) -> NDArray[np.float64]:
        """Return (..., C) float64: how far `stored` may be from pixels within the limits."""

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
        """Write pixels (H, W, C) to `path`, row 0 on top; equal arguments give equal bytes.

        Parameters
        ----------
        path : Path
            The file; its folder exists.
        pixels : (H, W, C) float32
            Values beyond the limits are stored as these.
        options : EncodingOptions
            As `fitted` returns them.
        header : mapping of str to str
            Quantity, unit and so on, kept in the file as text for `decode`.
        names : tuple of str, optional
            Of the components, where a format has names.

        Raises
        ------
        ValueError
            See `check_pixels`.
        ResourceError
            See `write_image`.
        """

    @abstractmethod
    def decode(self, path: Path) -> DecodedImage:
        """Read a file of this format; the pixels are those of `stored`.

        Raises
        ------
        InputError
            If the file cannot be read, or "is not a readable" image of this format, or ends early.
        """


@dataclass(frozen=True)
class Loss:
    """Texels of a page that a format cannot hold well.

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
    encoding: Encoding[Options], pixels: NDArray[np.float32], surface: NDArray[np.bool_], options: Options
) -> Loss:
    """Count the texels that a format clips, and those where its steps can be seen.

    Parameters
    ----------
    encoding : Encoding
        The format.
    pixels : (H, W, C) float32
        The page.
    surface : (H, W) bool
        Texels that are shown.
    options : EncodingOptions
        Of this encoding.

    Returns
    -------
    Loss
        Numbers of texels.

    Notes
    -----
    A texel is banded if a channel is stored more than `VISIBLE_STEP` of its brightest channel away from its
    value, though not clipped. Texels that are much darker than the page are not counted.
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
    """Refuse pixels of another shape than (H, W, C) with C in `components`, and NaN.

    Parameters
    ----------
    pixels : ndarray of float32
        Values to write.
    components : tuple of int
        Numbers of components that the format holds.
    name : str
        Of the file, for the message.

    Raises
    ------
    ValueError
    """
    if pixels.ndim != 3 or pixels.shape[2] not in components or 0 in pixels.shape:
        shapes = " nor ".join(f"(H, W, {count})" for count in components)
        word = "neither " if len(components) > 1 else "not "
        if len(components) > 3:
            word, shapes = "not ", f"(H, W, {min(components)} to {max(components)})"
        raise ValueError(f"pixels of shape {pixels.shape} are {word}{shapes}")
    # The minimum and maximum are NaN if any pixel is: no mask is needed for most pages.
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
        All of it.

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
        Name of the file; upper and lower case are the same.

    Returns
    -------
    Encoding or None
        The one with the longest suffix that ends the name.
    """
    plugins = [ENCODINGS.require(key, "encoding") for key in ENCODINGS.names()]
    fitting = [plugin for plugin in plugins if name.lower().endswith(plugin.suffix)]
    return max(fitting, key=lambda plugin: len(plugin.suffix), default=None)


def encodings_in_words() -> str:
    """Return the names of the encodings beside the EXR, by the number of components that they hold."""
    names: dict[tuple[int, ...], list[str]] = {}
    for name in ENCODINGS.names():
        if name != ALWAYS_WRITTEN:
            names.setdefault(ENCODINGS.require(name, "encoding").components, []).append(f"`{name}`")
    words: dict[tuple[int, ...], str] = {(3,): "colours", (1,): "one value"}
    return "; ".join(
        f"{', '.join(some)} ({words.get(count, 'any')})"
        for count, some in sorted(names.items(), reverse=True)
    )


def encoding_options() -> dict[str, type[EncodingOptions]]:
    """Return the options model of each encoding that has options, by the name of the encoding.

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
