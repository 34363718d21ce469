"""Finds the scene files that paths, folders and patterns name, and checks them one after the other."""

from __future__ import annotations

import glob
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from baker.checks.ignore import parse_ignore
from baker.checks.run import CheckReport, check_scene
from baker.checks.settings import CheckSettings
from baker.core.errors import InputError
from baker.core.progress import Progress, silent
from baker.core.settings import BakeSettings
from baker.io.load import IMPORTERS


@dataclass(frozen=True)
class Unreadable:
    """A scene file that could not be read, and the error."""

    path: Path
    error: InputError


def find_scenes(paths: Sequence[Path]) -> list[Path]:
    """Return the scene files that paths, folders and patterns name, without duplicates.

    Parameters
    ----------
    paths : sequence of Path
        Paths of files, folders, or patterns with `*`, `?` or `[`. A folder stands for all scene files in it
        and in its subfolders. A pattern stands for the scene files that match it, and for those in the
        folders that match it.

    Returns
    -------
    list of Path
        In the order of `paths`. The files of each folder or pattern are sorted.

    Raises
    ------
    InputError
        If a folder contains no scene file, or a pattern matches none.
    """
    known = set(IMPORTERS.names())
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = _below(path, known)
            if not inside:
                raise InputError(f"there is no scene file ({', '.join(sorted(known))}) below", file=str(path))
        elif not path.exists() and glob.has_magic(str(path)):
            # Expand the pattern here, because some shells pass it on unexpanded.
            root = Path(path.anchor)
            inside = [
                p for match in sorted(root.glob(str(path.relative_to(root)))) for p in _below(match, known)
            ]
            if not inside:
                raise InputError("no scene file has a name like this", file=str(path))
        else:
            inside = [path]
        found.update(dict.fromkeys(inside))
    return list(found)


def _below(path: Path, known: set[str]) -> list[Path]:
    """Return the sorted scene files in a folder and its subfolders; for a scene file, the file itself."""
    inside = path.rglob("*") if path.is_dir() else [path]
    return sorted(p for p in inside if p.suffix.lower() in known and p.is_file())


def check_scenes(
    paths: Sequence[Path], settings: CheckSettings, bake_settings: BakeSettings, progress: Progress = silent
) -> tuple[list[CheckReport], list[Unreadable]]:
    """Check scene files one after the other.

    With more than one file, an unreadable file is returned as `Unreadable`, and the other files are checked.
    A single unreadable file raises.

    Parameters
    ----------
    paths : sequence of Path
        Scene files.
    settings : CheckSettings
        Settings of the check, the same for all scenes.
    bake_settings : BakeSettings
        Settings of the bakes that the scenes are checked for.
    progress : Progress
        Called with the stage "checks" and, for each scene, fractions from 0 to 1.

    Returns
    -------
    reports : list of CheckReport
        One for each scene that could be read.
    unreadable : list of Unreadable
        One for each scene that could not be read.

    Raises
    ------
    InputError
        If `paths` has one element, and the file cannot be read.
    SettingsError
        If `ignore` has an unknown code, `rates` is not the folder of a bake, or a scene's extras have wrong
        values.
    """
    parse_ignore(settings.ignore)
    reports, unreadable = [], []
    for path in paths:
        try:
            reports.append(check_scene(path, settings, bake_settings, progress))
        except InputError as error:
            if len(paths) == 1:
                raise
            unreadable.append(Unreadable(path, error))
    return reports, unreadable
