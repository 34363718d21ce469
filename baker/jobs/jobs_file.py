"""Reads a job file (TOML): scenes, their output folders and their settings.

    [defaults]             keys: `out` and the settings of a bake
    [[job]]                keys: `scene` or `glob`, `out` and the settings of a bake

Relative paths refer to the folder of the job file, so that the folder can be moved with its scenes.
"""

from __future__ import annotations

import os
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baker.core.errors import InputError, SettingsError
from baker.core.names import unknown_name, unknown_setting
from baker.core.settings import BakeSettings, make_settings
from baker.io.bake.output_folder import own_files
from baker.io.toml_file import read_toml

_TABLES = ("defaults", "job")
_WILD = re.compile(r"[*?\[]")


@dataclass(frozen=True)
class Job:
    """A scene to bake and its output folder.

    Attributes
    ----------
    scene : Path
        The scene file, or a pattern that matched no scene file.
    out : Path or None
        The output folder; None if `scene` is a pattern.
    settings : BakeSettings
    problem : str
        Why the job cannot be started; empty if it can.
    """

    scene: Path
    out: Path | None
    settings: BakeSettings
    problem: str = ""


def read_jobs(path: Path, overrides: dict[str, Any]) -> list[Job]:
    """Return the jobs of a file, in the order of the file. Scenes that match a pattern are sorted by path.

    Parameters
    ----------
    path : Path
        The job file.
    overrides : dict
        Settings from the command line; they override the settings of every job.

    Returns
    -------
    list of Job
        The jobs.

    Raises
    ------
    InputError
        If the file is missing or unreadable.
    SettingsError
        If the file is not TOML, has no job, has a missing, unknown or invalid key, gives two jobs the same
        output folder, or puts one output folder inside another.
    """
    document = _parse(path)
    defaults = document.get("defaults", {})
    tables = document.get("job", [])
    for name in document:
        if name not in _TABLES:
            raise unknown_name("table", name, _TABLES, file=str(path), object=name)
    if not isinstance(defaults, dict):
        raise _error(path, "defaults", "it must be a table, written [defaults]")
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise _error(path, "job", "jobs must be tables, each written [[job]]")
    if not tables:
        raise _error(path, "job", "there are no jobs; write [[job]] with scene and out for each")
    _check_keys(path, "defaults", defaults, ("out",))
    jobs: list[Job] = []
    for number, table in enumerate(tables, 1):
        where = f"job {number}"
        _check_keys(path, where, table, ("scene", "glob", "out"))
        jobs += _expand(path, where, {**defaults, **table}, overrides)
    _check_outputs(path, jobs)
    return jobs


def _parse(path: Path) -> dict[str, Any]:
    try:
        return read_toml(path, "the list of jobs")
    except OSError as error:
        why = "there is no such file" if isinstance(error, FileNotFoundError) else error.strerror
        raise InputError(f"the list of jobs cannot be read: {why}", file=str(path)) from None


def _check_keys(path: Path, where: str, table: dict[str, Any], own: tuple[str, ...]) -> None:
    known = [*own, *BakeSettings.model_fields]
    seen: set[str] = set()
    for key in table:
        name = key.replace("-", "_")
        if name not in known:
            raise unknown_setting("setting", key, known, file=str(path), object=where)
        if name in seen:
            raise _error(path, where, f"'{key}' is given twice")
        seen.add(name)


def _expand(path: Path, where: str, table: dict[str, Any], overrides: dict[str, Any]) -> list[Job]:
    """Return the jobs of one `[[job]]` table, one for each scene and for each pattern without a match."""
    values = {key.replace("-", "_"): value for key, value in table.items()}
    given = {key: _words(path, where, key, values.pop(key)) for key in ("scene", "glob") if key in values}
    if len(given) != 1:
        raise _error(path, where, "name either a scene or a glob" + (", not both" if given else ""))
    pattern = values.pop("out", None)
    if not isinstance(pattern, str) or not pattern:
        raise _error(path, where, 'out is missing; write out = "baked/{stem}", here or in [defaults]')
    _check_path(path, where, "out", pattern)
    try:
        settings = make_settings(values)
        settings = make_settings({**values, **overrides})
    except SettingsError as error:
        raise _error(path, where, error.message) from None
    jobs = []
    for word in next(iter(given.values())):
        if "scene" in given and (not _WILD.search(word) or (path.parent / word).is_file()):
            scenes = [path.parent / word]
        else:
            scenes = _find(path, where, word)
        for scene in scenes:
            jobs.append(Job(scene, _output(path, where, pattern, scene), settings))
        if not scenes:
            problem = "no scene file matches; check the pattern, which begins at the folder of the job file"
            jobs.append(Job(path.parent / word, None, settings, problem))
    return jobs


def _words(path: Path, where: str, key: str, value: Any) -> list[str]:
    words = value if isinstance(value, list) else [value]
    if not words or not all(isinstance(word, str) and word for word in words):
        raise _error(path, where, f"{key} must be a path in quotes, or a list of them")
    for word in words:
        _check_path(path, where, key, word)
    return words


def _check_path(path: Path, where: str, key: str, word: str) -> None:
    if "\0" in word:
        raise _error(path, where, f"{key} contains a NUL character, which no path can have")


def _find(path: Path, where: str, pattern: str) -> list[Path]:
    """Return the scene files that match a pattern, without hidden files and files that bakes have written."""
    import glob

    from baker.io.load import IMPORTERS

    base = path.parent
    found = []
    # Path.glob does not fit: it accepts no absolute pattern, and finds hidden files.
    for name in sorted(glob.glob(pattern, root_dir=base, recursive=True)):  # noqa: PTH207
        scene = base / name
        if not scene.is_file() or scene.suffix.lower() not in IMPORTERS.names():
            continue
        if not _written_by_a_bake(scene, base):
            found.append(scene)
    return found


def _written_by_a_bake(scene: Path, base: Path) -> bool:
    # A pattern such as `**/*.glb` must not match the `scene.glb` in the output folders of earlier bakes.
    for folder in scene.parents:
        if (folder / "bake.json").is_file():
            own = own_files(folder)
            if own is not None and scene.relative_to(folder).as_posix() in own:
                return True
        if folder == base:
            break
    return False


def _output(path: Path, where: str, pattern: str, scene: Path) -> Path:
    """Return `pattern` with `{stem}` replaced by the scene's file name, `{parent}` by its folder's name."""
    words = {"stem": scene.stem, "parent": scene.resolve().parent.name}

    def put(match: re.Match[str]) -> str:
        name = match.group(1)
        if name not in words:
            raise unknown_name("placeholder of out", name, words, file=str(path), object=where)
        return words[name]

    return path.parent / re.sub(r"\{([^{}]*)\}", put, pattern)


def _check_outputs(path: Path, jobs: list[Job]) -> None:
    """Raise if two jobs have the same output folder, or if an output folder is inside another."""
    owner: dict[str, Job] = {}
    for job in jobs:
        if job.out is None:
            continue
        folder = os.path.normcase(job.out.resolve())
        if folder in owner:
            raise SettingsError(
                f"'{owner[folder].scene}' and '{job.scene}' would both be baked into '{job.out}'; "
                "give them different folders, for example with {parent} or {stem} in out",
                file=str(path),
            )
        owner[folder] = job
    for folder, job in owner.items():
        for parent in Path(folder).parents:
            other = owner.get(str(parent))
            if other is not None:
                raise SettingsError(
                    f"the output '{job.out}' lies inside '{other.out}', which is an output too; move one",
                    file=str(path),
                )


def _error(path: Path, where: str, message: str) -> SettingsError:
    return SettingsError(message, file=str(path), object=where)
