"""Writes the text output that `verify` and `diff` share: worst texels and limits."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, TextIO

import typer

from baker.cli.failures import FAILED_CHECK
from baker.core.printable import printable

if TYPE_CHECKING:
    from baker.cli.command import Run
    from baker.comparison.compare import DiffReport
    from baker.metrics.limits import Verdict
    from baker.verification.verify import VerifyReport


def report_outcome(found: VerifyReport | DiffReport, run: Run, as_text: Callable[..., None]) -> None:
    """Write a report as text and, with --json, as JSON. Exit with `FAILED_CHECK` if it did not pass.

    `as_text(report, stream, verbose=...)` writes the text.
    """
    if not run.quiet:
        as_text(found, run.text, verbose=run.verbose)
    if run.as_json:
        run.session.write_json(found.to_dict())
    if not found.passed:
        raise typer.Exit(FAILED_CHECK)


def write_worst(worst: Sequence[dict[str, Any]], stream: TextIO) -> None:
    """Write one line for each of the worst texels."""
    for entry in worst:
        texel = f"page {entry['page']}, row {entry['row']}, column {entry['column']}"
        name = printable(entry["object"])
        stream.write(f"worst: {entry['channel']} of '{name}' at {texel}: {entry['error']:.1%} off\n")


def write_limits(verdicts: Iterable[Verdict], stream: TextIO, *, default: bool) -> None:
    """Write the limits that were applied, each with the value of its metric."""
    by_channel: dict[str, list[str]] = {}
    for verdict in verdicts:
        limit = verdict.limit
        entry = f"{limit.metric} {verdict.readable} ({limit.readable})"
        by_channel.setdefault(limit.channel, []).append(entry)
    which = "default limits" if default else "limits of --fail-if"
    for channel, words in by_channel.items():
        # Do not break a line inside an entry.
        entries = ", ".join(words).replace(" ", "\0").replace(",\0", ", ")
        text = f"{which} on {channel}, with what fails in brackets: {entries}"
        lines = textwrap.fill(text, 100, subsequent_indent="  ", break_on_hyphens=False)
        stream.write(lines.replace("\0", " ") + "\n")


def write_failed(verdicts: Iterable[Verdict], stream: TextIO) -> None:
    """Write the limits that were exceeded."""
    for verdict in verdicts:
        if verdict.failed:
            stream.write(f"failed: {printable(verdict.sentence())}\n")
