"""Defines the interface of progress callbacks, which receive reports and may cancel the work."""

from __future__ import annotations

from typing import Protocol

from baker.core.errors import Cancelled
from baker.core.stage import Stage


class Progress(Protocol):
    """Receives the progress of a stage; a truthy return value cancels the work."""

    def __call__(self, stage: str, fraction: float, detail: str = "", /) -> object:
        """Receive the share of `stage` that is done, 0 to 1, and `detail`, a rate or a count as text."""


def silent(stage: str, fraction: float, detail: str = "", /) -> object:
    """Ignore a progress report and do not cancel.

    Parameters
    ----------
    stage : str
        Ignored.
    fraction : float
        Ignored.
    detail : str
        Ignored.

    Returns
    -------
    object
        None.
    """
    return None


def notify(progress: Progress, message: str) -> None:
    """Pass a message for the user to the method `note` of a callback, if the callback has this method.

    Parameters
    ----------
    progress : Progress
        The callback. If it has no method `note`, the message is dropped.
    message : str
        One sentence.
    """
    note = getattr(progress, "note", None)
    if note is not None:
        note(message)


def report(progress: Progress, stage: Stage, fraction: float, detail: str = "") -> None:
    """Call `progress`, and raise `Cancelled` if it returns a truthy value.

    Parameters
    ----------
    progress : Progress
        Receives the report.
    stage : Stage
        The current stage; its value is the name shown to users.
    fraction : float
        Share of the stage that is done, 0 to 1.
    detail : str
        A rate or a count, as text.

    Raises
    ------
    Cancelled
        If `progress` returns a truthy value.
    """
    if progress(stage, fraction, detail):
        raise Cancelled("the work was cancelled")
