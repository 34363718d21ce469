"""Writes a rendered picture as EXR with its layers, or as PNG.

In a PNG, each component L of the radiance is mapped to L / (L + m), and the result is encoded with the sRGB
curve. m is the median luminance of the pixels that are not black. Ambient occlusion is stored linearly, 0 to
1 as 0 to 255. A text chunk of the PNG describes the mapping.
"""

from __future__ import annotations

import os
from collections.abc import Collection
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import LUMINANCE_WEIGHTS
from baker.core.errors import ResourceError, SettingsError
from baker.core.version import VERSION
from baker.encodings.exr import encode_layers
from baker.io.output_path import resolved_output
from baker.io.png import encode_png, grey_levels, srgb_levels
from baker.io.temporary import atomic_path
from baker.rendering.render import Picture

# Suffixes of picture files.
SUFFIXES = (".exr", ".png")
# Descriptions of the tone mapping in a PNG: TONE for radiance, PLAIN for ambient occlusion.
TONE = "L / (L + median luminance), then the sRGB curve"
PLAIN = "none, 0 to 1 is 0 to 255"


def check_image(path: Path, aov: Collection[str] = ()) -> None:
    """Check, before rendering, that a picture with the layers `aov` can be written to `path`.

    Parameters
    ----------
    path : Path
        Path of an EXR or PNG file, which need not exist.
    aov : collection of str
        Names of the layers, which only an EXR file can store.

    Raises
    ------
    SettingsError
        If `path` has another suffix or is a folder. If layers are to be written to a PNG file. If
        `resolved_output` refuses `path`, or if its nearest existing parent is a file.
    ResourceError
        If the nearest existing parent is not writable.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise SettingsError(f"a picture ends in {' or '.join(SUFFIXES)}", file=str(path))
    if path.is_dir():
        raise SettingsError("this is a folder; name an image file", file=str(path))
    if aov and path.suffix.lower() != ".exr":
        raise SettingsError("only an EXR takes the layers of `aov`; name an .exr file", file=str(path))
    parent = next(p for p in resolved_output(path).parents if p.exists())
    if not parent.is_dir():
        raise SettingsError(f"'{parent}' is a file; the picture cannot lie in it", file=str(path))
    if not os.access(parent, os.W_OK):
        raise ResourceError("nothing can be written there; name another place", file=str(path))


def write_picture(path: Path, picture: Picture) -> None:
    """Write a picture to a file. After an error, the file has its old content.

    Parameters
    ----------
    path : Path
        Path of an EXR or PNG file.
    picture : Picture
        The picture that `render` returned.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    with atomic_path(path, "picture") as temporary:
        if path.suffix.lower() == ".png":
            text = {"tone mapping": tone_of(path, picture) or "", "software": _signature()}
            temporary.write_bytes(encode_png(tone_mapped(picture), text))
        else:
            encode_layers(temporary, exr_layers(picture), header=_header(picture))


def tone_of(path: Path, picture: Picture) -> str | None:
    """Return the description of the tone mapping with which `write_picture` writes a picture.

    Parameters
    ----------
    path : Path
        Path of an EXR or PNG file.
    picture : Picture
        The picture.

    Returns
    -------
    str or None
        Description of the mapping; None for an EXR file, which stores the values of the picture unchanged.
    """
    if path.suffix.lower() != ".png":
        return None
    return PLAIN if picture.unit == "1" else TONE


def tone_mapped(picture: Picture) -> NDArray[np.uint8]:
    """Return the pixels (H, W, 3) uint8 of a picture in a PNG, mapped as the module's docstring describes."""
    colour = picture.colour
    if picture.unit == "1":
        return grey_levels(colour)
    luminance = colour @ np.array(LUMINANCE_WEIGHTS, np.float32)
    lit = luminance[luminance > 0]
    middle = float(np.median(lit)) if lit.size else 1.0
    return srgb_levels(colour / (colour + np.float32(middle)))


def exr_layers(picture: Picture) -> dict[str, NDArray[np.float32]]:
    """Return the channels of a picture in an EXR file.

    Parameters
    ----------
    picture : Picture
        The picture.

    Returns
    -------
    dict of str to (H, W) float32
        Channels of colour, variance and layers, by name: R, variance.R, albedo.R, normal.X, depth.Z, ...
    """
    named = {"": picture.colour, "variance.": picture.variance}
    named.update({f"{name}.": layer for name, layer in picture.layers.items()})
    letters = {"normal.": "XYZ", "depth.": "Z"}
    return {
        prefix + letter: layer[..., index]
        for prefix, layer in named.items()
        for index, letter in enumerate(letters.get(prefix, "RGB")[: layer.shape[2]])
    }


def _header(picture: Picture) -> dict[str, str]:
    light = picture.unit != "1"
    return {
        "quantity": "radiance" if light else "ambient occlusion",
        "unit": picture.unit,
        "colourSpace": "linear Rec.709, D65" if light else "none",
        "software": _signature(),
    }


def _signature() -> str:
    return f"baker {VERSION}"
