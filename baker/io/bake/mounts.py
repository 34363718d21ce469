"""Finds folders that cannot or must not be renamed."""

from __future__ import annotations

import os
from pathlib import Path

# Mount table of this process on Linux; the fifth field of each line is the mount point.
_MOUNT_TABLE = Path("/proc/self/mountinfo")


def cannot_move(folder: Path) -> bool:
    """Return whether a folder cannot or must not be renamed.

    True is returned for

    - a mount point, and a folder that contains a mount point;
    - a folder whose parent is not writable;
    - the current folder of this process and its parents, because a shell may be in that folder.

    Parameters
    ----------
    folder : Path
        An existing folder; an absolute path without symbolic links.

    Returns
    -------
    bool
        True if the folder must not be renamed.
    """
    if os.path.ismount(folder) or not os.access(folder.parent, os.W_OK | os.X_OK):
        return True
    if any(point.is_relative_to(folder) for point in _mount_points()):
        return True
    try:
        return Path.cwd().is_relative_to(folder)
    except OSError:
        # The current folder no longer exists.
        return False


def _mount_points() -> list[Path]:
    """Return all mount points, including bind mounts; an empty list on systems without the table."""
    try:
        lines = _MOUNT_TABLE.read_bytes().splitlines()
    except OSError:
        return []
    return [Path(os.fsdecode(_unescaped(line.split(b" ")[4]))) for line in lines if line.count(b" ") > 4]


def _unescaped(field: bytes) -> bytes:
    for character in (b" ", b"\t", b"\n", b"\\"):
        field = field.replace(b"\\%03o" % ord(character), character)
    return field
