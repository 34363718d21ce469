"""`baker check SCENE`: finds what would spoil a bake, before any ray is cast."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from baker.cli.app import COMMANDS
from baker.cli.failures import FAILED_CHECK
from baker.cli.mend import asked, mend, mend_flags, mended_json, write_mended_text
from baker.cli.options import build, common_flags, flag, given, setting_flags

if TYPE_CHECKING:
    from baker.cli.session import Session


def command() -> Any:
    """Return the subcommand."""
    scenes = Annotated[list[Path], typer.Argument(metavar="SCENE...", help="Scene files.")]
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
        from baker.checking import CheckSettings, check_scene, report_json
        from baker.checking.report import write_text

        wanted = CheckSettings(fail_on=fail_on or "error", ignore=tuple(ignore or ()))
        if request is not None:
            session.will_write(str(request.out))
            mended = mend(request, resolved, progress)
            # What is left is judged as it was written: in metres, +Y up.
            scenes, resolved = [request.out], resolved.model_copy(update={"up": "y", "scale": 1.0})
        reports = [check_scene(scene, wanted, resolved, progress) for scene in scenes]
    if not quiet:
        if request is not None and mended is not None:
            write_mended_text(mended, request, session.text_stream(as_json=as_json))
        for report in reports:
            write_text(report, session.text_stream(as_json=as_json), verbose=verbose)
    if as_json:
        more = mended_json(mended, request) if request is not None and mended is not None else {}
        session.write_json({**report_json(reports), **more})
    if not all(report.passed for report in reports):
        raise typer.Exit(FAILED_CHECK)
