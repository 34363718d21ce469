"""Shared by all commands of one run: where text and JSON go, and whether to stop."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from typing import Any, TextIO

from baker.cli.flags import values_in_flags
from baker.cli.progress import Reporter
from baker.cli.supervise import StopFlag, note_output


@dataclass
class Session:
    """The streams and the stop flag of one run; made by `app.run`, passed to commands in their context.

    Attributes
    ----------
    out : TextIO
        Standard output: the JSON object, or the text of a command.
    stop : StopFlag
    notes : int or None
        Descriptor of the file that lists output folders for the parent process, see `supervise`.
    as_json : bool
        Whether `--json` was given before the subcommand.
    """

    out: TextIO = field(default_factory=lambda: sys.stdout)
    stop: StopFlag = field(default_factory=StopFlag)
    notes: int | None = None
    as_json: bool = False

    def reporter(self, *, quiet: bool) -> Reporter:
        """Return the progress callback for a piece of work."""
        return Reporter(quiet=quiet, stopped=lambda: self.stop.requested)

    def will_write(self, out: str) -> None:
        """Note that `out` is about to be written, so that the parent can clean up after a kill."""
        note_output(self.notes, out)

    def write_json(self, value: dict[str, Any]) -> None:
        """Write the one object of `--json`; settings in its texts are written as flags."""
        self.out.write(json.dumps(values_in_flags(value), indent=2, allow_nan=False) + "\n")

    def text_stream(self, *, as_json: bool) -> TextIO:
        """Return the stream for a command's text."""
        return sys.stderr if as_json else self.out
