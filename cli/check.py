"""`baker check SCENE`: finds defects of scenes before they are baked."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from baker.checks.settings import CheckSettings
from baker.cli.command import Run, command
from baker.cli.failures import FAILED_CHECK
from baker.cli.fix import FixRequest, fix_request, fix_scene, fixed_json, write_fixed_text
from baker.cli.flags import in_flags, values_in_flags
from baker.core.printable import json_text
from baker.core.settings import BakeSettings
from baker.repairs.settings import RepairSettings

if TYPE_CHECKING:
    from baker.checks.run import CheckReport
    from baker.checks.scenes import Unreadable
    from baker.repairs.fix_file import FixResult


@dataclass(frozen=True)
class _Checked:
    """The results of `baker check`.

    Attributes
    ----------
    reports : list of CheckReport
        One for each scene that could be read.
    unreadable : list of Unreadable
        One for each scene that could not be read.
    request : FixRequest or None
        The request of `--fix` or `--repair`; None without these flags.
    fixed : FixResult or None
        The result of the request.
    """

    reports: list[CheckReport]
    unreadable: list[Unreadable]
    request: FixRequest | None
    fixed: FixResult | None


@command("check", BakeSettings, CheckSettings, RepairSettings)
def check(
    ctx: typer.Context,
    scenes: Annotated[list[Path], typer.Argument(metavar="SCENE...", help="Scene files, folders, patterns.")],
    sarif: Annotated[Path | None, typer.Option("--sarif", metavar="FILE", help="Write SARIF 2.1.0.")] = None,
    junit: Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML.")] = None,
    fix: Annotated[
        bool,
        typer.Option("--fix", help="Fix defects without changing the appearance, and check the result."),
    ] = False,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FIXED.glb", help="Output of --fix and --repair.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Let -o replace a file that exists.")] = False,
) -> None:
    """Check the scenes and report the findings. With `--fix`, fix the scene first and check the result."""
    run: Run = ctx.obj
    request = fix_request(scenes, run.of(RepairSettings), fix=fix, out=out, force=force)
    found = _work(run, scenes, request)
    if sarif is not None or junit is not None:
        _write_files(found.reports, sarif=sarif, junit=junit)
    _report(run, found)
    for each in found.unreadable:
        sys.stderr.write(f"baker: {in_flags(str(each.error))}\n")
    if found.unreadable:
        raise typer.Exit(found.unreadable[0].error.exit_code)
    if not all(report.passed for report in found.reports):
        raise typer.Exit(FAILED_CHECK)


def _work(run: Run, scenes: list[Path], request: FixRequest | None) -> _Checked:
    settings, fixed = run.of(BakeSettings), None
    with run.progress() as progress:
        from baker.checks.scenes import check_scenes, find_scenes

        if request is not None:
            run.session.will_write(str(request.out))
            fixed = fix_scene(request, progress)
            # Check the fixed scene with up="y" and scale=1, because it was written in metres with +Y up.
            scenes, settings = [request.out], settings.model_copy(update={"up": "y", "scale": 1.0})
        reports, unreadable = check_scenes(find_scenes(scenes), run.of(CheckSettings), settings, progress)
    return _Checked(reports, unreadable, request, fixed)


def _report(run: Run, found: _Checked) -> None:
    """Write the results as text and, with `--json`, as JSON."""
    from baker.checks.report import report_json, write_text

    settings = run.of(CheckSettings)
    if not run.quiet:
        if found.request is not None and found.fixed is not None:
            write_fixed_text(found.fixed, found.request, run.text)
        for report in found.reports:
            cost = settings.cost or "rates" in run.given
            write_text(report, run.text, verbose=run.verbose, cost=cost)
    if run.as_json:
        more: dict[str, Any] = {}
        if found.request is not None and found.fixed is not None:
            more = fixed_json(found.fixed, found.request)
        run.session.write_json({**report_json(found.reports, found.unreadable), **more})


def _write_files(reports: list[CheckReport], *, sarif: Path | None, junit: Path | None) -> None:
    from baker.io.junit import write_text

    if sarif is not None:
        from baker.checks.sarif import sarif_log

        log = values_in_flags(sarif_log(reports, Path.cwd()))
        write_text(sarif, json_text(log, indent=1, only_ascii=True) + "\n")
    if junit is not None:
        from baker.checks.junit import check_junit

        write_text(junit, in_flags(check_junit(reports)))
