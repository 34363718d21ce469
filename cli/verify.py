"""`baker verify OUT`: how wrong a bake is, against path tracing."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from baker.cli.commands import COMMANDS
from baker.cli.options import build, common_flags, flag, given, setting_flags
from baker.cli.outcome import tell, write_failed, write_limits, write_worst

if TYPE_CHECKING:
    from baker.cli.session import Session
    from baker.verification import Verification


def command() -> Any:
    """Return the subcommand."""
    out = Annotated[Path, typer.Argument(metavar="OUT", help="Output folder of a bake.")]
    keyword = inspect.Parameter.KEYWORD_ONLY
    flags = [
        inspect.Parameter("ctx", keyword, annotation=typer.Context),
        inspect.Parameter("out", keyword, annotation=out),
        flag("texels", int, typer.Option("--texels", metavar="N", help="Texels to judge."), 2000),
        flag(
            "spp",
            int | None,
            typer.Option("--spp", metavar="N", help="Paths for each texel, whatever its error."),
        ),
        flag(
            "target_se",
            float,
            typer.Option(
                "--target-se", metavar="X", help="Relative standard error at which a texel is good enough."
            ),
            0.005,
        ),
        flag(
            "time_limit",
            float | None,
            typer.Option(
                "--time-limit", metavar="SECONDS", help="Time for path tracing (40 without --spp, else none)."
            ),
        ),
        flag(
            "fail_if",
            str | None,
            typer.Option(
                "--fail-if", metavar="EXPR", help='Limits: "irradiance.p95 > 0.05, ao.rmse > 0.02".'
            ),
        ),
        flag("report", Path | None, typer.Option("--report", metavar="FILE", help="Write an HTML page.")),
        flag("junit", Path | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML.")),
        *setting_flags(only={"threads", "seed"}),
        *common_flags(),
    ]
    return build("verify", COMMANDS["verify"], work, flags)


def work(
    *,
    ctx: typer.Context,
    out: Path,
    texels: int,
    spp: int | None,
    target_se: float,
    time_limit: float | None,
    fail_if: str | None,
    report: Path | None,
    junit: Path | None,
    as_json: bool,
    quiet: bool,
    verbose: int,
    **settings: Any,
) -> None:
    """Judge the bake and tell."""
    from baker.cli.config import resolve

    session: Session = ctx.obj
    as_json = as_json or session.as_json
    resolved = resolve(given(settings), None)
    if time_limit is None and spp is None:
        time_limit = 40.0
    with session.reporter(quiet=quiet) as progress:
        progress("start", 0.0)
        from baker.verification import VerifySettings, verification_json, verify

        wanted = VerifySettings(
            texels=texels,
            spp=spp,
            target_se=target_se,
            time_limit=time_limit,
            fail_if=fail_if,
            seed=resolved.seed,
            threads=resolved.threads,
        )
        found = verify(out, wanted, progress)
        if report is not None:
            from baker.verification.report import write_report

            write_report(report, found)
        if junit is not None:
            from baker.verification.junit import write_junit

            write_junit(junit, found)
    tell(found, session, write_text, verification_json, quiet=quiet, as_json=as_json, verbose=verbose)


def write_text(found: Verification, stream: TextIO, *, verbose: int) -> None:
    """Write a table of figures, what failed, and the worst texels."""
    for warning in found.warnings:
        stream.write(f"warning: {warning.message}\n")
    columns = (
        "texels", "bias", "colour_bias", "median", "colour_median", "p95", "nrmse", "noise_floor", "z_rms"
    )  # fmt: skip
    stream.write(f"{'':12}" + "".join(f"{name:>14}" for name in columns) + "\n")
    for name, check in found.channels.items():
        stream.write(f"{name:12}" + "".join(f"{_words(check.figures[c], c):>14}" for c in columns) + "\n")
        ratio, error = check.figures["energy_ratio"], check.figures["energy_ratio_se"]
        if ratio is not None:
            give = "" if error is None else f" +- {error:.4f}"
            stream.write(f"  energy ratio {ratio:.4f}{give}\n")
        if check.unresolved:
            share = check.unresolved / max(len(check.value), 1)
            stream.write(f"  {share:.0%} of its texels stayed noisier than asked for; see noise_floor\n")
    _write_regions(found.regions[: None if verbose else 3], stream)
    write_worst(found.worst[: None if verbose else 3], stream)
    write_limits(found.verdicts, stream)
    write_failed(found.verdicts, stream)
    for problem in found.problems:
        stream.write(f"failed: {problem}\n")
    failed = sum(verdict.failed for verdict in found.verdicts)
    how = f"{failed} of {len(found.verdicts)} limits" if failed else f"{len(found.verdicts)} limits hold"
    single = "" if any(v.limit.figure == "max" for v in found.verdicts) else "; single texels have no limit"
    compiling = f" and {found.compile_seconds:.0f} s of compiling" if found.compile_seconds >= 1 else ""
    verdict = "FAILED" if failed else "passed"
    stream.write(f"{verdict}: {how}{'' if failed else single} ({found.seconds:.0f} s{compiling})\n")


def _write_regions(regions: list[dict[str, Any]], stream: TextIO) -> None:
    for row in regions:
        if row["deviation"] > 0:
            stream.write(
                f"region: {row['channel']} of {row['region']} ({row['texels']} texels, {row['area']:.3g} m2):"
                f" {row['bias']:+.1%} +- {row['bias_se']:.1%}, typically {row['typical']:.1%} off\n"
            )


def _words(value: Any, name: str) -> str:
    if value is None:
        return "-"
    if name in ("texels",):
        return str(value)
    if name == "z_rms":
        return f"{value:.2f}"
    return f"{value:+.2%}" if name.endswith("bias") else f"{value:.2%}"
