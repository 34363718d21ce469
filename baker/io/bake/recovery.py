"""Exchanges the files of an output folder one by one, and undoes an exchange that was interrupted.

Output folders that cannot be exchanged as a whole are replaced in this way. Before the first file is moved,
the exchange is recorded in a journal in the temporary folder. The new manifest is moved last. If the process
is killed before the move of the manifest, `recover` in a later command restores the old files. After this
move, the new bake is complete.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import re
import shutil
from collections.abc import Collection, Iterable
from pathlib import Path

from baker.io.bake.lock import OutputLock
from baker.io.temporary import claim, temporaries

MANIFEST_NAME = "bake.json"
# Names in a temporary folder: folder of the new files, folder of the old files during the exchange, journal.
NEW, OLD, JOURNAL = "new", "old", "journal.json"
# A relative path with forward slashes. No component is "." or "..", and none contains a backslash or a colon.
_FILE_NAME = re.compile(r"(?!\.{1,2}(/|$))[^/\\:]+(/(?!\.{1,2}(/|$))[^/\\:]+)*")


def lies_inside(folder: Path, name: object) -> bool:
    """Return whether `name` is a printable path inside `folder` and none of its folders is a symbolic link.

    Parameters
    ----------
    folder : Path
        The folder.
    name : object
        A value from a file, such as a manifest; anything but a relative path is refused.

    Returns
    -------
    bool
        True if `name` can be used as a path relative to `folder`.
    """
    if not isinstance(name, str) or not name.isprintable() or not _FILE_NAME.fullmatch(name):
        return False
    parents = name.split("/")[:-1]
    return not any(folder.joinpath(*parents[: n + 1]).is_symlink() for n in range(len(parents)))


def exchange_files(home: Path, out: Path, old: Collection[str], new: Collection[str]) -> None:
    """Replace the files `old` of an output folder, and files named like a new file, by the files `new`.

    Parameters
    ----------
    home : Path
        The temporary folder, on the same file system as `out`. The new files are in its subfolder `NEW`.
    out : Path
        The output folder.
    old, new : collection of str
        Paths of files: `old` relative to `out`, `new` relative to the folder `NEW`. One of the new files is
        the manifest.

    Raises
    ------
    OSError
        If a file cannot be moved, or a folder has the name of a file. The caller then calls `undo`.
    """
    leaving = [name for name in _manifest_first({*old, *new}) if os.path.lexists(out / name)]
    for name in leaving:
        if (out / name).is_dir() and not (out / name).is_symlink():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(out / name))
    coming = _manifest_first(new)[::-1]
    folders = [path for path in _parents(coming) if not os.path.lexists(out / path)]
    record = json.dumps({"old": leaving, "new": coming, "folders": folders})
    (home / "journal.tmp").write_text(record, "utf-8")
    (home / "journal.tmp").rename(home / JOURNAL)
    for name in leaving:
        _move(out / name, home / OLD / name)
    for name in coming:
        _move(home / NEW / name, out / name)
    for path in reversed(_parents(leaving)):
        with contextlib.suppress(OSError):  # the folder contains other files
            (out / path).rmdir()


def undo(home: Path, out: Path) -> None:
    """Undo an interrupted exchange, or do nothing if it is complete. `undo` can itself be called again.

    Parameters
    ----------
    home : Path
        The temporary folder.
    out : Path
        The output folder.

    Raises
    ------
    OSError
        If a file cannot be moved back (call `undo` again later), or if the journal is damaged.
    """
    journal = _journal(home, out)
    new = journal["new"]
    if not new or not os.path.lexists(home / NEW / new[-1]):
        return
    for name in reversed(new):
        # All new files were in `home` when the journal was written, so this file of `out` is a new one.
        if os.path.lexists(out / name) and not os.path.lexists(home / NEW / name):
            _move(out / name, home / NEW / name)
    for name in reversed(journal["old"]):
        if os.path.lexists(home / OLD / name):
            _move(home / OLD / name, out / name)
    for name in reversed(journal["folders"]):
        with contextlib.suppress(OSError):
            (out / name).rmdir()
    # After the journal is deleted, only the removal of `home` remains to be done.
    (home / JOURNAL).unlink()


def recover(out: Path) -> None:
    """Undo the incomplete exchanges of killed processes for an output, and remove their temporary folders.

    Every command that reads or writes an output folder calls `recover` first. A lock file that no process
    holds is removed as well. If files cannot be moved or removed, they are left unchanged, without an error.

    Parameters
    ----------
    out : Path
        The output folder or file, which need not exist.
    """
    try:
        target = Path(os.path.realpath(out))
    except ValueError:
        return  # the name contains a zero byte, so no file can have it
    found = temporaries(target)
    for temporary in found:
        with claim(temporary) as free:
            if free:
                with contextlib.suppress(OSError):
                    undo(temporary.path, target)
                    shutil.rmtree(temporary.path, ignore_errors=True)
    with contextlib.suppress(OSError):
        lock = OutputLock(target)
        if lock.path.exists() and lock.acquire():
            lock.release()


def abandoned(out: Path) -> bool:
    """Return whether a killed process has left a temporary folder for an output.

    Parameters
    ----------
    out : Path
        The output folder or file.

    Returns
    -------
    bool
        True if such a folder exists.
    """
    for found in temporaries(out):
        with claim(found) as free:
            if free:
                return True
    return False


def _journal(home: Path, out: Path) -> dict[str, list[str]]:
    """Return the three lists of a journal, empty if there is none; raise OSError if it is invalid."""
    try:
        record = json.loads((home / JOURNAL).read_text("utf-8"))
        parts = {part: list(record[part]) for part in ("old", "new", "folders")}
    except FileNotFoundError:
        return {"old": [], "new": [], "folders": []}
    except (ValueError, KeyError, TypeError, RecursionError):
        raise OSError(errno.EINVAL, "the journal is damaged", str(home / JOURNAL)) from None
    if not all(lies_inside(out, name) for names in parts.values() for name in names):
        raise OSError(errno.EINVAL, "the journal names a file outside", str(home / JOURNAL))
    return parts


def _move(source: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    source.replace(target)


def _manifest_first(names: Iterable[str]) -> list[str]:
    return sorted(names, key=lambda name: (name != MANIFEST_NAME, name))


def _parents(names: Iterable[str]) -> list[str]:
    """Return all parent folders of relative paths, each once, parents before their children."""
    found = {path.as_posix() for name in names for path in Path(name).parents}
    return sorted(found - {"."}, key=lambda path: (path.count("/"), path))
