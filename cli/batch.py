"""`baker batch JOBS.toml`: bakes the scenes of a jobs file that are not up to date."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TextIO

import typer

from baker.cli.command import Cluster, Run, command
from baker.cli.flags import in_flags
from baker.jobs.settings import BatchSettings

if TYPE_CHECKING:
    from baker.jobs.executor import JobExecutor
    from baker.jobs.run import Outcome


@command("batch", BatchSettings)
def batch(
    ctx: typer.Context,
    jobs_file: Annotated[Path, typer.Argument(metavar="JOBS.toml", help="List of scenes and settings.")],
    junit: Annotated[Path | None, typer.Option("--junit", metavar="FILE", help="Write JUnit XML.")] = None,
    cluster: Cluster = None,
) -> None:
    """Bake the jobs that are not up to date, show progress, and print the results."""
    from baker.jobs.report import run_jobs_file
    from baker.jobs.run import write_junit

    run: Run = ctx.obj
    settings = run.of(BatchSettings)
    with run.session.reporter(quiet=run.quiet) as progress:
        report = run_jobs_file(
            jobs_file,
            settings,
            progress,
            executor=None if cluster is None else partial(_on_cluster, cluster, settings.threads),
            starting=lambda out: run.session.will_write(str(out)),
        )
    if junit is not None:
        write_junit(junit, report.outcomes, in_flags)
    if not run.quiet:
        write_table(report.outcomes, run.text, dry_run=settings.dry_run)
    if run.as_json:
        run.session.write_json(report.to_dict())
    code = max((outcome.code for outcome in report.outcomes), default=0)
    if code:
        raise typer.Exit(code)


def _on_cluster(address: str, threads: int | None) -> JobExecutor:
    from baker.core.parallel import thread_count
    from baker.distributed.connection import Cluster as Connection
    from baker.distributed.job_executor import DistributedJobExecutor

    return DistributedJobExecutor(Connection(address, threads=thread_count(threads)))


def write_table(outcomes: Sequence[Outcome], stream: TextIO, *, dry_run: bool) -> None:
    """Write one line for each job, and a line with the number of jobs in each state."""
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
