"""Scene files of paths, folders and patterns, checked one after the other."""

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
    """A scene of several that could not be read."""

    path: Path
    error: InputError


def find_scenes(paths: Sequence[Path]) -> list[Path]:
    """Return the scene files of paths, folders and patterns, each once.

    Parameters
    ----------
    paths : sequence of Path
        Files; folders, of which all scenes below are taken; patterns with `*`, `?` or `[`.

    Returns
    -------
    list of Path
        In the order of `paths`, those of a folder or pattern sorted.

    Raises
    ------
    InputError
        For a folder or a pattern without any scene file.
    """
    known = set(IMPORTERS.names())
    found: dict[Path, None] = {}
    for path in paths:
        if path.is_dir():
            inside = sorted(p for p in path.rglob("*") if p.suffix.lower() in known and p.is_file())
            if not inside:
                raise InputError(f"there is no scene file ({', '.join(sorted(known))}) below", file=str(path))
            found.update(dict.fromkeys(inside))
        elif not path.exists() and glob.has_magic(str(path)):
            # Expand patterns for shells that do not.
            root = Path(path.anchor)
            matches = sorted(root.glob(str(path.relative_to(root))))
            if not matches:
                raise InputError("no file has a name like this", file=str(path))
            found.update(dict.fromkeys(matches))
        else:
            found[path] = None
    return list(found)


def check_scenes(
    paths: Sequence[Path], settings: CheckSettings, bake_settings: BakeSettings, progress: Progress = silent
) -> tuple[list[CheckReport], list[Unreadable]]:
    """Check scenes; if there are several, unreadable ones are returned and the others are checked.

    Parameters
    ----------
    paths : sequence of Path
        Scene files.
    settings : CheckSettings
        Severity that fails the check, and findings to ignore.
    bake_settings : BakeSettings
        Settings of the bake that the scenes are meant for.
    progress : Progress
        Called with the stage "checks" and fractions from 0 to 1 for each scene.

    Returns
    -------
    reports : list of CheckReport
        One for each scene that could be read.
    unreadable : list of Unreadable
        The others.

    Raises
    ------
    InputError
        If the only scene cannot be read.
    SettingsError
        For an unknown code among `ignore`.
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
