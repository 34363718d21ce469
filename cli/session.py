"""What every command of one run shares: where text and JSON go, and whether to stop."""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass, field
from typing import Any, TextIO

from baker.cli.progress import Reporter
from baker.cli.supervise import StopFlag, announce


@dataclass
class Session:
    """Is made by `main` and handed to commands through the command line's context.

    Attributes
    ----------
    out : TextIO
        Standard output: the JSON object, or the text of a command.
    stop : StopFlag
    notes : int or None
        Where the supervising process listens for output folders.
    as_json : bool
        `--json` stood before the subcommand.
    """

    out: TextIO = field(default_factory=lambda: sys.stdout)
    stop: StopFlag = field(default_factory=StopFlag)
    notes: int | None = None
    as_json: bool = False

    def reporter(self, *, quiet: bool) -> Reporter:
        """Return the progress callback for a piece of work."""
        return Reporter(quiet=quiet, stopped=lambda: self.stop.requested)

    def will_write(self, out: str) -> None:
        """Say that `out` is about to be written, so that a hard end can tidy up."""
        announce(self.notes, out)

    def write_json(self, value: dict[str, Any]) -> None:
        """Write the one object of `--json`."""
        self.out.write(json.dumps(value, indent=2, allow_nan=False) + "\n")

    def text_stream(self, *, as_json: bool) -> TextIO:
        """Return where a command's text goes."""
        return sys.stderr if as_json else self.out
