"""Runs a job file, and defines the report of its outcomes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from baker.core.progress import Progress, silent
from baker.core.result import Result
from baker.jobs.executor import JobExecutor, LocalJobExecutor
from baker.jobs.jobs_file import read_jobs
from baker.jobs.memory import parse_size
from baker.jobs.run import BatchOptions, Outcome, batch_json, run_batch
from baker.jobs.settings import BatchSettings


@dataclass(frozen=True, repr=False)
class BatchReport(Result):
    """The outcomes of all jobs of a batch.

    Attributes
    ----------
    outcomes : list of Outcome
        One for each job, in the order of the job file.
    dry_run : bool
        Whether nothing was baked, so that `outcomes` has the states that are expected.
    """

    outcomes: list[Outcome]
    dry_run: bool = False

    @property
    def passed(self) -> bool:
        """Return whether no job failed."""
        return not any(outcome.code for outcome in self.outcomes)

    def summary(self) -> dict[str, Any]:
        """Return the number of jobs in each state."""
        counts = Counter(outcome.state for outcome in self.outcomes)
        return {state: counts[state] for state in ("baked", "unchanged", "failed")}

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object that `baker batch --json` prints."""
        return batch_json(self.outcomes, dry_run=self.dry_run)


def run_jobs_file(
    jobs_file: Path,
    settings: BatchSettings,
    progress: Progress = silent,
    *,
    executor: Callable[[], JobExecutor] | None = None,
    starting: Callable[[Path], None] = lambda out: None,
) -> BatchReport:
    """Bake the jobs of a file that are not up to date.

    Parameters
    ----------
    jobs_file : Path
        TOML file of scenes and settings, see `baker.jobs.jobs_file`.
    settings : BatchSettings
        Settings of the batch: processes, memory, seed and others.
    progress : Progress
        Called with the progress of all jobs as one stage; a truthy return value stops the batch.
    executor : callable, optional
        Returns the executor of the jobs. The default runs processes on this machine. Not called in a dry run.
    starting : callable
        Called with each output folder before anything is written to it.

    Returns
    -------
    BatchReport
        The outcome of each job.

    Raises
    ------
    InputError
        If the file cannot be read.
    SettingsError
        If the file is not TOML, a setting in it is invalid, or `memory` is not a size.
    Cancelled
        If `progress` returned a truthy value.
    """
    options = BatchOptions(
        threads=settings.threads,
        memory=None if settings.memory is None else parse_size(settings.memory),
        force=settings.force,
        fail_fast=settings.fail_fast,
        dry_run=settings.dry_run,
    )
    todo = read_jobs(jobs_file, {} if settings.seed is None else {"seed": settings.seed})
    workers = LocalJobExecutor(settings.jobs) if executor is None or settings.dry_run else executor()
    return BatchReport(run_batch(todo, workers, options, progress, starting), settings.dry_run)
