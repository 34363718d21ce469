"""A lock that prevents two runs from baking into one output folder at the same time.

It is a file lock of the operating system on a small file beside the folder, which is released when the
process that holds it ends for any reason. The incomplete output of killed runs is removed here, too.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

from baker.core.errors import ResourceError
from baker.io.bake.output_folder import remove_leftovers
from baker.io.temporary import temporaries


class OutputLock:
    """The lock of an output folder.

    Parameters
    ----------
    out : Path
        The output folder, which need not exist; its parents are created.
    """

    def __init__(self, out: Path) -> None:
        folder = out.resolve()
        self.out = out
        self.path = folder.parent / f".{folder.name}.baker.lock"
        self._made: list[Path] = []
        self._file: int | None = None

    def acquire(self) -> bool:
        """Try to take the lock; False if another run holds it.

        Raises
        ------
        OSError
            If the lock file cannot be created.
        """
        for parent in reversed([p for p in self.path.parents if not p.exists()]):
            with contextlib.suppress(FileExistsError):
                parent.mkdir()
                self._made.append(parent)
        try:
            file = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o644)
        except FileNotFoundError:
            return False  # the other run has just removed an empty parent
        if _lock(file) and _is_at(file, self.path):
            self._file = file
            return True
        # Another run holds it, or removed the file after it was opened and before it was locked here.
        os.close(file)
        return False

    def release(self) -> None:
        """Release the lock, and remove its file and the empty parents that were created."""
        if self._file is None:
            return
        # Remove the file before the release, so that no other run can have locked it.
        with contextlib.suppress(OSError):
            self.path.unlink()
        os.close(self._file)
        self._file = None
        while self._made:
            try:
                self._made.pop().rmdir()
            except OSError:
                self._made.clear()


@contextlib.contextmanager
def held(out: Path) -> Iterator[None]:
    """Hold the lock of an output folder within a `with` block, without waiting for other runs.

    Where no lock file can be created beside the folder (a mount point, for example), no lock is held.

    Parameters
    ----------
    out : Path
        The output folder.

    Yields
    ------
    None
        While the lock is held.

    Raises
    ------
    ResourceError
        If another run is baking into it.
    """
    lock = OutputLock(out)
    try:
        # Try twice: the run that held it may have removed the file in between.
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


def sweep(out: Path) -> None:
    """Remove the incomplete output of killed runs; call it with the lock held.

    Parameters
    ----------
    out : Path
        The output folder.
    """
    dead = dead_writers(out)
    remove_leftovers(out, [found for found in temporaries(out) if found.process in dead])


def dead_writers(out: Path) -> set[int]:
    """Return the processes that have ended and left temporary folders.

    Parameters
    ----------
    out : Path
        The output folder.

    Returns
    -------
    set of int
        Process ids.
    """
    return {found.process for found in temporaries(out) if not _alive(found.process)}


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def _is_at(file: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except OSError:
        return False


def _lock(file: int) -> bool:
    try:
        import fcntl
    except ImportError:
        return _lock_windows(file)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _lock_windows(file: int) -> bool:
    import msvcrt

    try:
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    except OSError:
        return False
    return True
