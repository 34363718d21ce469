"""Starts the command `baker`: handles Ctrl-C and missing streams before it imports other modules."""

from __future__ import annotations

# Import `_signal`, because `signal` imports `enum`, which takes longer than all other imports here.
import _signal  # type: ignore[import-not-found]
import os
import sys

from baker.cli.interrupt import INTERRUPTED, report_interrupt


def main() -> None:
    """Run the command line of this process; never returns."""
    open_missing_streams()
    from baker.cli.app import main as run_command_line

    run_command_line()


def _end(number: int, frame: object) -> None:
    # Nothing has been started or written yet.
    report_interrupt(sys.argv[1:])
    os._exit(INTERRUPTED)


# Install the handler during the import, because Ctrl-C may arrive before `main` is called.
_signal.signal(_signal.SIGINT, _end)


def open_missing_streams() -> None:
    """Open the null device for each standard stream that was closed before this process started.

    Otherwise the next file that is opened would get the descriptor of the closed stream (0, 1 or 2), and
    libraries that print would write into this file.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is not None:
            continue
        null = os.open(os.devnull, os.O_RDWR)
        if null != number:
            os.dup2(null, number)
            os.close(null)
        setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", encoding="utf-8"))
