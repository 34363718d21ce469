"""`baker verify OUT`: measures the error of a bake against path tracing."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from baker.cli.command import Run, command
from baker.cli.flags import in_flags
from baker.cli.outcome import report_outcome, write_failed, write_limits, write_worst
from baker.core.printable import printable
from baker.metrics.figures import FIGURES, figure_text
from baker.verification.settings import VerifySettings

# Metrics in the columns of the table.
_COLUMNS = (
    "texels", "bias", "colour_bias", "median", "colour_median", "p95", "nrmse", "noise_floor", "z_rms",
)  # fmt: skip

if TYPE_CHECKING:
    from baker.verification.verify import VerifyReport


@command("verify", VerifySettings)
def verify(
    ctx: typer.Context,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of a bake.")],
    report: Annotated[
        Path | None, typer.Option("--report", metavar="FILE", help="Write an HTML page.")
    ] = None,
    junit: Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML.")] = None,
) -> None:
    """Verify a bake and report the error metrics."""
    run: Run = ctx.obj
    with run.progress() as progress:
        from baker.verification.verify import verify

        found = verify(out, run.of(VerifySettings), progress)
        if report is not None:
            from baker.verification.report import write_report

            write_report(report, found, in_flags)
        if junit is not None:
            from baker.verification.junit import write_junit

            write_junit(junit, found, in_flags)
    report_outcome(found, run, write_text)


def write_text(found: VerifyReport, stream: TextIO, *, verbose: int) -> None:
    """Write a table of metrics, the worst regions and texels, the limits, and the verdict."""
    for warning in found.warnings:
        stream.write(f"warning: {warning.message}\n")
    stream.write(f"{'':12}" + "".join(f"{name:>14}" for name in _COLUMNS) + "\n")
    for name, check in found.channels.items():
        cells = "".join(f"{figure_text(column, check.metrics[column]):>14}" for column in _COLUMNS)
        stream.write(f"{name:12}{cells}\n")
        ratio, error = check.metrics["energy_ratio"], check.metrics["energy_ratio_se"]
        if ratio is not None:
            give = "" if error is None else f" +- {error:.4f}"
            stream.write(f"  energy ratio {ratio:.4f}{give}\n")
        if check.unresolved:
            share = check.unresolved / max(len(check.value), 1)
            stream.write(
                f"  {share:.0%} of its texels did not reach the target standard error; see noise_floor\n"
            )
    if verbose:
        for column in _COLUMNS:
            stream.write(f"  {column}: {FIGURES[column].phrase}\n")
    _write_regions(found.regions[: None if verbose else 3], stream)
    write_worst(found.worst[: None if verbose else 3], stream)
    write_limits(found.verdicts, stream, default=found.settings.fail_if is None)
    write_failed(found.verdicts, stream)
    for problem in found.problems:
        stream.write(f"failed: {printable(problem)}\n")
    compiling = f" and {found.compile_seconds:.0f} s of compiling" if found.compile_seconds >= 1 else ""
    single = "" if any(v.limit.metric == "max" for v in found.verdicts) else "single texels have no limit; "
    more = "" if verbose else "-v explains the figures; "
    stream.write(f"{'passed' if found.passed else 'FAILED'}: {printable(found.verdict)}\n")
    stream.write(f"({single}{more}{found.seconds:.0f} s{compiling})\n")


def _write_regions(regions: list[dict[str, Any]], stream: TextIO) -> None:
    for row in regions:
        if row["deviation"] > 0:
            name = printable(row["region"])
            stream.write(
                f"region: {row['channel']} of {name} ({row['texels']} texels, {row['area']:.3g} m2):"
                f" {row['bias']:+.1%} +- {row['bias_se']:.1%}, typically {row['typical']:.1%} off\n"
            )
