"""Takes file locks of the operating system, which releases a lock when the process that holds it ends."""

from __future__ import annotations

import os
from pathlib import Path


def try_lock(file: int) -> bool:
    """Lock an open file, or on POSIX systems an open folder, without waiting.

    Parameters
    ----------
    file : int
        File descriptor; closing it releases the lock.

    Returns
    -------
    bool
        False if another descriptor, of any process, holds the lock.

    Raises
    ------
    OSError
        If the file system does not support locks (POSIX only; on Windows, False is returned).
    """
    try:
        import fcntl
    except ImportError:
        return _try_lock_windows(file)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def is_at(file: int, path: Path) -> bool:
    """Return whether an open file is still the one at `path`."""
    try:
        return os.path.samestat(os.fstat(file), path.stat())
    except OSError:
        return False


def is_alive(process: int) -> bool:
    """Return whether a process with this id exists."""
    if os.name == "nt":
        # `os.kill` with signal 0 would send Ctrl-C to the process on Windows.
        from baker.core.processes import has_process

        return has_process(process)
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def _try_lock_windows(file: int) -> bool:
    import msvcrt

    try:
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    except OSError:
        return False
    return True
