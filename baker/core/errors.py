"""Errors that `baker` raises: a base class, and one class for each of the exit codes 2, 3, 4 and 130.

An error names the file and the object concerned. Its message is one sentence that says what was found and
what to do.
"""

from __future__ import annotations

from baker.core.printable import message_line, printable


class BakerError(Exception):
    """Base class of all errors that baker raises on purpose.

    Parameters
    ----------
    message : str
        One sentence that says what was found and what to do.
    file : str or None
        The file concerned.
    object : str or None
        The node, mesh, accessor or setting concerned.
    """

    kind = "error"
    exit_code = 1

    def __init__(self, message: str, *, file: str | None = None, object: str | None = None) -> None:
        # Names in the message may contain line breaks and control characters.
        message = message_line(message)
        super().__init__(message)
        self.message = message
        self.file = file
        self.object = object

    def __str__(self) -> str:
        """Return file, object and message in one line."""
        where = ": ".join(printable(part) for part in (self.file, self.object) if part)
        return f"{where}: {self.message}" if where else self.message


class SettingsError(BakerError):
    """A flag, a setting or a configuration key is invalid (exit code 2)."""

    kind = "settings"
    exit_code = 2


class InputError(BakerError):
    """An input is unreadable, malformed or contains nothing to bake (exit code 3)."""

    kind = "input"
    exit_code = 3


class IndexRangeError(InputError):
    """A face refers to a vertex that does not exist. `baker check` reports it as a finding."""


class ResourceError(BakerError):
    """A resource is exhausted, inaccessible or missing, or `baker` itself has a bug (exit code 4).

    Examples of resources are memory, disk space, the permission to write a file, and libraries.
    """

    kind = "resource"
    exit_code = 4


class Cancelled(BakerError):  # noqa: N818 - the public name of the interface
    """The progress callback or a signal stopped the work (exit code 130)."""

    kind = "cancelled"
    exit_code = 130
