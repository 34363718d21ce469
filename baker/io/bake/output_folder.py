"""Replaces an output folder as a whole: after an error it contains the complete old bake.

All files are written to a temporary folder beside the output folder. At the end, the temporary folder is
renamed to the output folder. If the output folder exists, the file system exchanges the two folders in one
atomic step. In two cases the files are moved one by one instead: if the output folder cannot be renamed (see
`baker.io.bake.mounts`), or if the file system does not support the exchange. In the first case, the temporary
folder is inside the output folder. A journal records these moves. If the process is killed before the last
move, `baker.io.bake.recovery` undoes the moves.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import shutil
from pathlib import Path
from types import TracebackType

from baker.core.errors import ResourceError, SettingsError
from baker.io.bake.mounts import cannot_move
from baker.io.bake.recovery import MANIFEST_NAME, NEW, exchange_files, lies_inside, recover, undo
from baker.io.exchange import exchange_paths
from baker.io.output_path import resolved_output
from baker.io.regular_file import read_regular
from baker.io.temporary import TemporaryFolder

__all__ = ["MANIFEST_NAME", "OutputFolder", "check_out", "file_state", "is_file", "own_files"]

AS_BAKED = "as baked"


def check_out(out: Path, *, force: bool = False, scene_path: Path | None = None) -> None:
    """Check that a bake may be written to a folder; call it before the bake starts.

    Parameters
    ----------
    out : Path
        The output folder; neither it nor its parents need to exist.
    force : bool
        Accept a folder that contains files but no bake. These files are kept, unless the bake writes a file
        of the same name.
    scene_path : Path or None
        The input scene file; it is an error if the bake would replace it.

    Raises
    ------
    SettingsError
        If `out` is the root of the file system, is a file or lies in one, or is refused by `resolved_output`.
        If `out` contains files but no bake, and `force` is False. If the bake would replace the input.
    ResourceError
        If the folder cannot be read or written to.
    """
    folder = resolved_output(out)
    if not folder.name:
        raise SettingsError("this is the root of the file system; name a folder in it", file=str(out))
    if folder.exists() and not folder.is_dir():
        raise SettingsError("the output is a file; name a folder", file=str(out))
    parent = next(path for path in folder.parents if path.exists())
    if not parent.is_dir():
        raise SettingsError(f"'{parent}' is a file; the output cannot lie in it", file=str(out))
    recover(folder)
    _check_writable(folder, parent, out)
    if not folder.exists():
        return
    try:
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
    """Return the paths of the manifest in a folder and of the files that the manifest lists.

    Parameters
    ----------
    folder : Path
        An output folder.

    Returns
    -------
    set of str or None
        Paths relative to the folder. None if the folder has no readable manifest of baker, or if
        `lies_inside` refuses one of the paths.
    """
    try:
        manifest = json.loads(read_regular(folder / MANIFEST_NAME))
        names = {MANIFEST_NAME, *(entry["file"] for entry in manifest["files"])}
        known = isinstance(manifest["versions"]["baker"], str)
        return names if known and all(lies_inside(folder, name) for name in names) else None
    except (OSError, ValueError, KeyError, TypeError, RecursionError):
        return None


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
        self.out = Path(os.path.realpath(out))
        self._in_place = self.out.is_dir() and cannot_move(self.out)
        self._home = TemporaryFolder(self.out, inside=self._in_place)
        self._made: list[Path] = []

    @property
    def path(self) -> Path:
        """Return the folder to write into."""
        return self._home.path / NEW

    def __enter__(self) -> OutputFolder:
        """Create the temporary folder, and the parents of the output folder."""
        try:
            for parent in reversed([p for p in self._home.path.parents if not p.exists()]):
                parent.mkdir()
                self._made.append(parent)
            self._home.create()
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
        """Replace the old files by the new ones.

        Files that baker did not write are kept, unless a new file has the same name.

        Raises
        ------
        OSError
            If a file cannot be copied or moved; the old files are then restored.
        """
        try:
            if not self.out.exists():
                self.path.rename(self.out)
            else:
                self._replace()
        except BaseException:
            self.abort()
            raise
        self._made.clear()
        self._home.remove()

    def abort(self) -> None:
        """Restore the old files, and remove all temporary files and the parent folders that were created."""
        try:
            undo(self._home.path, self.out)
        except OSError:
            # A file cannot be moved back: keep the temporary folder, so that a later command can try again.
            self._home.leave()
            raise
        self._home.remove()
        while self._made:
            try:
                self._made.pop().rmdir()
            except OSError:
                # Another process has created files in this folder, so its parents are not empty either.
                self._made.clear()

    def _replace(self) -> None:
        new = [p.relative_to(self.path).as_posix() for p in self.path.rglob("*") if p.is_file()]
        own = own_files(self.out) or set()
        if not self._in_place:
            _carry_over(self.out, self.path, own)
            shutil.copymode(self.out, self.path)
            if exchange_paths(self.path, self.out):
                return
        exchange_files(self._home.path, self.out, own, new)


def _check_writable(folder: Path, parent: Path, out: Path) -> None:
    """Raise if the temporary folder of a bake cannot be created; `parent` is the nearest existing parent."""
    where = folder if folder.is_dir() else parent
    probe = TemporaryFolder(parent / folder.name)
    try:
        if folder.is_dir():
            probe = TemporaryFolder(folder, inside=cannot_move(folder))
        if not os.access(where, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        probe.create()
    except OSError as error:
        message = f"nothing can be written to '{where}' ({error.strerror}); name another output folder"
        raise ResourceError(message, file=str(out)) from None
    finally:
        probe.remove()


def _carry_over(old: Path, new: Path, own: set[str], prefix: str = "") -> None:
    """Hard-link or copy files from `old` to `new`, except those in `own` and those that `new` has already."""
    for entry in sorted(os.scandir(old), key=lambda e: e.name):
        name, target = prefix + entry.name, new / entry.name
        is_folder = entry.is_dir(follow_symlinks=False)
        if name in own:
            continue
        if os.path.lexists(target) and not is_folder:
            if target.is_dir():
                raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST), entry.path)
            continue
        if is_folder:
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
