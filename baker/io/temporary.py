"""Creates and finds the temporary folders that output is written to before it is moved to its final path.

The temporary folder for an output `out` is `.{out.name}.baker-{process}-{random hex digits}` beside `out`,
where `process` is the id of the process that creates it. If `out` is a folder that cannot be moved, it is
`.baker-{process}-{random hex digits}` inside `out`. The process holds a lock on the temporary folder. If a
temporary folder is not locked, a killed process has left it, even if a new process has the same id. On file
systems without locks, a killed process has left the folder if no process with this id exists.
"""

from __future__ import annotations

import contextlib
import os
import re
import secrets
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from baker.core.errors import ResourceError
from baker.io.file_lock import is_alive, is_at, try_lock

_NAME = re.compile(r"\.baker-(\d+)-[0-9a-f]+")


@dataclass(frozen=True)
class Temporary:
    """A temporary folder that exists.

    Attributes
    ----------
    path : Path
    process : int
        Id of the process that created it.
    """

    path: Path
    process: int


class TemporaryFolder:
    """A temporary folder of this process, locked until its removal if the file system supports locks.

    Parameters
    ----------
    out : Path
        The output folder or file; an absolute path.
    inside : bool
        Create the folder in `out` instead of beside `out`.

    Attributes
    ----------
    path : Path
    """

    def __init__(self, out: Path, *, inside: bool = False) -> None:
        self._out, self._inside = out, inside
        self._lock: int | None = None
        self.path = temporary_path(out, inside=inside)

    def create(self) -> None:
        """Create the folder.

        Raises
        ------
        OSError
            If the folder cannot be created.
        """
        while True:
            self.path.mkdir()
            try:
                self._lock = os.open(self.path, os.O_RDONLY)
                if try_lock(self._lock) and is_at(self._lock, self.path):
                    return
            except FileNotFoundError:
                # Another process has removed the folder, because it was not locked yet.
                pass
            except OSError:
                # The file system cannot lock folders: other processes check the process id in the folder's
                # name instead.
                return
            self.leave()
            self.path = temporary_path(self._out, inside=self._inside)

    def remove(self) -> None:
        """Remove the folder and its content; may be called more than once."""
        shutil.rmtree(self.path, ignore_errors=True)
        self.leave()

    def leave(self) -> None:
        """Release the lock but keep the folder, so that `recover` in a later command handles it."""
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def temporary_path(out: Path, *, inside: bool = False) -> Path:
    """Return an unused path for a temporary folder beside `out` (absolute) or, if `inside`, in `out`."""
    suffix = f".baker-{os.getpid()}-{secrets.token_hex(4)}"
    return out / suffix if inside else out.with_name(f".{out.name}{suffix}")


def temporaries(out: Path) -> list[Temporary]:
    """List the temporary folders of all processes for an output.

    Parameters
    ----------
    out : Path
        The output folder or file.

    Returns
    -------
    list of Temporary
        The folders beside the output, then those inside it, each sorted by name. A folder that cannot be
        listed is skipped.
    """
    target = Path(os.path.realpath(out))
    found = []
    for home, prefix in ((target.parent, f".{target.name}"), (target, "")):
        with contextlib.suppress(OSError), os.scandir(home) as entries:
            for entry in sorted(entries, key=lambda e: e.name):
                name = entry.name
                match = _NAME.fullmatch(name.removeprefix(prefix)) if name.startswith(prefix) else None
                if match and entry.is_dir(follow_symlinks=False):
                    found.append(Temporary(home / name, int(match.group(1))))
    return found


@contextlib.contextmanager
def claim(found: Temporary) -> Iterator[bool]:
    """Lock a temporary folder if the process that created it has ended.

    Parameters
    ----------
    found : Temporary
        A temporary folder of any process.

    Yields
    ------
    bool
        True if the process has ended. The folder is then locked until the `with` block ends, if the file
        system supports locks.
    """
    try:
        file = os.open(found.path, os.O_RDONLY)
    except OSError:
        yield found.path.exists() and not is_alive(found.process)
        return
    try:
        try:
            free = try_lock(file)
        except OSError:
            free = not is_alive(found.process)
        yield free and is_at(file, found.path)
    finally:
        os.close(file)


@contextlib.contextmanager
def atomic_path(path: Path, what: str) -> Iterator[Path]:
    """Yield a temporary path to write to; at the end of the `with` block, that file replaces `path`.

    Parameters
    ----------
    path : Path
        The file to replace; its parents are created. It is unchanged if the block ends with an exception.
    what : str
        Kind of file, for the error message: "picture".

    Yields
    ------
    Path
        A path with the same name in a temporary folder beside `path`. If `path` is a device or a pipe, it is
        yielded itself.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    try:
        target = path.resolve()
        if target.exists() and not target.is_file():
            # Write directly to a device or a pipe instead of replacing it by a file.
            yield target
            return
        remove_abandoned(target)
        folder = TemporaryFolder(target)
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            folder.create()
            yield folder.path / path.name
            (folder.path / path.name).replace(target)
        finally:
            folder.remove()
    except OSError as error:
        raise ResourceError(f"the {what} cannot be written ({error.strerror})", file=str(path)) from None
    except ResourceError as error:
        # Name the final path in the message, because the temporary file that the error names is removed.
        raise ResourceError(error.message, file=str(path)) from error


def remove_abandoned(target: Path) -> None:
    """Remove the temporary folders that killed processes have left for an output.

    Parameters
    ----------
    target : Path
        The output file or folder; an absolute path.
    """
    for found in temporaries(target):
        with claim(found) as free:
            if free:
                shutil.rmtree(found.path, ignore_errors=True)


def write_atomically(path: Path, data: bytes, what: str) -> None:
    """Write a file atomically: after an error, the old file is unchanged; see `atomic_path`.

    Parameters
    ----------
    path : Path
        The file; its parents are created.
    data : bytes
        The content of the file.
    what : str
        Kind of file, for the error message: "picture".
    """
    with atomic_path(path, what) as temporary:
        temporary.write_bytes(data)
