"""Reports an exception as one sentence and an exit code, and with --json also as JSON."""

from __future__ import annotations

import contextlib
import sys
from typing import Any, TextIO

from baker.cli.flags import in_flags
from baker.cli.foreign_flags import answer_error
from baker.core import error_mapping as failure
from baker.core.errors import BakerError, SettingsError
from baker.core.printable import json_text, printable

# Exit code of `check`, `verify` and `diff` if the result failed.
FAILED_CHECK = 1


def explain(error: BaseException) -> BakerError | None:
    """Convert a known exception or a usage error of typer to a `BakerError`; return None for others.

    Parameters
    ----------
    error : BaseException
        The exception that a subcommand raised.
    """
    known = failure.explain(error)
    if known is not None:
        return known
    try:
        import typer
    except ImportError:
        return None
    if isinstance(error, typer.TyperException):
        foreign = answer_error(error)
        if foreign is not None:
            return SettingsError(foreign)
        context = getattr(error, "ctx", None)
        hint = f"; see `{context.command_path} --help`" if context is not None else ""
        return SettingsError(_sentence(error.format_message()).rstrip(".") + hint)
    return None


def report(error: BaseException, *, as_json: bool, traceback: bool, out: TextIO) -> int:
    """Report a failure and return the exit code.

    Parameters
    ----------
    error : BaseException
        The exception that a subcommand raised.
    as_json : bool
        Whether the error is also written to `out` as JSON.
    traceback : bool
        Whether the traceback is printed (-vv).
    out : TextIO
        Stream for JSON.
    """
    if traceback:
        import traceback as tb

        tb.print_exception(error, file=sys.stderr)
    known = explain(error)
    if known is None:
        known = failure.bug(error)
        kind = "internal"
    else:
        kind = known.kind
    sys.stderr.write(f"baker: {_line(known)}\n")
    if as_json:
        body: dict[str, Any] = {
            "kind": kind,
            "message": in_flags(known.message),
            "file": known.file,
            "object": known.object,
        }
        with contextlib.suppress(OSError):  # a failure to write may be the error that is reported
            out.write(json_text({"error": body}, only_ascii=True) + "\n")
            out.flush()
    return known.exit_code


def _line(error: BakerError) -> str:
    """Return file, object and message of an error in one line.

    The object is left out if the message begins with it. If the object is a setting that is not from a file,
    it is written as a flag.
    """
    if error.object and error.message.startswith((f"`{error.object}`", f"'{error.object}'")):
        parts = [error.file, error.message]
    elif error.object and error.file is None and isinstance(error, SettingsError):
        parts = [in_flags(f"`{error.object}`").strip("`"), error.message]
    else:
        of_flag = isinstance(error, SettingsError) and error.object and not error.file
        named = in_flags(f"`{error.object}`").strip("`") if of_flag else error.object
        parts = [error.file, named, error.message]
    return in_flags(_sentence(printable(": ".join(part for part in parts if part))))


def _sentence(text: str) -> str:
    return " ".join(text.split())
