"""Reads Wavefront material libraries (MTL): the statements for diffuse reflection, emission and opacity.

Reflectance = Kd x map_Kd, emission = Ke x map_Ke (cd/m2), opacity = (d or 1 - Tr) x map_d.

Based on: Alias|Wavefront, Advanced Visualizer manual, appendix B.1; `Ke` and `map_Ke` as commonly written.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.scene import Material, SceneWarning, Texture
from baker.io.alpha_texture import channel, lowest_alpha, same_mapping, with_alpha
from baker.io.images import decode_image, stand_in
from baker.io.scene_folder import OutsideError, OutsideName

# Option of a map statement -> number of words after it that belong to the option.
_OPTION_VALUES = {
    "-blendu": 1,
    "-blendv": 1,
    "-bm": 1,
    "-boost": 1,
    "-cc": 1,
    "-clamp": 1,
    "-imfchan": 1,
    "-mm": 2,
    "-texres": 1,
    "-type": 1,
    "-colorspace": 1,
}
_VECTOR_OPTIONS = ("-o", "-s", "-t")


def read_mtl(
    text: str,
    *,
    file: str,
    folder: Path,
    read_file: Callable[[str, Path], bytes],
    used: Container[str],
    missing: tuple[str, list[SceneWarning]] | None = None,
    decode: Callable[..., NDArray[np.uint8]] = decode_image,
) -> list[Material]:
    """Read the materials of a library.

    Parameters
    ----------
    text : str
        The library's content.
    file : str
        Name of the library, for messages.
    folder : Path
        Folder that image names are relative to.
    read_file : callable
        Returns the content of the file with a given name in a given folder. Raises OSError, ValueError or
        OutsideName if the file cannot be read.
    used : container of str
        Names of the materials that faces use. Errors in other materials are ignored, except `OutsideError`.
    missing : (str, list of SceneWarning), optional
        Colour of images that cannot be read (see `stand_in`), and the list that gets a warning for each.
        None raises an error.
    decode : callable
        Decodes the content of an image file; see `decode_image`.

    Returns
    -------
    list of Material
        The materials, in the library's order.

    Raises
    ------
    InputError
        For a value that is not a number, or an image that is outside the folder of the scene. Without
        `missing`, also for an image that is missing or cannot be decoded.
    """
    images = _Images(file, folder, read_file, decode)

    def texture(material: str, words: list[str] | None) -> Texture | None:
        if not words:
            return None
        names, transform, clamp = _map_options(words, file, material)
        try:
            pixels = images.find(material, words, names)
        except InputError as error:
            if missing is None or isinstance(error, OutsideError) or material not in used:
                raise
            colour, warnings = missing
            message = f"{error.message}; {colour} replaces it"
            warnings.append(SceneWarning("missing-texture", message, material))
            return Texture(stand_in(colour))
        return Texture(pixels, 0, transform, ("clamp", "clamp") if clamp else ("repeat", "repeat"))

    out = []
    for statements in _parse(text):
        name = " ".join(statements["name"])
        try:
            out.append(_material(statements, file, texture))
        except InputError as error:
            if name in used or isinstance(error, OutsideError):
                raise
            out.append(Material(name=name))
    return out


def _parse(text: str) -> list[dict[str, list[str]]]:
    """Return a dict for each material: keyword -> words after it, and "name" -> words of its name."""
    materials: list[dict[str, list[str]]] = []
    for line in text.splitlines():
        words = line.split("#", 1)[0].split()
        if not words:
            continue
        if words[0] == "newmtl":
            materials.append({"name": words[1:]})
        elif materials:
            materials[-1][words[0].lower()] = words[1:]
    return materials


class _Images:
    """Reads the images of a library, each image once."""

    def __init__(
        self,
        file: str,
        folder: Path,
        read_file: Callable[[str, Path], bytes],
        decode: Callable[..., NDArray[np.uint8]],
    ) -> None:
        self._file = file
        self._folder = folder
        self._read_file = read_file
        self._decode = decode
        self._pixels: dict[str, NDArray[np.uint8]] = {}

    def find(self, material: str, words: list[str], names: list[str]) -> NDArray[np.uint8]:
        """Return the pixels of the first existing file of `names`; `words` is the map statement."""
        outside: OutsideName | None = None
        for name in names:
            if name in self._pixels:
                return self._pixels[name]
            try:
                data = self._read_file(name.replace("\\", "/"), self._folder)
            except FileNotFoundError:
                continue
            except OutsideName as error:
                outside = outside or error
                continue
            except (OSError, ValueError) as error:
                why = getattr(error, "strerror", None) or error
                raise InputError(
                    f"the image '{name}' cannot be read: {why}", file=self._file, object=material
                ) from None
            self._pixels[name] = self._decode(data, file=self._file, object=name)
            return self._pixels[name]
        if outside is not None:
            message = f"the image '{' '.join(words)}' {outside}"
            raise OutsideError(message, file=self._file, object=material)
        message = f"the image '{' '.join(words)}' is missing; put it beside the scene"
        raise InputError(message, file=self._file, object=material)


def _material(
    words: dict[str, list[str]], file: str, texture: Callable[[str, list[str] | None], Texture | None]
) -> Material:
    """Return the material that `words` (keyword -> words) describes; `texture` reads a map statement."""
    name = " ".join(words["name"])

    def colour(key: str, default: float) -> tuple[float, float, float]:
        values = words.get(key, [])
        if values[:1] and values[0].lower() in ("xyz", "spectral"):
            raise InputError(f"{key} is given as {values[0]}; only R G B is read", file=file, object=name)
        numbers = [_number(v, key, file, name) for v in values[:3]] or [default]
        numbers += numbers[:1] * (3 - len(numbers))  # missing G and B are equal to R
        return (numbers[0], numbers[1], numbers[2])

    red, green, blue = colour("kd", 0.8)
    emission_texture = texture(name, words.get("map_ke"))
    opacity = 1.0
    if words.get("d"):
        opacity = _number(words["d"][-1], "d", file, name)
    elif words.get("tr"):
        opacity = 1.0 - _number(words["tr"][-1], "Tr", file, name)
    opacity = min(max(opacity, 0.0), 1.0)
    base_texture, opacity_texture = texture(name, words.get("map_kd")), texture(name, words.get("map_d"))
    if opacity_texture is not None:
        if base_texture is not None and not same_mapping(base_texture, opacity_texture):
            message = "map_d and map_Kd have different options; give both the same -s, -o and -clamp"
            raise InputError(message, file=file, object=name)
        # Many exporters name the image of map_Kd, whose alpha is the opacity. Else the image is grey.
        number = 3 if lowest_alpha(opacity_texture) < 1.0 else 0
        base_texture = with_alpha(base_texture, opacity_texture, channel(opacity_texture, number))
    return Material(
        name=name,
        base_colour=(red, green, blue, opacity),
        base_colour_texture=base_texture,
        emission=colour("ke", 1.0 if emission_texture is not None and "ke" not in words else 0.0),
        emission_texture=emission_texture,
        alpha_mode="OPAQUE" if opacity == 1.0 and opacity_texture is None else "BLEND",
        metallic=0.0,
    )


def _map_options(words: list[str], file: str, material: str) -> tuple[list[str], NDArray[np.float64], bool]:
    """Return the possible file names of a map statement, its uv transform, and whether `-clamp` is on.

    The transform is a (2, 3) matrix that maps mesh uv to image uv.
    """
    shift, stretch, clamp = [0.0, 0.0], [1.0, 1.0], False
    k = 0
    while k < len(words) - 1 and words[k].lower() in (*_OPTION_VALUES, *_VECTOR_OPTIONS):
        option = words[k].lower()
        k += 1
        if option in _OPTION_VALUES:
            clamp = words[k].lower() == "on" if option == "-clamp" else clamp
            k += _OPTION_VALUES[option]
            continue
        values: list[float] = []
        while k < len(words) - 1 and len(values) < 3 and _is_number(words[k]):
            values.append(_number(words[k], option, file, material))
            k += 1
        if option == "-o":
            shift[: len(values[:2])] = values[:2]
        elif option == "-s":
            stretch[: len(values[:2])] = values[:2]
    # In OBJ, v = 0 is the last image row. In mesh uv and image uv, v = 0 is the first row. Therefore,
    # v' = 1 - (s (1 - v) + o).
    transform = np.array(
        [[stretch[0], 0.0, shift[0]], [0.0, stretch[1], 1.0 - stretch[1] - shift[1]]], np.float64
    )
    rest = words[k:]
    # Names may contain blanks. Also try the name without its folder, because absolute paths may be those of
    # another computer.
    name = " ".join(rest)
    return list(dict.fromkeys((name, name.replace("\\", "/").rsplit("/", 1)[-1]))), transform, clamp


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _number(word: str, key: str, file: str, material: str) -> float:
    if not _is_number(word) or not math.isfinite(float(word)):
        raise InputError(f"{key} holds '{word[:20]}' instead of a number", file=file, object=material)
    value = float(word)
    if value < 0 and not key.startswith("-"):
        raise InputError(f"{key} is negative ({word})", file=file, object=material)
    return value
