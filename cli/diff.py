"""`baker diff A B`: how two bakes differ, on the surface."""

from __future__ import annotations

import inspect
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from baker.cli.commands import COMMANDS
from baker.cli.options import build, common_flags, flag, given, setting_flags
from baker.cli.outcome import tell, write_failed, write_worst

if TYPE_CHECKING:
    from baker.cli.session import Session
    from baker.comparison import Difference

_SHOWN = 3


def command() -> Any:
    """Return the subcommand."""
    a = Annotated[Path, typer.Argument(metavar="A", help="Output folder of a bake.")]
    b = Annotated[Path, typer.Argument(metavar="B", help="Output folder of the bake it is compared with.")]
    keyword = inspect.Parameter.KEYWORD_ONLY
    flags = [
        inspect.Parameter("ctx", keyword, annotation=typer.Context),
        inspect.Parameter("a", keyword, annotation=a),
        inspect.Parameter("b", keyword, annotation=b),
        flag("texels", int, typer.Option("--texels", metavar="N", help="Texels of A to compare."), 20000),
        flag("flip", bool, typer.Option("--flip/--no-flip", help="Compare pages as pictures, too."), True),
        flag(
            "fail_if",
            str | None,
            typer.Option(
                "--fail-if", metavar="EXPR", help='Limits: "irradiance.p95 > 0.05, ao.flip > 0.02".'
            ),
        ),
        *setting_flags(only={"threads", "seed"}),
        *common_flags(),
    ]
    return build("diff", COMMANDS["diff"], work, flags)


def work(
    *,
    ctx: typer.Context,
    a: Path,
    b: Path,
    texels: int,
    flip: bool,
    fail_if: str | None,
    as_json: bool,
    quiet: bool,
    verbose: int,
    **settings: Any,
) -> None:
    """Compare the bakes and tell."""
    from baker.cli.config import resolve

    session: Session = ctx.obj
    as_json = as_json or session.as_json
    resolved = resolve(given(settings), None)
    with session.reporter(quiet=quiet) as progress:
        progress("start", 0.0)
        from baker.comparison import DiffSettings, compare, difference_json

        wanted = DiffSettings(texels=texels, flip=flip, fail_if=fail_if, seed=resolved.seed)
        found = compare(a, b, wanted, progress)
    tell(found, session, write_text, difference_json, quiet=quiet, as_json=as_json, verbose=verbose)


def write_text(found: Difference, stream: TextIO, *, verbose: int) -> None:
    """Write what differs, a table of figures, the objects and places furthest apart, and what failed."""
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
        stream.write(f"{name:12}" + "".join(f"{_words(check.figures[c], c):>11}" for c in columns) + "\n")
    most = None if verbose else _SHOWN
    for apart, name, entry in _furthest(found)[:most]:
        bias = entry["channels"][name]["bias"]
        whose = f"'{entry['object']}' (node {entry['node']})"
        stream.write(f"object: {name} of {whose}: bias {bias:+.2%}, p95 {apart:.2%}\n")
    write_worst(found.worst[:most], stream)
    write_failed(found.verdicts, stream)
    verdict_text = ("passed" if found.passed else "FAILED") if found.verdicts else "done"
    stream.write(f"{verdict_text} ({found.seconds:.0f} s)\n")


def _furthest(found: Difference) -> list[tuple[float, str, dict[str, Any]]]:
    """Return (p95, channel, object) of objects that differ, the furthest first."""
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
