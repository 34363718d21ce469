"""Refuses outputs that would replace an input, a file of a bake, or another output."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path

from baker.core.errors import SettingsError
from baker.io.bake.output_folder import MANIFEST_NAME, is_file, own_files
from baker.io.scene_files import scene_files

# Files that every bake writes.
_ALWAYS = frozenset({MANIFEST_NAME, "scene.glb"})


def check_outputs(outputs: Mapping[str, Path], inputs: Iterable[Path]) -> None:
    """Raise an error before the work starts if an output would replace an input or a file of a bake.

    Parameters
    ----------
    outputs : mapping of str to Path
        Files and folders to write, by the name of their setting, such as "sarif".
    inputs : iterable of Path
        Scenes, configuration files and job files. The files that the scenes refer to are protected as well.

    Raises
    ------
    SettingsError
        If an output is an input, a file of a bake, or the same file as another output; links are followed.
        Also if an output is a folder in which a bake would replace an input.
    """
    # Read the scenes only if an output exists, because a new output cannot replace a file.
    files = {name: path for name, path in outputs.items() if is_file(path)}
    folders = {name: path for name, path in outputs.items() if path.is_dir()}
    if files or folders:
        known = [file for path in inputs for file in scene_files(path) if is_file(file)]
        for name, path in files.items():
            _check_file(name, path, known)
        for name, path in folders.items():
            _check_folder(name, path, known)
    seen: dict[str, str] = {}
    for name, path in outputs.items():
        other = seen.setdefault(os.path.realpath(path), name)
        if other != name and not path.is_char_device():
            raise SettingsError(f"`{other}` and `{name}` name the same file; name two", file=str(path))


def _check_file(name: str, path: Path, inputs: list[Path]) -> None:
    for file in inputs:
        if path.samefile(file):
            what = "is an input" if file == path else f"is the input '{file}'"
            raise SettingsError(
                f"`{name}` {what}, which is never replaced; name another file", file=str(path)
            )
    real = Path(os.path.realpath(path))
    for folder in real.parents:
        own = own_files(folder) if is_file(folder / MANIFEST_NAME) else None
        if own is not None and real.relative_to(folder).as_posix() in own:
            message = f"`{name}` is a file of the bake in '{folder}'; name another file"
            raise SettingsError(message, file=str(path))


def _check_folder(name: str, path: Path, inputs: list[Path]) -> None:
    folder = Path(os.path.realpath(path))
    own = _ALWAYS | (own_files(folder) or set())
    for file in inputs:
        real = Path(os.path.realpath(file))
        if real.is_relative_to(folder) and real.relative_to(folder).as_posix() in own:
            message = f"the bake would replace its own input '{file}'; name another folder with `{name}`"
            raise SettingsError(message, file=str(path))
