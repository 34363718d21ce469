"""Maps exceptions of Python and of the operating system to baker's errors."""

from __future__ import annotations

import contextlib
import errno
from collections.abc import Iterator

from baker.core.errors import BakerError, Cancelled, InputError, ResourceError

_OUT_OF_MEMORY = (
    "out of memory; try a smaller `resolution`, a lower `density`, fewer `samples` or fewer `threads`"
)
# Messages for exhausted resources and denied access, by `errno`.
_RESOURCE_ERRNO = {
    errno.ENOSPC: "the disk is full; free some space, or write elsewhere with `out`",
    errno.EDQUOT: "the disk quota is used up; free some space, or write elsewhere with `out`",
    errno.EACCES: "no permission; change it, or write elsewhere with `out`",
    errno.EPERM: "no permission; change it, or write elsewhere with `out`",
    errno.EROFS: "the file system is read-only; write elsewhere with `out`",
    errno.ENOMEM: _OUT_OF_MEMORY,
    errno.EMFILE: "too many open files; raise the limit (ulimit -n)",
}


def explain(error: BaseException) -> BakerError | None:
    """Return the `BakerError` that corresponds to an exception.

    Parameters
    ----------
    error : BaseException
        Any exception.

    Returns
    -------
    BakerError or None
        None if the exception is neither a `BakerError`, a `KeyboardInterrupt`, a `MemoryError`, an `OSError`
        nor the error for a loop of links. Such an exception is a bug in `baker`, see `bug`.
    """
    if isinstance(error, BakerError):
        return error
    if isinstance(error, KeyboardInterrupt):
        return Cancelled("interrupted")
    if isinstance(error, MemoryError):
        return ResourceError(_OUT_OF_MEMORY)
    if isinstance(error, RuntimeError) and str(error).startswith("Symlink loop"):
        # In Python 3.11 and 3.12, Path.resolve raises this RuntimeError for a loop of links.
        return InputError("the links in this path form a loop", file=str(error).partition("'")[2].rstrip("'"))
    if isinstance(error, OSError):
        reason = _RESOURCE_ERRNO.get(error.errno or 0, error.strerror or str(error))
        return ResourceError(reason, file=None if error.filename is None else str(error.filename))
    return None


@contextlib.contextmanager
def memory_errors(*, file: str | None = None) -> Iterator[None]:
    """Replace a `MemoryError` of the body of the `with` statement by a `ResourceError`.

    Parameters
    ----------
    file : str, optional
        File that the body reads or writes; it becomes the error's attribute `file`.

    Yields
    ------
    None

    Raises
    ------
    ResourceError
        If the body raises `MemoryError`.
    """
    try:
        yield
    except MemoryError:
        raise ResourceError(_OUT_OF_MEMORY, file=file) from None


def bug(error: BaseException) -> ResourceError:
    """Return the error to report for a bug in `baker`.

    Parameters
    ----------
    error : BaseException
        The unexpected exception.

    Returns
    -------
    ResourceError
        A `ResourceError`, because its exit code is 4. Exit code 1 would mean that a check failed.
    """
    what = f"{type(error).__name__}: {error}".splitlines()[0]
    return ResourceError(f"internal error ({what}); run with -vv to see where, and please report it")
