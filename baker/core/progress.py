"""How long work reports and is stopped: a callable that is told and may answer "stop"."""

from __future__ import annotations

from typing import Protocol

from baker.core.errors import Cancelled


class Progress(Protocol):
    """Is told how far a stage has come; a truthy answer cancels the work."""

    def __call__(self, stage: str, fraction: float, detail: str = "", /) -> object:
        """Report `fraction` (0 to 1) of `stage` done; `detail` is a rate or a count to show."""


def silent(stage: str, fraction: float, detail: str = "", /) -> object:
    """Report nothing and never cancel."""
    return None


def report(progress: Progress, stage: str, fraction: float, detail: str = "") -> None:
    """Tell `progress`, and raise `Cancelled` if it answers that the work must stop."""
    if progress(stage, fraction, detail):
        raise Cancelled("the work was cancelled")
