"""Turns what a bake may raise into baker's own errors, or says that it is a bug."""

from __future__ import annotations

import errno

from baker.core.errors import BakerError, Cancelled, ResourceError

# What the operating system says when something ran out or is not ours to use.
_RESOURCE_ERRNO = {
    errno.ENOSPC: "the disk is full; free some space, or write elsewhere with -o",
    errno.EDQUOT: "the disk quota is used up; free some space, or write elsewhere with -o",
    errno.EACCES: "no permission; change it, or write elsewhere with -o",
    errno.EPERM: "no permission; change it, or write elsewhere with -o",
    errno.EROFS: "the file system is read-only; write elsewhere with -o",
    errno.ENOMEM: "out of memory; try a smaller --resolution or fewer --threads",
    errno.EMFILE: "too many open files; raise the limit (ulimit -n)",
}


def explain(error: BaseException) -> BakerError | None:
    """Return the error as baker's own kind, or None for a bug.

    Parameters
    ----------
    error : BaseException
        Anything that a stage of a bake raised.
    """
    if isinstance(error, BakerError):
        return error
    if isinstance(error, KeyboardInterrupt):
        return Cancelled("interrupted")
    if isinstance(error, MemoryError):
        return ResourceError(
            "out of memory; try a smaller --resolution, a lower --density or fewer --threads"
        )
    if isinstance(error, OSError):
        reason = _RESOURCE_ERRNO.get(error.errno or 0, error.strerror or str(error))
        return ResourceError(reason, file=None if error.filename is None else str(error.filename))
    return None


def bug(error: BaseException) -> ResourceError:
    """Return a sentence about an error that should not have happened.

    Notes
    -----
    Its exit code is 4, not 1: a script that reads 1 as "the check failed" must not take a bug for it.
    """
    what = f"{type(error).__name__}: {error}".splitlines()[0]
    return ResourceError(f"internal error ({what}); run with -vv to see where, and please report it")
