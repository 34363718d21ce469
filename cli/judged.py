"""Lines about the worst places and the limits, of the commands that judge a bake."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TextIO

if TYPE_CHECKING:
    from baker.judge.limits import Verdict


def write_worst(worst: Sequence[dict[str, Any]], stream: TextIO) -> None:
    """Write one line for each of the worst places."""
    for entry in worst:
        place = f"page {entry['page']}, row {entry['row']}, column {entry['column']}"
        stream.write(
            f"worst: {entry['channel']} of '{entry['object']}' at {place}: {entry['error']:.1%} off\n"
        )


def write_failed(verdicts: Iterable[Verdict], stream: TextIO) -> None:
    """Write the limits that were passed."""
    for verdict in verdicts:
        if verdict.failed:
            value = "no such figure" if verdict.value is None else f"it is {verdict.value:.4g}"
            stream.write(f"failed: {verdict.limit} ({value})\n")
