"""`baker check SCENE`: finds what would spoil a bake, before any ray is cast."""

from __future__ import annotations

import inspect
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from baker.cli.commands import COMMANDS
from baker.cli.failures import FAILED_CHECK
from baker.cli.fix import asked, mend, mend_flags, mended_json, write_mended_text
from baker.cli.options import build, common_flags, flag, given, setting_flags

if TYPE_CHECKING:
    from baker.checks.run import CheckReport
    from baker.checks.settings import CheckSettings
    from baker.cli.session import Session


def command() -> Any:
    """Return the subcommand."""
    scenes = Annotated[list[Path], typer.Argument(metavar="SCENE...", help="Scene files, folders, patterns.")]
    keyword = inspect.Parameter.KEYWORD_ONLY
    flags = [
        inspect.Parameter("ctx", keyword, annotation=typer.Context),
        inspect.Parameter("scenes", keyword, annotation=scenes),
        flag(
            "fail_on",
            Literal["warning", "error"] | None,
            typer.Option("--fail-on", help="Least severity that fails the check (default error)."),
        ),
        flag(
            "ignore",
            list[str] | None,
            typer.Option("--ignore", metavar="CODE[@OBJECT]", help="Findings that do not count; repeatable."),
        ),
        flag("config", Path | None, typer.Option("--config", metavar="FILE", help="TOML file of settings.")),
        flag(
            "sarif",
            Path | None,
            typer.Option("--sarif", metavar="FILE", help="Write SARIF 2.1.0."),
        ),
        flag(
            "junit",
            Path | None,
            typer.Option("--junit", metavar="FILE", help="Write JUnit XML."),
        ),
        flag(
            "mip",
            int | None,
            typer.Option("--mip", metavar="N", help="Mip level at which charts must not mix (default 2)."),
        ),
        flag(
            "rates",
            Path | None,
            typer.Option(
                "--rates",
                metavar="OUT",
                help="Reckon time with the speed of this earlier bake (else of one beside SCENE).",
            ),
        ),
        flag(
            "cost",
            bool,
            typer.Option("--cost", help="Tell what a bake will take; measures a second's worth of rays."),
            False,
        ),
        *mend_flags(),
        *setting_flags(),
        *common_flags(),
    ]
    return build("check", COMMANDS["check"], work, flags)


def work(
    *,
    ctx: typer.Context,
    scenes: list[Path],
    fail_on: str | None,
    ignore: list[str] | None,
    config: Path | None,
    sarif: Path | None,
    junit: Path | None,
    mip: int | None,
    rates: Path | None,
    cost: bool,
    fix: bool,
    repair: bool,
    out: Path | None,
    force: bool,
    as_json: bool,
    quiet: bool,
    verbose: int,
    **settings: Any,
) -> None:
    """Check every scene and tell."""
    from baker.cli.config import resolve

    session: Session = ctx.obj
    as_json = as_json or session.as_json
    resolved = resolve(given(settings), config)
    request = asked(scenes, fix=fix, repair=repair, out=out, force=force)
    mended = None
    with session.reporter(quiet=quiet) as progress:
        progress("start", 0.0)
        from baker.checks.report import report_json, write_text
        from baker.checks.scenes import check_scenes, find_scenes

        wanted = check_settings(
            config, fail_on=fail_on, ignore=ignore, mip=mip, rates=rates, cost=cost or None
        )
        if request is not None:
            session.will_write(str(request.out))
            mended = mend(request, resolved, progress)
            # What is left is judged as it was written: in metres, +Y up.
            scenes, resolved = [request.out], resolved.model_copy(update={"up": "y", "scale": 1.0})
        reports, unreadable = check_scenes(find_scenes(scenes), wanted, resolved, progress)
        _write_files(reports, sarif=sarif, junit=junit)
    if not quiet:
        if request is not None and mended is not None:
            write_mended_text(mended, request, session.text_stream(as_json=as_json))
        for report in reports:
            write_text(
                report, session.text_stream(as_json=as_json), verbose=verbose, cost=cost or rates is not None
            )
    if as_json:
        more = mended_json(mended, request) if request is not None and mended is not None else {}
        session.write_json({**report_json(reports, unreadable), **more})
    for each in unreadable:
        sys.stderr.write(f"baker: {each.error}\n")
    if unreadable:
        raise typer.Exit(unreadable[0].error.exit_code)
    if not all(report.passed for report in reports):
        raise typer.Exit(FAILED_CHECK)


def check_settings(config: Path | None, **command_line: Any) -> CheckSettings:
    """Return the settings of a check: the file's table `[check]`, then the command line; `ignore` adds up.

    Raises
    ------
    SettingsError
        For an unknown key or a wrong value.
    """
    from baker.checks.settings import make_check_settings
    from baker.cli.config import read_check_config

    table = {} if config is None else read_check_config(config)
    from_file = make_check_settings(table, where=str(config))
    said = {key: value for key, value in command_line.items() if value is not None}
    if "rates" in said:
        said["rates"] = str(said["rates"])
    said["ignore"] = [*from_file.ignore, *said.get("ignore", [])]
    return make_check_settings({**vars(from_file), **said})


def _write_files(reports: list[CheckReport], *, sarif: Path | None, junit: Path | None) -> None:
    from baker.io.junit import write_text

    if sarif is not None:
        import json

        from baker.checks.sarif import sarif_log

        write_text(sarif, json.dumps(sarif_log(reports, Path.cwd()), indent=1, allow_nan=False) + "\n")
    if junit is not None:
        from baker.checks.junit import check_junit

        write_text(junit, check_junit(reports))
