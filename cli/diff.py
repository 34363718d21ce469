"""`baker diff A B`: compares two bakes at the same surface points."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from baker.cli.command import Run, command
from baker.cli.outcome import report_outcome, write_failed, write_worst
from baker.comparison.settings import DiffSettings
from baker.core.printable import json_text, printable
from baker.core.readable import percent
from baker.metrics.figures import FIGURES, figure_text

if TYPE_CHECKING:
    from baker.comparison.compare import DiffReport

# Largest number of objects, and of texels, that are shown without --verbose.
_SHOWN = 3
# Metrics in the columns of the table.
_COLUMNS = ("texels", "bias", "colour_bias", "median", "p95", "colour_p95", "max", "nrmse", "flip")
# Ratio of colour_p95 to p95 above which the last line mentions colours.
_COLOUR = 1.5


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
        stream.write(printable(f"{entry['what']}: {_difference(entry, verbose)}") + "\n")
    for name, objects in (("A", found.only_in_a), ("B", found.only_in_b)):
        for entry in objects:
            stream.write(f"only in {name}: '{printable(entry['object'])}' (node {entry['node']})\n")
    if found.unmatched:
        stream.write(f"{found.unmatched} points of A are not on B's surface\n")
    stream.write(f"{'':12}" + "".join(f"{name:>13}" for name in _COLUMNS) + "\n")
    for name, check in found.channels.items():
        cells = "".join(f"{figure_text(column, check.metrics[column]):>13}" for column in _COLUMNS)
        stream.write(f"{name:12}{cells}\n")
    if verbose:
        for column in _COLUMNS:
            stream.write(f"  {column}: {FIGURES[column].phrase}\n")
    most = None if verbose else _SHOWN
    for _, name, entry in _furthest(found)[:most]:
        figures = entry["channels"][name]
        shown = ", ".join(
            f"{column} {figure_text(column, figures[column])}" for column in ("bias", "p95", "colour_p95")
        )
        stream.write(f"object: {name} of '{printable(entry['object'])}' (node {entry['node']}): {shown}\n")
    write_worst(found.worst[:most], stream)
    write_failed(found.verdicts, stream)
    verdict_text = ("passed" if found.passed else "FAILED") if found.verdicts else "done"
    stream.write(f"{verdict_text}: {_sentence(found)} ({found.seconds:.0f} s)\n")


def _sentence(found: DiffReport) -> str:
    """Return one sentence about the differences between A and B."""
    parts = []
    for name, check in found.channels.items():
        metrics = check.metrics
        if not metrics["rmse"]:
            continue
        side = "brighter" if metrics["bias"] > 0 else "darker"
        text = f"{name} of A is {percent(abs(metrics['bias']))} {side} than of B on average"
        text += f" and differs by less than {percent(metrics['p95'])} at 95 of 100 points"
        if metrics["colour_p95"] > _COLOUR * metrics["p95"]:
            text += f", but in colour by up to {percent(metrics['colour_p95'])} there"
        parts.append(text)
    if not parts:
        return "A and B are equal at all compared points"
    return "; ".join(parts)


def _furthest(found: DiffReport) -> list[tuple[float, str, dict[str, Any]]]:
    """Return (error, channel, object) for each channel of each object, the largest error first.

    The error is the larger of p95 and colour_p95. Channels of objects without errors are left out.
    """
    apart = [
        (max(float(figures["p95"]), float(figures["colour_p95"])), name, entry)
        for entry in found.objects
        for name, figures in entry["channels"].items()
        if figures["p95"] or figures["colour_p95"]
    ]
    return sorted(apart, key=lambda item: -item[0])


def _difference(entry: dict[str, Any], verbose: int) -> str:
    """Return the two values of an entry that differs; for lights, each property that differs."""
    a, b = entry["a"], entry["b"]
    if not entry["what"].startswith("lights."):
        return f"{_brief(a, verbose)} | {_brief(b, verbose)}"
    if not isinstance(a, dict) or not isinstance(b, dict):
        name, light = ("A", a) if b is None else ("B", b)
        return f"only in {name}: {_properties(light)}"
    keys = [key for key in dict.fromkeys([*a, *b]) if a.get(key) != b.get(key)]
    return "; ".join(f"{key} {_value(a.get(key), b.get(key))}" for key in keys)


def _properties(light: Any) -> str:
    if not isinstance(light, dict):
        return json_text(light)
    return ", ".join(f"{key} {_rounded(value)}" for key, value in light.items())


def _value(a: Any, b: Any) -> str:
    """Return two values with six significant digits, or with all digits if the first six are equal."""
    texts = _rounded(a), _rounded(b)
    if texts[0] == texts[1]:
        texts = json_text(a), json_text(b)
    return f"{texts[0]} | {texts[1]}"


def _rounded(value: Any) -> str:
    if value is None:
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        return f"[{', '.join(map(_rounded, value))}]"
    return value if isinstance(value, str) else json_text(value)


def _brief(value: Any, verbose: int) -> str:
    text = _rounded(value)
    return text if verbose or len(text) <= 40 else f"{text[:37]}..."
