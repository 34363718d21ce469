"""Reads whole regular files; devices, pipes, sockets and Git LFS pointers are refused."""

from __future__ import annotations

import errno
import os
import stat
from pathlib import Path

# Size above which a scene or buffer file is not read, bytes. The length in a GLB header has 32 bits.
LARGEST = 1 << 32
# Size above which an image or a material library is not read, bytes.
LARGEST_PART = 1 << 30
# Size above which a text file with settings or jobs is not read, bytes.
LARGEST_TEXT = 1 << 24
_LFS = b"version https://git-lfs.github.com/spec/"
_KINDS = (
    (stat.S_ISDIR, errno.EISDIR, "it is a folder"),
    (stat.S_ISFIFO, errno.EINVAL, "it is a pipe (FIFO), not a regular file"),
    (stat.S_ISSOCK, errno.EINVAL, "it is a socket, not a regular file"),
    (stat.S_ISCHR, errno.EINVAL, "it is a device, not a regular file"),
    (stat.S_ISBLK, errno.EINVAL, "it is a device, not a regular file"),
)


def read_regular(path: Path | str, *, most: int = LARGEST, first: int | None = None) -> bytes:
    """Return the content of a regular file.

    Parameters
    ----------
    path : Path or str
        The file, or a symbolic link to it.
    most : int
        Largest accepted size, bytes; a larger file is refused before it is read.
    first : int, optional
        Read at most this number of bytes, from the start of the file. `most` then limits the number of bytes
        that are read and not the size of the file.

    Returns
    -------
    bytes
        The content.

    Raises
    ------
    OSError
        If the file is missing, unreadable, not a regular file, longer than `most`, or a Git LFS pointer. The
        `strerror` of the exception describes the reason.
    ValueError
        If no file can have this name, for example because it contains a NUL character.
    """
    # Check the type first: opening a pipe waits for a writer, and opening a device may have side effects.
    path = Path(path)
    _check(path, path.stat().st_mode)
    file = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(file, "rb") as stream:
        found = os.fstat(stream.fileno())
        _check(path, found.st_mode)
        # Read at least as many bytes as are needed to recognise a Git LFS pointer.
        size = found.st_size if first is None else min(found.st_size, max(first, len(_LFS)))
        if size > most:
            raise OSError(errno.EFBIG, f"it has {size} bytes; at most {most} are read", str(path))
        data = stream.read(size)
    if data.startswith(_LFS):
        raise OSError(errno.EINVAL, "it is a Git LFS pointer; run `git lfs pull`", str(path))
    return data if first is None else data[:first]


def _check(path: Path, mode: int) -> None:
    """Raise `OSError` if `mode` is that of a folder, pipe, socket or device."""
    for is_kind, number, why in _KINDS:
        if is_kind(mode):
            raise OSError(number, why, str(path))
