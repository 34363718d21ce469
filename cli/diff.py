"""`baker diff A B`: compares two bakes at the same surface points."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from baker.cli.command import Run, command
from baker.cli.outcome import report_outcome, write_failed, write_worst
from baker.comparison.settings import DiffSettings

if TYPE_CHECKING:
    from baker.comparison.compare import DiffReport

# Number of objects, and of texels, that are shown without --verbose.
_SHOWN = 3


@command("diff", DiffSettings)
def diff(
    ctx: typer.Context,
    a: Annotated[Path, typer.Argument(metavar="A", help="Output folder of a bake.")],
    b: Annotated[Path, typer.Argument(metavar="B", help="Output folder of the bake it is compared with.")],
) -> None:
    """Compare two bakes and report the differences."""
    run: Run = ctx.obj
    with run.progress() as progress:
        from baker.comparison.compare import compare

        found = compare(a, b, run.of(DiffSettings), progress)
    report_outcome(found, run, write_text)


def write_text(found: DiffReport, stream: TextIO, *, verbose: int) -> None:
    """Write manifest differences, a table of errors, the worst objects and texels, and failed limits."""
    for warning in found.warnings:
        stream.write(f"warning: {warning.message}\n")
    for entry in found.differences:
        stream.write(f"{entry['what']}: {_brief(entry['a'], verbose)} | {_brief(entry['b'], verbose)}\n")
    for name, objects in (("A", found.only_in_a), ("B", found.only_in_b)):
        for entry in objects:
            stream.write(f"only in {name}: '{entry['object']}' (node {entry['node']})\n")
    if found.unmatched:
        stream.write(f"{found.unmatched} points of A are not on B's surface\n")
    columns = ("texels", "bias", "median", "p95", "p99", "max", "nrmse", "flip")
    stream.write(f"{'':12}" + "".join(f"{name:>11}" for name in columns) + "\n")
    for name, check in found.channels.items():
        stream.write(f"{name:12}" + "".join(f"{_words(check.metrics[c], c):>11}" for c in columns) + "\n")
    most = None if verbose else _SHOWN
    for apart, name, entry in _furthest(found)[:most]:
        bias = entry["channels"][name]["bias"]
        whose = f"'{entry['object']}' (node {entry['node']})"
        stream.write(f"object: {name} of {whose}: bias {bias:+.2%}, p95 {apart:.2%}\n")
    write_worst(found.worst[:most], stream)
    write_failed(found.verdicts, stream)
    verdict_text = ("passed" if found.passed else "FAILED") if found.verdicts else "done"
    stream.write(f"{verdict_text} ({found.seconds:.0f} s)\n")


def _furthest(found: DiffReport) -> list[tuple[float, str, dict[str, Any]]]:
    """Return (p95, channel, object) for each object with an error, the largest p95 first."""
    apart = [
        (float(figures["p95"]), name, entry)
        for entry in found.objects
        for name, figures in entry["channels"].items()
        if figures["p95"]
    ]
    return sorted(apart, key=lambda item: -item[0])


def _brief(value: Any, verbose: int) -> str:
    if value is None:
        return "-"
    text = value if isinstance(value, str) else json.dumps(value)
    return text if verbose or len(text) <= 40 else f"{text[:37]}..."


def _words(value: Any, name: str) -> str:
    if value is None:
        return "-"
    if name == "texels":
        return str(value)
    if name == "flip":
        return f"{value:.4f}"
    return f"{value:+.2%}" if name == "bias" else f"{value:.2%}"
