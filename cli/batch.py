"""`baker batch JOBS.toml`: many scenes, and only what changed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer

from baker.cli.command import Cluster, Run, command
from baker.core.settings_model import RunSettings

if TYPE_CHECKING:
    from baker.jobs.executor import Bakery
    from baker.jobs.run import Outcome


@command("batch", RunSettings)
def batch(
    ctx: typer.Context,
    jobs_file: Annotated[Path, typer.Argument(metavar="JOBS.toml", help="List of scenes and settings.")],
    jobs: Annotated[int, typer.Option("--jobs", metavar="N", min=1, max=1024, help="Bakes at a time.")] = 1,
    memory: Annotated[
        str | None,
        typer.Option(
            "--memory", metavar="SIZE", help="Memory of all bakes together, like 8G; jobs wait for it."
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only report what would be baked, and why.")
    ] = False,
    fail_fast: Annotated[
        bool, typer.Option("--fail-fast", help="Start nothing more after a failure.")
    ] = False,
    force: Annotated[
        bool,
        typer.Option("--force", help="Bake all, and replace outputs even if baker did not write them."),
    ] = False,
    junit: Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML.")] = None,
    cluster: Cluster = None,
) -> None:
    """Bake what changed, show one progress for all, and report."""
    from baker.jobs.executor import LocalBakery
    from baker.jobs.jobs_file import read_jobs
    from baker.jobs.memory import parse_size
    from baker.jobs.run import BatchOptions, batch_json, run_batch, write_junit

    run: Run = ctx.obj
    overrides = dict(run.given)
    options = BatchOptions(
        threads=run.of(RunSettings).threads,
        memory=None if memory is None else parse_size(memory),
        force=force,
        fail_fast=fail_fast,
        dry_run=dry_run,
    )
    overrides.pop("threads", None)
    todo = read_jobs(jobs_file, overrides)
    with run.session.reporter(quiet=run.quiet) as progress:
        bakery = LocalBakery(jobs) if cluster is None or dry_run else _on_cluster(cluster, options.threads)
        outcomes = run_batch(todo, bakery, options, progress, lambda out: run.session.will_write(str(out)))
    if junit is not None:
        write_junit(junit, outcomes)
    if not run.quiet:
        write_table(outcomes, run.text, dry_run=dry_run)
    if run.as_json:
        run.session.write_json(batch_json(outcomes, dry_run=dry_run))
    code = max((outcome.code for outcome in outcomes), default=0)
    if code:
        raise typer.Exit(code)


def _on_cluster(address: str, threads: int | None) -> Bakery:
    from baker.core.parallel import thread_count
    from baker.distributed.connection import Cluster as Connection
    from baker.distributed.job_executor import DistributedJobExecutor

    return DistributedJobExecutor(Connection(address, threads=thread_count(threads)))


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
