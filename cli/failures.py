"""Turns whatever went wrong into one sentence, an exit code, and JSON where it was asked for."""

from __future__ import annotations

import contextlib
import errno
import json
import sys
from typing import Any, TextIO

from baker.core.errors import BakerError, Cancelled, ResourceError, SettingsError

# Exit code of a check that the user asked for and that failed.
FAILED_CHECK = 1
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
        Anything that a command raised.
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
    try:
        import typer
    except ImportError:
        return None
    if isinstance(error, typer.TyperException):
        context = getattr(error, "ctx", None)
        hint = f"; see `{context.command_path} --help`" if context is not None else ""
        return SettingsError(_sentence(error.format_message()).rstrip(".") + hint)
    return None


def tell(error: BaseException, *, as_json: bool, traceback: bool, out: TextIO) -> int:
    """Report a failure and return the exit code.

    Parameters
    ----------
    error : BaseException
    as_json : bool
        Write the error object on `out` as well.
    traceback : bool
        Show where it was raised (-vv).
    out : TextIO
        Where JSON goes.
    """
    if traceback:
        import traceback as tb

        tb.print_exception(error, file=sys.stderr)
    known = explain(error)
    if known is None:
        what = f"{type(error).__name__}: {error}".splitlines()[0]
        # 4, not 1: a script that reads 1 as "the check failed" must not take a bug for it.
        known = ResourceError(f"internal error ({what}); run with -vv to see where, and please report it")
        kind = "internal"
    else:
        kind = known.kind
    sys.stderr.write(f"baker: {_line(known)}\n")
    if as_json:
        body: dict[str, Any] = {
            "kind": kind,
            "message": known.message,
            "file": known.file,
            "object": known.object,
        }
        with contextlib.suppress(OSError):  # standard output may be what failed
            out.write(json.dumps({"error": body}) + "\n")
            out.flush()
    return known.exit_code


def _line(error: BakerError) -> str:
    text = _sentence(str(error))
    # A setting's message may begin with its name, which is the object too: once is enough.
    doubled = f"{error.object}: {error.object}: "
    return text.replace(doubled, f"{error.object}: ", 1)


def _sentence(text: str) -> str:
    return " ".join(text.split())
