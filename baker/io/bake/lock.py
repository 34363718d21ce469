"""A lock that prevents two runs from baking into one output folder at the same time.

The lock is an operating-system lock on the file `.<folder>.baker.lock` beside the output folder. The
operating system releases it when the process that holds it ends, even after a crash.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from baker.core.errors import ResourceError
from baker.io.file_lock import is_at, try_lock


class OutputLock:
    """The lock of one output folder.

    Parameters
    ----------
    out : Path
        The output folder, which need not exist; its parents are created.
    """

    def __init__(self, out: Path) -> None:
        folder = Path(os.path.realpath(out))
        self.out = out
        self.path = folder.parent / f".{folder.name}.baker.lock"
        self._made: list[Path] = []
        self._file: int | None = None

    def acquire(self) -> bool:
        """Try to take the lock without waiting. Return False if another run holds it or has just released it.

        Raises
        ------
        OSError
            If the lock file or its folder cannot be created, or if the file system does not support locks.
        """
        try:
            self._file = self._lock()
        finally:
            if self._file is None:
                self._remove_made()
        return self._file is not None

    def _lock(self) -> int | None:
        """Return the descriptor of the locked file, or None if another run holds or has just released it."""
        for parent in reversed([p for p in self.path.parents if not p.exists()]):
            with contextlib.suppress(FileExistsError):
                parent.mkdir()
                self._made.append(parent)
        try:
            file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644)
        except FileNotFoundError:
            return None  # another run has just removed a parent folder
        try:
            if try_lock(file) and is_at(file, self.path):
                return file
        except OSError:
            os.close(file)
            # Without locks, no other run can hold the file.
            self.path.unlink(missing_ok=True)
            raise
        # Another run holds the lock, or it deleted the lock file between `os.open` and `try_lock`.
        os.close(file)
        return None

    def release(self) -> None:
        """Release the lock. Delete the lock file, and the empty parent folders that `acquire` created."""
        if self._file is None:
            return
        # Delete the file before the release, because another run could lock the file after the release.
        with contextlib.suppress(OSError):
            self.path.unlink()
        os.close(self._file)
        self._file = None
        self._remove_made()

    def _remove_made(self) -> None:
        """Delete the parent folders that this lock created, as far as they are empty."""
        while self._made:
            try:
                self._made.pop().rmdir()
            except OSError:
                self._made.clear()


@contextlib.contextmanager
def held(out: Path) -> Iterator[None]:
    """Hold the lock of an output folder within a `with` block, without waiting for other runs.

    If the lock file cannot be created, or if the file system does not support locks, the `with` block runs
    without a lock. For example, the folder around a mount point may not be writable.

    Parameters
    ----------
    out : Path
        The output folder.

    Yields
    ------
    None
        Once; the lock is held until the `with` block ends.

    Raises
    ------
    ResourceError
        If another run holds the lock of this folder.
    """
    lock = OutputLock(out)
    try:
        # Try twice, because the first attempt also fails if another run releases the lock at the same time.
        free = lock.acquire() or lock.acquire() or not lock.path.exists()
    except OSError:
        free = True
    if not free:
        message = "another run is baking into this folder; wait until it has ended, or name another folder"
        raise ResourceError(message, file=str(out))
    try:
        yield
    finally:
        lock.release()
