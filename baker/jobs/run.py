"""Runs the jobs that are not up to date, within limits on the number of processes and on memory."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from baker.core.error_mapping import explain
from baker.core.errors import BakerError, ResourceError
from baker.core.parallel import thread_count
from baker.core.progress import Progress, report
from baker.core.stage import Stage
from baker.io.bake.lock import OutputLock
from baker.io.bake.recovery import abandoned, recover
from baker.io.scene_hash import scene_sha256
from baker.jobs.executor import Event, JobExecutor
from baker.jobs.jobs_file import Job
from baker.jobs.up_to_date import Freshness, check_output

# Longest time between two progress reports, and between two attempts to acquire a lock, seconds.
_LOOK = 0.1


@dataclass(frozen=True)
class BatchOptions:
    """Options of a batch.

    Attributes
    ----------
    threads : int or None
        Threads that all running bakes share; None uses all cores.
    memory : int or None
        Limit of the estimated memory of all running bakes together, bytes; None is no limit.
    force : bool
        Also bake jobs that are up to date, and write into folders that baker did not write.
    fail_fast : bool
        Start no further jobs after a bake has failed. Running jobs continue.
    dry_run : bool
        Only report the jobs that would be baked.
    """

    threads: int | None = None
    memory: int | None = None
    force: bool = False
    fail_fast: bool = False
    dry_run: bool = False


@dataclass(frozen=True)
class Outcome:
    """Result of a job.

    Attributes
    ----------
    job : Job
    state : str
        "baked", "unchanged" or "failed"; in a dry run, the expected state.
    why : str
        The reason for the state, as text for users.
    seconds : float
        Duration of the bake, seconds. If the job was not baked, the duration of its examination or 0.
    code : int
        Exit code for a failed job; 0 otherwise.
    """

    job: Job
    state: str
    why: str
    seconds: float = 0.0
    code: int = 0


@dataclass
class _Ticket:
    """A job that needs a bake, and its progress."""

    number: int
    job: Job
    sha256: str
    seen: Freshness
    peak: int = 0
    lock: OutputLock | None = None
    announced: bool = False
    started: float = 0.0
    stage: str = Stage.START
    fraction: float = 0.0


def run_batch(
    jobs: Sequence[Job],
    executor: JobExecutor,
    options: BatchOptions,
    progress: Progress,
    starting: Callable[[Path], None] = lambda out: None,
) -> list[Outcome]:
    """Bake the jobs that are not up to date, several at a time.

    They are started in the order of `jobs`. If the memory limit or a lock delays a job, later jobs may start
    first.

    Parameters
    ----------
    jobs : sequence of Job
    executor : JobExecutor
        Bakes the jobs; it is closed at the end.
    options : BatchOptions
    progress : Progress
        Called with the progress of all jobs as one stage; a truthy return value stops the batch.
    starting : callable
        Called with each output folder before anything is written to it.

    Returns
    -------
    list of Outcome
        One for each job, in the order of `jobs`.

    Raises
    ------
    Cancelled
        If `progress` returned a truthy value. The output of finished jobs is kept; the output folders of
        other jobs are unchanged.
    """
    try:
        return _Run(jobs, executor, options, progress, starting).run()
    finally:
        executor.close()


@dataclass
class _Run:
    jobs: Sequence[Job]
    executor: JobExecutor
    options: BatchOptions
    progress: Progress
    starting: Callable[[Path], None]
    outcomes: dict[int, Outcome] = field(default_factory=dict)
    waiting: list[_Ticket] = field(default_factory=list)
    running: dict[int, _Ticket] = field(default_factory=dict)

    def run(self) -> list[Outcome]:
        """Examine every job, bake those that need it, and return the outcomes."""
        self.survey()
        if not self.options.dry_run:
            try:
                while self.waiting or self.running:
                    self.start_some()
                    blocked = not self.running and bool(self.waiting)
                    event = self.executor.next_event(_LOOK)
                    if event is not None:
                        self.hear(event)
                    self.report_all(blocked=blocked)
            finally:
                # Keep the locks until the running jobs are stopped and their incomplete writes are undone.
                self.executor.close()
                for ticket in self.running.values():
                    _release(ticket)
        return [self.outcomes[number] for number in range(len(self.jobs))]

    def survey(self) -> None:
        """Examine all jobs in parallel: store the outcome, or queue the job if it needs a bake."""
        pool = ThreadPoolExecutor(thread_count(self.options.threads))
        try:
            examined = [pool.submit(self.examine, number, job) for number, job in enumerate(self.jobs)]
            for number, job_state in enumerate(examined):
                found = job_state.result()
                if isinstance(found, Outcome):
                    self.outcomes[number] = found
                elif self.options.dry_run:
                    self.outcomes[number] = Outcome(found.job, "baked", found.seen.why)
                else:
                    self.waiting.append(found)
                report(self.progress, Stage.BATCH, 0.0, f"looked at {number + 1} of {len(self.jobs)}")
        finally:
            pool.shutdown(wait=True, cancel_futures=True)

    def examine(self, number: int, job: Job) -> Outcome | _Ticket:
        """Return the outcome of a job that is up to date or cannot be baked, else a ticket for the bake."""
        start = time.perf_counter()
        if job.out is None:
            return Outcome(job, "failed", job.problem, code=3)
        try:
            sha256 = scene_sha256(job.scene, allow_outside=job.settings.allow_outside)
            seen = check_output(job.out, sha256, job.settings)
            if self.options.force:
                seen = replace(seen, fresh=False, why=f"forced ({seen.why})")
            elif seen.fresh and not abandoned(job.out):
                return Outcome(job, "unchanged", seen.why, time.perf_counter() - start)
            return _Ticket(number, job, sha256, seen, self.peak(job))
        except (BakerError, OSError, MemoryError) as error:
            return _failure(job, error, time.perf_counter() - start)

    def peak(self, job: Job) -> int:
        """Estimate the peak memory of a job, bytes; return 0 if there is no memory limit."""
        limit = self.options.memory
        if limit is None:
            return 0
        from baker.jobs.memory import estimate_peak, size_words

        peak = estimate_peak(job.scene, job.settings)
        if peak > limit:
            message = f"it needs about {size_words(peak)}, more than `memory` {size_words(limit)}"
            raise ResourceError(f"{message}; allow more, or lower resolution, density or max_pages")
        return peak

    def start_some(self) -> None:
        """Start waiting jobs while slots are free; skip jobs that exceed the free memory or are locked."""
        for ticket in list(self.waiting):
            if len(self.running) >= self.executor.slots:
                return
            used = sum(other.peak for other in self.running.values())
            if self.options.memory is not None and used + ticket.peak > self.options.memory:
                continue
            self.start(ticket)

    def start(self, ticket: _Ticket) -> None:
        """Start a job, unless its output folder is locked or has become up to date."""
        job = ticket.job
        assert job.out is not None
        try:
            if not ticket.announced:
                self.starting(job.out)
                ticket.announced = True
            lock = OutputLock(job.out)
            if not lock.acquire():
                return
            ticket.lock = lock
            self.waiting.remove(ticket)
            recover(job.out)
            if not self.options.force:
                seen = check_output(job.out, ticket.sha256, job.settings)
                # Another run may have baked the job in the meantime.
                if seen.fresh:
                    self.finish(ticket, Outcome(job, "unchanged", seen.why))
                    return
            # Divide the threads by the number of jobs that will run at the same time.
            beside = min(self.executor.slots, len(self.running) + 1 + len(self.waiting))
            threads = max(thread_count(self.options.threads) // beside, 1)
            ticket.started = time.perf_counter()
            self.running[ticket.number] = ticket
            own = job.settings.threads
            self.executor.start(
                ticket.number, job, threads=min(threads, own or threads), force=self.options.force
            )
        except OSError as error:
            if ticket in self.waiting:
                self.waiting.remove(ticket)
            self.running.pop(ticket.number, None)
            self.finish(ticket, _failure(job, error, 0.0))

    def hear(self, event: Event) -> None:
        """Store the progress of a running job, or its outcome if it has ended."""
        ticket = self.running[event.ticket]
        if not event.ended:
            ticket.stage, ticket.fraction = event.stage, event.fraction
            return
        seconds = time.perf_counter() - ticket.started
        del self.running[event.ticket]
        if event.error is None:
            self.finish(ticket, Outcome(ticket.job, "baked", ticket.seen.why, seconds))
            return
        error = event.error
        failure = BakerError(error["message"], file=error["file"], object=error["object"])
        self.finish(ticket, Outcome(ticket.job, "failed", str(failure), seconds, error["code"]))
        if self.options.fail_fast:
            for other in self.waiting:
                why = f"not run, since '{ticket.job.scene}' failed (`fail_fast`)"
                self.outcomes[other.number] = Outcome(other.job, "failed", why, 0.0, error["code"])
            self.waiting.clear()

    def finish(self, ticket: _Ticket, outcome: Outcome) -> None:
        """Store the outcome of a job and release the lock of its folder."""
        self.outcomes[ticket.number] = outcome
        _release(ticket)

    def report_all(self, *, blocked: bool) -> None:
        """Report the progress of all jobs as one stage; `blocked` if other runs lock all waiting jobs."""
        n = len(self.jobs)
        names = [f"{t.job.scene.stem}: {t.stage} {t.fraction:.0%}" for t in self.running.values()]
        if blocked:
            names = ["waiting for another run that bakes the same"]
        detail = "  ".join([f"{len(self.outcomes)} of {n}", *names])
        report(self.progress, Stage.BATCH, len(self.outcomes) / max(n, 1), detail)


def _release(ticket: _Ticket) -> None:
    if ticket.lock is not None:
        ticket.lock.release()
        ticket.lock = None


def _failure(job: Job, error: BaseException, seconds: float) -> Outcome:
    known = explain(error)
    assert known is not None
    return Outcome(job, "failed", str(known), seconds, known.exit_code)


def batch_json(outcomes: Sequence[Outcome], *, dry_run: bool) -> dict[str, Any]:
    """Return the JSON object that `baker batch --json` prints."""
    rows = [
        {
            "scene": str(outcome.job.scene),
            "out": None if outcome.job.out is None else str(outcome.job.out),
            "state": outcome.state,
            "seconds": round(outcome.seconds, 3),
            "why": outcome.why,
        }
        for outcome in outcomes
    ]
    return {"jobs": rows, "dry_run": dry_run}


def write_junit(path: Path, outcomes: Sequence[Outcome], in_words: Callable[[str], str] = str) -> None:
    """Write one JUnit case for each job.

    Parameters
    ----------
    path : Path
        File to write.
    outcomes : sequence of Outcome
        Outcomes in the order of the jobs.
    in_words : callable
        Converts messages that name settings in backticks, for example to flags of the command line.

    Raises
    ------
    ResourceError
        If the file cannot be written.
    """
    from baker.io.junit import Case, junit_text, write_text

    cases = [
        Case(
            str(outcome.job.scene),
            str(outcome.job.out or "batch"),
            in_words(outcome.why) if outcome.state == "failed" else "",
            outcome.seconds,
            error=outcome.code == ResourceError.exit_code,
        )
        for outcome in outcomes
    ]
    write_text(path, junit_text("baker batch", cases))
