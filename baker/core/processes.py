"""Reads how much memory this process uses and may still use, and which processes exist."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

PROC, CGROUPS = Path("/proc"), Path("/sys/fs/cgroup")
# Smallest memory limit of a control group that counts as no limit, bytes. Version 1 of control groups reports
# about 2^63 if there is no limit.
_NO_LIMIT = 1 << 60


def free_memory() -> int:
    """Return the free memory of the machine, or the rest of a control group's limit if that is smaller.

    Returns
    -------
    int
        Bytes, without swap space.
    """
    import psutil

    return min([int(psutil.virtual_memory().available), *_left_in_groups(PROC, CGROUPS)])


def used_memory() -> int:
    """Return the resident memory of this process.

    Returns
    -------
    int
        Bytes.
    """
    import psutil

    return int(psutil.Process().memory_info().rss)


def has_process(process: int) -> bool:
    """Return whether a process with this id exists.

    Parameters
    ----------
    process : int
        The id of the process.

    Returns
    -------
    bool
        False also for ids that no process can have.
    """
    import psutil

    try:
        return bool(psutil.pid_exists(process))
    except OverflowError:
        return False


def _left_in_groups(proc: Path, cgroups: Path) -> Iterator[int]:
    """Yield limit minus use, bytes, of each Linux control group of this process that has a memory limit.

    Inactive pages of the file cache do not count as used, because the kernel can drop them.
    """
    for line in _text(proc / "self" / "cgroup").splitlines():
        _, _, rest = line.partition(":")
        controllers, _, group = rest.partition(":")
        if not controllers:
            folder, names = cgroups, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in controllers.split(","):
            folder = cgroups / "memory"
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        # The limits of this process's group and of all its parent groups apply. In a container, the root of
        # the mount is the group of the container, and the path of the group may not exist.
        path = folder / group.lstrip("/")
        for parent in (path, *path.parents):
            yield from _left(parent, *names)
            if parent == folder:
                break


def _left(group: Path, limit_name: str, used_name: str, cache_name: str) -> Iterator[int]:
    limit, used = _text(group / limit_name).strip(), _text(group / used_name).strip()
    if not (limit.isdecimal() and used.isdecimal()) or int(limit) >= _NO_LIMIT:
        return
    rows = (row.split() for row in _text(group / "memory.stat").splitlines())
    cache = next((int(row[1]) for row in rows if len(row) == 2 and row[0] == cache_name), 0)
    yield max(int(limit) - int(used) + cache, 0)


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except (OSError, ValueError):
        return ""
