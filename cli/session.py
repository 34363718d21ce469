"""Holds the output streams and the stop flag that a run of the command line shares with its subcommand."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from typing import Any, TextIO

from baker.cli.flags import values_in_flags
from baker.cli.progress import Reporter
from baker.cli.supervise import StopFlag, note_output
from baker.core.printable import json_text


@dataclass
class Session:
    """The output streams and the stop flag of one run. `app.run` makes it and passes it in the context.

    Attributes
    ----------
    out : TextIO
        Standard output. It receives the JSON object or the text of the subcommand.
    stop : StopFlag
    notes : int or None
        Descriptor of the file that lists outputs for the parent process, see `supervise`.
    as_json : bool
        Whether `--json` was given before the subcommand.
    """

    out: TextIO = field(default_factory=lambda: sys.stdout)
    stop: StopFlag = field(default_factory=StopFlag)
    notes: int | None = None
    as_json: bool = False

    def reporter(self, *, quiet: bool) -> Reporter:
        """Return a progress callback that returns whether a stopping signal has arrived."""
        return Reporter(quiet=quiet, stopped=lambda: self.stop.requested)

    def will_write(self, out: str) -> None:
        """Record that `out` will be written, so that the parent process can clean up after a kill."""
        note_output(self.notes, out)

    def write_json(self, value: dict[str, Any]) -> None:
        """Write the JSON object of `--json`. Names of settings in its texts are converted to flags."""
        self.out.write(json_text(values_in_flags(value), indent=2, only_ascii=True) + "\n")

    def text_stream(self, *, as_json: bool) -> TextIO:
        """Return the stream for text output: stderr if JSON is written to `out`, else `out`."""
        return sys.stderr if as_json else self.out
