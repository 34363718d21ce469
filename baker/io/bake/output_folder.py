"""Atomic replacement of an output folder: it holds either the old bake or the new one.

All files are written to a temporary folder beside the output folder, which replaces it by renaming at the
end. Renames are recorded in a journal and undone after an error. Where the output folder itself cannot be
renamed (a mount point, the current folder) its files are exchanged one by one with the same journal.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
from collections.abc import Iterable
from pathlib import Path
from types import TracebackType

from baker.core.errors import ResourceError, SettingsError
from baker.io.temporary import Temporary, old_path, temporary_path

MANIFEST_NAME = "bake.json"
AS_BAKED = "as baked"
# Components without separators and drive letters, none of them "." or "..".
_FILE_NAME = re.compile(r"(?!\.{1,2}(/|$))[^/\\:]+(/(?!\.{1,2}(/|$))[^/\\:]+)*")


def check_out(out: Path, *, force: bool = False, scene_path: Path | None = None) -> None:
    """Check, before the long work, that a bake may be written to a folder.

    Parameters
    ----------
    out : Path
        The output folder; neither it nor its parents need to exist.
    force : bool
        Accept a folder with files that baker did not write (they are kept).
    scene_path : Path or None
        The input, which must not be among the replaced files.

    Raises
    ------
    SettingsError
        If `out` is a file, a folder that baker did not write, or holds the input.
    ResourceError
        If nothing can be written there.
    """
    folder = out.resolve()
    if not folder.name:
        raise SettingsError("this is the root of the file system; name a folder in it", file=str(out))
    if folder.exists() and not folder.is_dir():
        raise SettingsError("the output is a file; name a folder", file=str(out))
    parent = next(path for path in folder.parents if path.exists())
    if not parent.is_dir():
        raise SettingsError(f"'{parent}' is a file; the output cannot lie in it", file=str(out))
    if not folder.exists():
        _check_writable(parent, out)
        return
    try:
        _check_writable(folder, out)
        ours = own_files(folder)
        if ours is None and not force and any(folder.iterdir()):
            message = "the folder holds files that baker did not write; name another one, or add `force=True`"
            raise SettingsError(f"{message} (they are kept)", file=str(out))
    except OSError as error:
        raise ResourceError(f"the folder cannot be read ({error.strerror})", file=str(out)) from None
    if scene_path is not None and scene_path.resolve().is_relative_to(folder):
        name = scene_path.resolve().relative_to(folder).as_posix()
        if name == "scene.glb" or name in (ours or ()):
            message = f"the bake would replace its own input '{name}'; name another output folder"
            raise SettingsError(message, file=str(out))


def own_files(folder: Path) -> set[str] | None:
    """List the files of a bake.

    Parameters
    ----------
    folder : Path
        An output folder.

    Returns
    -------
    set of str or None
        Paths relative to the folder; None if it has no manifest of baker. A manifest that names a file
        outside of the folder, by its path or through a link, is not accepted.
    """
    try:
        manifest = json.loads((folder / MANIFEST_NAME).read_text("utf-8"))
        names = {MANIFEST_NAME, *(entry["file"] for entry in manifest["files"])}
        known = isinstance(manifest["versions"]["baker"], str)
        return names if known and all(_lies_inside(folder, name) for name in names) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _lies_inside(folder: Path, name: object) -> bool:
    """Return whether a name with forward slashes is of a file below `folder`, no parent of it a link."""
    if not isinstance(name, str) or not name.isprintable() or not _FILE_NAME.fullmatch(name):
        return False
    parents = name.split("/")[:-1]
    return not any(folder.joinpath(*parents[: n + 1]).is_symlink() for n in range(len(parents)))


def is_file(path: Path) -> bool:
    """Return whether a file exists; False for a name that is too long for any."""
    try:
        return path.is_file()
    except OSError:
        return False


def file_state(path: Path, sha256: str) -> str:
    """Compare a file of a bake with the hash in its manifest.

    Parameters
    ----------
    path : Path
        The file.
    sha256 : str
        Its hash in the manifest.

    Returns
    -------
    str
        "as baked", "changed" or "missing".
    """
    if not is_file(path):
        return "missing"
    with path.open("rb") as file:
        return AS_BAKED if hashlib.file_digest(file, "sha256").hexdigest() == sha256 else "changed"


class OutputFolder:
    """A temporary folder, `path`, for the files of a bake, which `commit` moves to the output folder.

    Use it as a context manager: leaving it without `commit` removes the temporary folder. `abort` may be
    called more than once.

    Parameters
    ----------
    out : Path
        The output folder; see `check_out`.

    Attributes
    ----------
    path : Path
        The temporary folder to write into.
    """

    def __init__(self, out: Path) -> None:
        self.out = out.resolve()
        self._in_place = self.out.is_dir() and _cannot_move(self.out)
        self.path = temporary_path(self.out, inside=self._in_place)
        self._aside = old_path(self.path)
        self._journal: list[tuple[Path, Path]] = []
        self._made: list[Path] = []

    def __enter__(self) -> OutputFolder:
        """Create the temporary folder, and the parents of the output folder."""
        try:
            for parent in reversed([p for p in self.path.parents if not p.exists()]):
                parent.mkdir()
                self._made.append(parent)
            self.path.mkdir()
        except BaseException:
            self.abort()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove the temporary folder if it was not committed."""
        self.abort()

    def commit(self) -> None:
        """Replace the old files by the new ones; files that baker did not write are kept.

        Raises
        ------
        OSError
            If a file cannot be moved; the old folder is unchanged.
        """
        try:
            if self._in_place:
                self._exchange_files()
            else:
                self._exchange_folders()
        except BaseException:
            self.abort()
            raise
        self._journal.clear()
        self._made.clear()
        for leftover in (self._aside, self.path):
            shutil.rmtree(leftover, ignore_errors=True)

    def abort(self) -> None:
        """Restore the old folder, and remove all temporary files."""
        while self._journal:
            source, target = self._journal[-1]
            if os.path.lexists(target) and not os.path.lexists(source):
                target.rename(source)
            self._journal.pop()
        for leftover in (self._aside, self.path):
            shutil.rmtree(leftover, ignore_errors=True)
        while self._made:
            try:
                self._made.pop().rmdir()
            except OSError:
                # Another process has created files there.
                self._made.clear()

    def _exchange_folders(self) -> None:
        if self.out.exists():
            _carry_over(self.out, self.path, own_files(self.out) or set())
            shutil.copymode(self.out, self.path)
            self._rename(self.out, self._aside)
        self._rename(self.path, self.out)

    def _exchange_files(self) -> None:
        new = sorted(p.relative_to(self.path) for p in self.path.rglob("*") if p.is_file())
        old = {Path(name) for name in own_files(self.out) or ()} | set(new)
        # Move the old manifest first and the new one last: a folder with a manifest is complete.
        for name in sorted(old, key=lambda n: (n.as_posix() != MANIFEST_NAME, n)):
            if (self.out / name).exists():
                (self._aside / name).parent.mkdir(parents=True, exist_ok=True)
                self._rename(self.out / name, self._aside / name)
        for name in sorted(new, key=lambda n: (n.as_posix() == MANIFEST_NAME, n)):
            (self.out / name).parent.mkdir(parents=True, exist_ok=True)
            self._rename(self.path / name, self.out / name)

    def _rename(self, source: Path, target: Path) -> None:
        # Record the rename before it is done, so that an interruption in between is undone as well.
        self._journal.append((source, target))
        try:
            source.rename(target)
        except OSError:
            self._journal.pop()
            raise


def remove_leftovers(out: Path, left: Iterable[Temporary]) -> None:
    """Restore the old files after a process was killed while it wrote, and remove its temporary folders.

    Parameters
    ----------
    out : Path
        The output folder or file of the process.
    left : iterable of Temporary
        Its temporary folders, from `temporaries`.
    """
    target, left = out.resolve(), list(left)
    for temporary in left:
        if temporary.old:
            _put_back(temporary.path, target)
    for temporary in left:
        shutil.rmtree(temporary.path, ignore_errors=True)


def _put_back(aside: Path, target: Path) -> None:
    """Move the old files from the folder `aside` back to the output folder."""
    if aside.parent != target:
        if not target.exists():
            aside.rename(target)
    elif not (target / MANIFEST_NAME).exists():
        # The manifest is moved last: without it the new files are incomplete.
        for path in sorted(path for path in aside.rglob("*") if path.is_file()):
            name = path.relative_to(aside).as_posix()
            if _lies_inside(target, name):
                path.replace(target / name)


def _cannot_move(folder: Path) -> bool:
    """Return whether a folder cannot be renamed: mounted, in a read-only parent, or the current folder."""
    if os.path.ismount(folder) or not os.access(folder.parent, os.W_OK | os.X_OK):
        return True
    try:
        return Path.cwd().is_relative_to(folder)
    except OSError:
        # The current folder no longer exists.
        return False


def _check_writable(folder: Path, out: Path) -> None:
    if not os.access(folder, os.W_OK | os.X_OK):
        raise ResourceError(
            f"nothing can be written to '{folder}'; name another output folder", file=str(out)
        )


def _carry_over(old: Path, new: Path, own: set[str], prefix: str = "") -> None:
    """Link or copy the files that are not baker's from the old folder to the new one."""
    for entry in sorted(os.scandir(old), key=lambda e: e.name):
        name, target = prefix + entry.name, new / entry.name
        if name in own or (os.path.lexists(target) and not entry.is_dir(follow_symlinks=False)):
            continue
        if entry.is_dir(follow_symlinks=False):
            was_empty = not any(Path(entry.path).iterdir())
            target.mkdir(exist_ok=True)
            _carry_over(Path(entry.path), target, own, f"{name}/")
            if not was_empty and not any(target.iterdir()):
                target.rmdir()
            else:
                shutil.copystat(entry.path, target)
        else:
            try:
                os.link(entry.path, target, follow_symlinks=False)
            except OSError:
                # Not every file system has hard links.
                shutil.copy2(entry.path, target, follow_symlinks=False)
