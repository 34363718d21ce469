"""Lists the files that a scene file may refer to, without loading the scene."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from baker.core.errors import InputError
from baker.io.gltf.chunks import MAGIC, split_glb
from baker.io.gltf.uri import file_names, is_data
from baker.io.level import LEVEL_SUFFIXES, level_files
from baker.io.regular_file import LARGEST_PART, read_regular


def scene_files(path: Path) -> list[Path]:
    """Return the files that may belong to a scene: the scene file and those that it refers to.

    Parameters
    ----------
    path : Path
        A scene file of any format, or any other file.

    Returns
    -------
    list of Path
        Some of the files may not exist, because a reference may stand for several names. The list is only
        `path` if the file cannot be read or its format has no references.
    """
    try:
        if path.suffix.lower() in (".glb", ".gltf"):
            return [path, *(path.parent / name for name in _gltf_names(read_regular(path), str(path)))]
        if path.suffix.lower() in LEVEL_SUFFIXES:
            return [path, *(file for placed in level_files(path) for file in scene_files(placed))]
        if path.suffix.lower() == ".obj":
            return [path, *_obj_files(path)]
    except (OSError, ValueError, RecursionError, InputError):
        pass
    return [path]


def _gltf_names(data: bytes, file: str) -> Iterator[str]:
    """Yield the file names in all members "uri" of a document, including members of extensions."""
    text = split_glb(data, file).json if data[:4] == MAGIC else data
    waiting: list[Any] = [json.loads(text.decode("utf-8-sig"))]
    while waiting:
        value = waiting.pop()
        if isinstance(value, dict):
            uri = value.get("uri")
            if isinstance(uri, str) and not is_data(uri):
                yield from file_names(uri)
            waiting += value.values()
        elif isinstance(value, list):
            waiting += value


def _obj_files(path: Path) -> Iterator[Path]:
    """Yield the material libraries of an OBJ file, and the images that they may name."""
    for name in _statements(path, ("mtllib",)):
        library = path.parent / name
        yield library
        if library.is_file():
            yield from (
                library.parent / image for image in _statements(library, ("map_", "bump", "disp", "refl"))
            )


def _statements(path: Path, keys: tuple[str, ...]) -> Iterator[str]:
    """Yield the words that may be a file name in the statements whose keyword begins with one of `keys`."""
    for line in read_regular(path, most=LARGEST_PART).decode("utf-8", "replace").splitlines():
        if line.lstrip()[:6].lower().startswith(keys):
            words = line.replace("\\", "/").split()[1:]
            # Yield single words and the ends of the line: a name may follow options and contain blanks.
            yield from words
            yield from (" ".join(words[k:]) for k in range(min(len(words), 20)))
