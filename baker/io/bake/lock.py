"""Keeps two runs from baking into one output folder at the same time.

The lock is the operating system's, on a small file beside the folder: it ends with the process that holds
it, however that ends, so nothing can stay locked. What a killed run left half written is removed here, too.
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
    """Holds an output folder for one job.

    Parameters
    ----------
    out : Path
        The output folder; it need not exist, its parents are made.
    """

    def __init__(self, out: Path) -> None:
        folder = out.resolve()
        self.out = out
        self.path = folder.with_name(f".{folder.name}.baker.lock")
        self._made: list[Path] = []
        self._file: int | None = None

    def acquire(self) -> bool:
        """Try to take the lock; False if another run holds it.

        Raises
        ------
        OSError
            If the lock file cannot be made: the place is not writable.
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
        # Held by another run; or its holder removed the file between our opening and locking it.
        os.close(file)
        return False

    def release(self) -> None:
        """Give the lock back and remove its file, and folders that were made for nothing."""
        if self._file is None:
            return
        # While it is still held: nobody else may have locked the name meanwhile.
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
    """Hold an output folder for one bake that does not wait for others.

    Where no lock file can be made beside the folder (it is a mount point, say), nothing is held.

    Raises
    ------
    ResourceError
        If another run is baking into it.
    """
    lock = OutputLock(out)
    try:
        # A second time: whoever held it may have removed it meanwhile.
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
    """Remove what runs that were killed left of a bake into `out`; call it with the lock held."""
    dead = dead_writers(out)
    remove_leftovers(out, [found for found in temporaries(out) if found.process in dead])


def dead_writers(out: Path) -> set[int]:
    """Return the ids of processes that left temporary folders of `out` and no longer live."""
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
