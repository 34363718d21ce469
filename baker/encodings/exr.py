"""Writes and reads OpenEXR scanline images: half or float, ZIP or PIZ, channels R G B, Y, or named layers.

ZIP and PIZ are offered because engines and viewers read them more widely than PXR24, B44 and DWA. Files have
no time stamp, so the same pixels give the same bytes.

Based on: the OpenEXR file layout and its standard attributes (openexr.com, "Standard Optional Attributes").
"""

from __future__ import annotations

import contextlib
import io
import os
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from baker.core.encoding import ENCODINGS, DecodedImage, Encoding, EncodingOptions, check_pixels, check_size
from baker.core.errors import InputError, ResourceError
from baker.core.settings_model import FILES, setting

# Largest finite value of a 16-bit half float.
HALF_MAX = 65504.0

# Header attribute `chromaticities`: CIE xy of the Rec.709 primaries red, green and blue, and of D65 white.
REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)

# Largest number of components of an image. Spherical harmonics up to order 1 in three colours have 12.
MAX_COMPONENTS = 16

# File descriptor of stderr. The lock is held while the descriptor is redirected.
_STDERR = 2
_PRINTING = threading.Lock()

_NAMES = {1: ("Y",), 3: ("R", "G", "B")}


def encode_exr(
    path: Path,
    pixels: NDArray[np.float32],
    *,
    half: bool = True,
    compression: str = "zip",
    header: Mapping[str, str] | None = None,
    names: tuple[str, ...] | None = None,
) -> int:
    """Write one image, and read it back to check that the file is complete.

    Parameters
    ----------
    path : Path
        File to write; replaced if it exists.
    pixels : (H, W, C) float32
        Row 0 on top, 1 to 16 components.
    half : bool
        True for 16-bit floats, False for 32-bit floats.
    compression : str
        "zip" or "piz"; both are lossless.
    header : mapping of str to str
        Additional header attributes, such as quantity and unit.
    names : tuple of str, optional
        Channel name of each component, such as "R", or "albedo.R" for channel R of the layer "albedo". By
        default, one component is Y and three components are R, G, B in linear Rec.709. Other numbers of
        components need names.

    Returns
    -------
    int
        Number of texels with a component outside the range of the number format. Such components are clamped
        to the range.

    Raises
    ------
    ValueError
        If a pixel is not a number, or there is not one distinct name for each component.
    ResourceError
        If the file cannot be written.
    """
    check_pixels(pixels, ExrEncoding.components, path.name)
    names = names or _NAMES.get(pixels.shape[2], ())
    if len(set(names)) != pixels.shape[2]:
        raise ValueError(f"pixels of shape {pixels.shape} need a name for each component, not {names}")
    top = _top(half)
    clipped = 0
    if pixels.min() < -top or pixels.max() > top:
        clipped = int((np.abs(pixels) > top).any(axis=2).sum())
        pixels = np.clip(pixels, -top, top)
    stored = pixels.astype(np.float16 if half else np.float32)
    planes = {name: np.ascontiguousarray(stored[:, :, index]) for index, name in enumerate(names)}
    _write(path, planes, dict(header or {}), compression)
    return clipped


def encode_layers(
    path: Path, layers: Mapping[str, NDArray[np.float32]], *, header: Mapping[str, str] | None = None
) -> None:
    """Write named channels as one EXR with 32-bit floats.

    Parameters
    ----------
    path : Path
        File to write; replaced if it exists.
    layers : mapping of channel name to (H, W) float32
        "R", "G", "B" form the main layer. Channels of other layers have names such as "albedo.R" and
        "depth.Z".
    header : mapping of str to str
        Additional header attributes.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    planes = {name: np.ascontiguousarray(plane, np.float32) for name, plane in layers.items()}
    _write(path, planes, dict(header or {}), "zip")


def decode_exr(path: Path) -> DecodedImage:
    """Read an EXR file with one part.

    Parameters
    ----------
    path : Path

    Returns
    -------
    DecodedImage
        Those of the channels R, G, B, A that exist come first, then the other channels sorted by name.

    Raises
    ------
    InputError
        If the file is missing, damaged, larger than 16384 x 16384 pixels, or has channels of different
        sizes.
    """
    import OpenEXR

    exr_size(path)
    with _readable(path), OpenEXR.File(str(path), separate_channels=True) as file:
        planes = {name: np.array(channel.pixels) for name, channel in file.channels().items()}
        header = {str(key): _text(value) for key, value in file.header().items() if key != "channels"}
    names = sorted(planes, key=lambda name: ("RGBA".find(name) if name in "RGBA" else 4, name))
    if len({plane.shape for plane in planes.values()}) != 1:
        raise InputError("its channels are absent or differ in size", file=str(path))
    dtype = {"float16": "half", "float32": "float"}.get(str(planes[names[0]].dtype), "uint")
    pixels = np.stack([planes[name].astype(np.float32) for name in names], axis=-1)
    return DecodedImage(pixels, header, dtype, tuple(names))


def exr_size(path: Path) -> tuple[int, int]:
    """Return width and height of an EXR file from its header.

    Parameters
    ----------
    path : Path

    Returns
    -------
    (int, int)
        Pixels.

    Raises
    ------
    InputError
        If the file is missing or damaged, or larger than 16384 x 16384 pixels.
    """
    import OpenEXR

    if not path.is_file():
        raise InputError("there is no such file", file=str(path))
    with _readable(path), OpenEXR.File(str(path), header_only=True) as file:
        # First and last pixel (x, y), both inclusive.
        low, high = (np.asarray(corner, np.int64) for corner in file.header()["dataWindow"])
    width, height = (int(n) for n in high - low + 1)
    check_size(path, width, height)
    return width, height


@contextlib.contextmanager
def _readable(path: Path) -> Iterator[None]:
    """Convert the errors of OpenEXR about a damaged file to `InputError`, and print nothing."""
    try:
        with _silent_library():
            yield
    # OpenEXR reports damaged files as RuntimeError or ValueError.
    except (RuntimeError, ValueError, OSError, KeyError) as error:
        raise InputError(f"this is not a readable EXR image ({_first_line(error)})", file=str(path)) from None


@contextlib.contextmanager
def _silent_library() -> Iterator[None]:
    """Discard what OpenEXR prints about damaged files, because it raises exceptions as well.

    The C++ library writes to the descriptor of stderr, and its Python module prints to `sys.stdout`.
    """
    with _PRINTING, contextlib.redirect_stdout(io.StringIO()):
        if sys.stderr is not None:
            sys.stderr.flush()
        try:
            kept = os.dup(_STDERR)
        except OSError:
            # stderr is closed, so nothing can be printed.
            yield
            return
        nowhere = os.open(os.devnull, os.O_WRONLY)
        try:
            os.dup2(nowhere, _STDERR)
            yield
        finally:
            os.dup2(kept, _STDERR)
            os.close(kept)
            os.close(nowhere)


class ExrOptions(EncodingOptions):
    """Options of EXR files: number format and compression."""

    dtype: Literal["half", "float"] = setting("half", "Number format of the EXR files.", group=FILES)
    exr_compression: Literal["zip", "piz"] = setting("zip", "Compression of the EXR files.", group=FILES)


class ExrEncoding(Encoding[ExrOptions]):
    """OpenEXR files, written by `encode_exr` and read by `decode_exr`."""

    suffix = ".exr"
    components: tuple[int, ...] = tuple(range(1, MAX_COMPONENTS + 1))
    signed = True
    options_type = ExrOptions
    when_clipped = "use `dtype='float'`"
    when_banded = "use `dtype='float'`"

    def options_of_image(self, image: DecodedImage) -> ExrOptions:
        """Return options with the number format of the image."""
        return ExrOptions(dtype="half" if image.dtype == "half" else "float")

    def limits(self, options: ExrOptions) -> tuple[float, float]:
        """Return the lowest and highest finite value of the number format."""
        return -_top(options.dtype == "half"), _top(options.dtype == "half")

    def stored(self, pixels: NDArray[np.float32], options: ExrOptions) -> NDArray[np.float32]:
        """Return pixels clamped and rounded to the number format."""
        clipped = np.clip(pixels, *self.limits(options))
        return clipped.astype(np.float16).astype(np.float32) if options.dtype == "half" else clipped

    def tolerance(self, pixels: NDArray[np.float32], options: ExrOptions) -> NDArray[np.float64]:
        """Return the rounding error: for half, 2^-11 of the value but at least 2^-25; for float, 0."""
        size = np.abs(pixels.astype(np.float64))
        return np.maximum(size * 2.0**-11, 2.0**-25) if options.dtype == "half" else np.zeros_like(size)

    def encode(
        self,
        path: Path,
        pixels: NDArray[np.float32],
        *,
        options: ExrOptions,
        header: Mapping[str, str],
        names: tuple[str, ...] | None = None,
    ) -> None:
        """Write pixels; see `encode_exr`."""
        half = options.dtype == "half"
        encode_exr(path, pixels, half=half, compression=options.exr_compression, header=header, names=names)

    def size(self, path: Path) -> tuple[int, int]:
        """Return width and height; see `exr_size`."""
        return exr_size(path)

    def decode(self, path: Path) -> DecodedImage:
        """Read pixels; see `decode_exr`."""
        return decode_exr(path)


ENCODINGS.register("exr")(ExrEncoding())


def _top(half: bool) -> float:
    return HALF_MAX if half else float(np.finfo(np.float32).max)


def _write(
    path: Path, planes: Mapping[str, NDArray[Any]], attributes: dict[str, str], compression: str
) -> None:
    import OpenEXR

    methods = {"zip": OpenEXR.ZIP_COMPRESSION, "piz": OpenEXR.PIZ_COMPRESSION}
    header: dict[str, object] = dict(sorted(attributes.items()))
    header["compression"] = methods[compression]
    header["type"] = OpenEXR.scanlineimage
    if "R" in planes:
        header["chromaticities"] = REC709
    try:
        # Pass a copy, because OpenEXR keeps the dictionary and empties it later.
        with OpenEXR.File(header, dict(planes)) as file:
            file.write(str(path))
        # Read the file back, because OpenEXR raises no error if the disk is full when the file is closed.
        with OpenEXR.File(str(path), separate_channels=True) as file:
            back = file.channels()
            complete = all(np.array_equal(back[name].pixels, plane) for name, plane in planes.items())
    except (RuntimeError, OSError) as error:
        raise ResourceError(
            f"the image could not be written ({_first_line(error)})", file=str(path)
        ) from None
    if not complete:
        raise ResourceError("the image did not reach the disk whole; free some space", file=str(path))


def _text(value: object) -> str:
    """Return a header value as one line of plain text."""
    if isinstance(value, tuple | list):
        return ", ".join(_text(part) for part in value)
    if isinstance(value, np.ndarray):
        return ", ".join(f"{part:g}" for part in value.ravel())
    if isinstance(value, float):
        return f"{value:g}"
    name = getattr(value, "name", None)
    return str(name) if name is not None else str(value)


def _first_line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0].rstrip(". ")
