"""`baker batch JOBS.toml`: many scenes, and only what changed."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO

import typer

from baker.cli.commands import COMMANDS
from baker.cli.options import build, cluster_flag, common_flags, flag, given, setting_flags

if TYPE_CHECKING:
    from baker.cli.session import Session
    from baker.jobs.executor import Bakery
    from baker.jobs.run import Outcome


def command() -> Any:
    """Return the subcommand."""
    jobs_file = Annotated[Path, typer.Argument(metavar="JOBS.toml", help="List of scenes and settings.")]
    keyword = inspect.Parameter.KEYWORD_ONLY
    flags = [
        inspect.Parameter("ctx", keyword, annotation=typer.Context),
        inspect.Parameter("jobs_file", keyword, annotation=jobs_file),
        flag("jobs", int, typer.Option("--jobs", metavar="N", min=1, max=1024, help="Bakes at a time."), 1),
        flag(
            "memory",
            str | None,
            typer.Option(
                "--memory", metavar="SIZE", help="Memory of all bakes together, like 8G; jobs wait for it."
            ),
        ),
        flag(
            "dry_run", bool, typer.Option("--dry-run", help="Only say what would be baked, and why."), False
        ),
        flag(
            "fail_fast", bool, typer.Option("--fail-fast", help="Start nothing more after a failure."), False
        ),
        flag(
            "force",
            bool,
            typer.Option("--force", help="Bake all, and replace outputs even if baker did not write them."),
            False,
        ),
        flag("junit", Path | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML.")),
        cluster_flag(),
        *setting_flags(only={"threads", "seed"}),
        *common_flags(),
    ]
    return build("batch", COMMANDS["batch"], work, flags)


def work(
    *,
    ctx: typer.Context,
    jobs_file: Path,
    jobs: int,
    memory: str | None,
    dry_run: bool,
    fail_fast: bool,
    force: bool,
    junit: Path | None,
    cluster: str | None,
    as_json: bool,
    quiet: bool,
    verbose: int,
    **settings: Any,
) -> None:
    """Bake what changed, show one progress for all, and tell."""
    session: Session = ctx.obj
    as_json = as_json or session.as_json
    from baker.cli.config import resolve
    from baker.jobs.executor import LocalBakery
    from baker.jobs.jobs_file import read_jobs
    from baker.jobs.memory import parse_size
    from baker.jobs.run import BatchOptions, batch_json, run_batch, write_junit

    overrides = given(settings)
    options = BatchOptions(
        threads=resolve(overrides, None).threads,
        memory=None if memory is None else parse_size(memory),
        force=force,
        fail_fast=fail_fast,
        dry_run=dry_run,
    )
    overrides.pop("threads", None)
    todo = read_jobs(jobs_file, overrides)
    with session.reporter(quiet=quiet) as progress:
        bakery = LocalBakery(jobs) if cluster is None or dry_run else _on_cluster(cluster, options.threads)
        outcomes = run_batch(todo, bakery, options, progress, lambda out: session.will_write(str(out)))
    if junit is not None:
        write_junit(junit, outcomes)
    if not quiet:
        write_table(outcomes, session.text_stream(as_json=as_json), dry_run=dry_run)
    if as_json:
        session.write_json(batch_json(outcomes, dry_run=dry_run))
    code = max((outcome.code for outcome in outcomes), default=0)
    if code:
        raise typer.Exit(code)


def _on_cluster(address: str, threads: int | None) -> Bakery:
    from baker.core.parallel import thread_count
    from baker.distributed.connection import Cluster
    from baker.distributed.job_executor import ClusterBakery

    return ClusterBakery(Cluster(address, threads=thread_count(threads)))


def write_table(outcomes: Sequence[Outcome], stream: TextIO, *, dry_run: bool) -> None:
    """Write a line for each job and the sums."""
    words = {"baked": "would bake"} if dry_run else {}
    width = max(len(str(outcome.job.scene)) for outcome in outcomes)
    for outcome in outcomes:
        state = words.get(outcome.state, outcome.state)
        scene = str(outcome.job.scene)
        stream.write(f"{state:<10}  {scene:<{width}}  {outcome.seconds:8.2f} s  {outcome.why}\n")
    sums = [
        f"{sum(outcome.state == state for outcome in outcomes)} {words.get(state, state)}"
        for state in ("baked", "unchanged", "failed")
    ]
    stream.write(", ".join(sums) + "\n")
