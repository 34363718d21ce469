"""Replaces an output folder as a whole: after an error it contains the complete old bake.

All files are first written to a temporary folder beside the output folder. At the end, the temporary folder
is renamed to the name of the output folder. Renames are recorded in a journal and undone after an error. If
the output folder itself cannot be renamed (a mount point, the current folder), its files are exchanged one by
one, with the same journal.
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
# Relative path with forward slashes. No component is "." or "..", or contains a backslash or a colon.
_FILE_NAME = re.compile(r"(?!\.{1,2}(/|$))[^/\\:]+(/(?!\.{1,2}(/|$))[^/\\:]+)*")


def check_out(out: Path, *, force: bool = False, scene_path: Path | None = None) -> None:
    """Check that a bake may be written to a folder; call it before the bake starts.

    Parameters
    ----------
    out : Path
        The output folder; neither it nor its parents need to exist.
    force : bool
        Accept a folder with files that baker did not write (they are kept).
    scene_path : Path or None
        The input scene file; it is an error if the bake would replace it.

    Raises
    ------
    SettingsError
        If `out` is a file, if it contains files that baker did not write and `force` is False, or if the bake
        would replace the input.
    ResourceError
        If the folder cannot be read or written to.
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
    """Return the files that the manifest in a folder lists, and the manifest itself.

    Parameters
    ----------
    folder : Path
        An output folder.

    Returns
    -------
    set of str or None
        Paths relative to the folder. None if the folder has no manifest of baker, or if the manifest names a
        file outside the folder, by its path or through a symbolic link.
    """
    try:
        manifest = json.loads((folder / MANIFEST_NAME).read_text("utf-8"))
        names = {MANIFEST_NAME, *(entry["file"] for entry in manifest["files"])}
        known = isinstance(manifest["versions"]["baker"], str)
        return names if known and all(_lies_inside(folder, name) for name in names) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


def _lies_inside(folder: Path, name: object) -> bool:
    """Return whether `name` is a path inside `folder` and none of its parent folders is a symbolic link."""
    if not isinstance(name, str) or not name.isprintable() or not _FILE_NAME.fullmatch(name):
        return False
    parents = name.split("/")[:-1]
    return not any(folder.joinpath(*parents[: n + 1]).is_symlink() for n in range(len(parents)))


def is_file(path: Path) -> bool:
    """Return whether a file exists; False also if the name is too long for the file system."""
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
        The file's SHA-256 in the manifest.

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
    """A temporary folder for the files of a bake; `commit` moves the files to the output folder.

    Use it as a context manager. If the `with` block ends without `commit`, the temporary folder is removed.
    `abort` may be called more than once.

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
            If a file cannot be moved; the old files are then restored.
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
        # Move the old manifest first and the new one last, so that a folder with a manifest is complete.
        for name in sorted(old, key=lambda n: (n.as_posix() != MANIFEST_NAME, n)):
            if (self.out / name).exists():
                (self._aside / name).parent.mkdir(parents=True, exist_ok=True)
                self._rename(self.out / name, self._aside / name)
        for name in sorted(new, key=lambda n: (n.as_posix() == MANIFEST_NAME, n)):
            (self.out / name).parent.mkdir(parents=True, exist_ok=True)
            self._rename(self.path / name, self.out / name)

    def _rename(self, source: Path, target: Path) -> None:
        # Record the rename first, so that `abort` also undoes it after an interruption.
        self._journal.append((source, target))
        try:
            source.rename(target)
        except OSError:
            self._journal.pop()
            raise


def remove_leftovers(out: Path, left: Iterable[Temporary]) -> None:
    """After a process was killed while writing, restore the old files and remove its temporary folders.

    Parameters
    ----------
    out : Path
        The output folder or file of the process.
    left : iterable of Temporary
        The temporary folders of the process, as `temporaries` returns them.
    """
    target, left = out.resolve(), list(left)
    for temporary in left:
        if temporary.old:
            _put_back(temporary.path, target)
    for temporary in left:
        shutil.rmtree(temporary.path, ignore_errors=True)


def _put_back(aside: Path, target: Path) -> None:
    """Move the old files from the folder `aside` back to the output folder `target`."""
    if aside.parent != target:
        if not target.exists():
            aside.rename(target)
    elif not (target / MANIFEST_NAME).exists():
        # The new manifest is moved in last, so without a manifest the new files are incomplete.
        for path in sorted(path for path in aside.rglob("*") if path.is_file()):
            name = path.relative_to(aside).as_posix()
            if _lies_inside(target, name):
                path.replace(target / name)


def _cannot_move(folder: Path) -> bool:
    """Return whether a folder is a mount point, is in a read-only folder, or contains the current one."""
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
    """Hard-link or copy all files that are not in `own` from the folder `old` to the folder `new`."""
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
