"""Exchanges two files or folders atomically: both paths exist at all times.

Based on: renameat2(2) of Linux with RENAME_EXCHANGE, renamex_np(2) of macOS with RENAME_SWAP.
"""

from __future__ import annotations

import ctypes
import errno
import os
import sys
from pathlib import Path
from typing import Any

_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_RENAME_SWAP = 2
# Error codes of exchanges that the operating system, the file system or one of the folders does not allow.
_REFUSED = {
    errno.ENOSYS,
    errno.EINVAL,
    errno.ENOTSUP,
    errno.EOPNOTSUPP,
    errno.EXDEV,
    errno.EBUSY,
    errno.EPERM,
    errno.EACCES,
}


def exchange_paths(one: Path, two: Path) -> bool:
    """Exchange two files or folders atomically.

    Parameters
    ----------
    one, two : Path
        Existing paths on the same file system.

    Returns
    -------
    bool
        True if the paths were exchanged. False if the operating system, the file system or one of the paths
        does not allow the exchange; then nothing is changed.

    Raises
    ------
    OSError
        If the exchange fails for another reason; nothing is changed.
    """
    # Raise the same audit event as os.rename.
    sys.audit("os.rename", one, two, -1, -1)
    library: Any = None if os.name == "nt" else ctypes.CDLL(None, use_errno=True)
    first, second = os.fsencode(one), os.fsencode(two)
    if sys.platform == "linux" and hasattr(library, "renameat2"):
        failed = library.renameat2(_AT_FDCWD, first, _AT_FDCWD, second, _RENAME_EXCHANGE)
    elif sys.platform == "darwin" and hasattr(library, "renamex_np"):
        failed = library.renamex_np(first, second, _RENAME_SWAP)
    else:
        return False
    if not failed:
        return True
    number = ctypes.get_errno()
    if number in _REFUSED:
        return False
    raise OSError(number, os.strerror(number), str(one), None, str(two))
