"""Writes the message of an interrupted command; imports only `os`, so that it also works during start-up."""

from __future__ import annotations

import os

INTERRUPTED = 130


def report_interrupt(argv: list[str]) -> None:
    """Write the message of an interrupted command to stderr, and with `--json` the error object to stdout.

    Parameters
    ----------
    argv : list of str
        Arguments of the command.
    """
    texts = {2: b"baker: interrupted\n"}
    if "--json" in argv:
        texts[1] = (
            b'{"error": {"kind": "cancelled", "message": "interrupted", "file": null, "object": null}}\n'
        )
    for descriptor, text in texts.items():
        try:
            os.write(descriptor, text)
        except OSError:
            continue  # the stream is closed, or its reader has ended
