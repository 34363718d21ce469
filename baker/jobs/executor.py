"""Defines the interface `JobExecutor`, and implements it with worker processes on this machine."""

from __future__ import annotations

import contextlib
import json
import os
import queue
import subprocess
import threading
from dataclasses import dataclass, replace
from typing import Any, Protocol

from baker.core.child_process import start_module
from baker.core.stage import Stage
from baker.io.bake.recovery import recover
from baker.jobs.jobs_file import Job


@dataclass(frozen=True)
class Event:
    """A progress report of a job, or its end.

    Attributes
    ----------
    ticket : int
        Number of the job, as given to `start`.
    stage : str
    fraction : float
        Completed share of the stage, 0 to 1.
    ended : bool
        Whether the job has ended, successfully or not.
    error : dict or None
        {kind, message, file, object, code} if the job failed; None otherwise.
    """

    ticket: int
    stage: str = ""
    fraction: float = 0.0
    ended: bool = False
    error: dict[str, Any] | None = None


class JobExecutor(Protocol):
    """Bakes up to `slots` jobs at the same time."""

    @property
    def slots(self) -> int:
        """Return the number of jobs that may run at the same time."""

    def start(self, ticket: int, job: Job, *, threads: int, force: bool) -> None:
        """Start a job. The caller must not start a job while `slots` jobs are running."""

    def next_event(self, timeout: float) -> Event | None:
        """Return the next event of any job.

        None if there is no event within `timeout` seconds. None may also be returned earlier, for example if
        an idle worker has died.
        """

    def close(self) -> None:
        """Stop all jobs immediately; the output folders of unfinished jobs keep their old content."""


@dataclass(frozen=True)
class _Work:
    """A job and its arguments of `start`. `again` is true if a worker has died while it baked the job."""

    ticket: int
    job: Job
    threads: int
    force: bool
    again: bool = False


class LocalJobExecutor:
    """Bakes in worker processes; each process bakes one job after another.

    If a process dies during a job, a new process repeats the job. If that process dies, too, the job fails.

    Parameters
    ----------
    slots : int
        Largest number of processes that bake at the same time. A process is started if none is idle.
    """

    def __init__(self, slots: int) -> None:
        self.slots = slots
        self._heard: queue.SimpleQueue[tuple[_Worker, dict[str, Any]]] = queue.SimpleQueue()
        self._idle: list[_Worker] = []
        self._busy: dict[_Worker, _Work] = {}

    def start(self, ticket: int, job: Job, *, threads: int, force: bool) -> None:
        """Send a job to an idle worker, or to a new worker if none is idle."""
        worker = self._idle.pop() if self._idle else _Worker(self._heard)
        self._begin(worker, _Work(ticket, job, threads, force))

    def _begin(self, worker: _Worker, work: _Work) -> None:
        self._busy[worker] = work
        worker.begin(work.job, threads=work.threads, force=work.force)

    def next_event(self, timeout: float) -> Event | None:
        """Return the next event of any busy worker.

        None if there is no event within `timeout` seconds, or as soon as an idle worker has died.
        """
        try:
            worker, message = self._heard.get(timeout=timeout)
        except queue.Empty:
            return None
        if worker not in self._busy:
            # The worker died between two jobs.
            self._idle = [other for other in self._idle if other is not worker]
            return None
        work = self._busy[worker]
        if "stage" in message:
            return Event(work.ticket, message["stage"], message["fraction"])
        del self._busy[worker]
        if "died" not in message:
            self._idle.append(worker)
            return Event(work.ticket, ended=True, error=message.get("error"))
        worker.end(work.job)
        if work.again:
            return Event(work.ticket, ended=True, error=_death(message["died"]))
        return self._repeat(work)

    def _repeat(self, work: _Work) -> Event:
        """Start a job again in a new worker, because an idle worker may be dead, too."""
        try:
            worker = _Worker(self._heard)
        except OSError as error:
            why = f"its process died, and no new process could be started ({error.strerror})"
            return Event(work.ticket, ended=True, error=_lost(why))
        self._begin(worker, replace(work, again=True))
        return Event(work.ticket, Stage.START)

    def close(self) -> None:
        """Kill all workers. Undo their incomplete writes to output folders, and delete temporary folders."""
        for worker in self._idle:
            worker.end(None)
        for worker, work in self._busy.items():
            worker.end(work.job)
        self._busy.clear()
        self._idle.clear()


class _Worker:
    """A worker process, and the thread that reads its messages."""

    def __init__(self, heard: queue.SimpleQueue[tuple[_Worker, dict[str, Any]]]) -> None:
        self.heard = heard
        self.process: subprocess.Popen[bytes] = start_module("baker.jobs.worker")
        self.listener = threading.Thread(target=self._listen, daemon=True)
        self.listener.start()

    def begin(self, job: Job, *, threads: int, force: bool) -> None:
        settings = job.settings.model_dump(mode="json", exclude_none=True, exclude_unset=True) | {
            "threads": threads
        }
        task = {"scene": os.fspath(job.scene), "out": str(job.out), "settings": settings, "force": force}
        assert self.process.stdin is not None
        # If the process has died, writing fails, and the listening thread reports the death.
        with contextlib.suppress(OSError):
            self.process.stdin.write(json.dumps(task).encode() + b"\n")
            self.process.stdin.flush()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.heard.put((self, json.loads(line)))
        self.heard.put((self, {"died": self.process.wait()}))

    def end(self, job: Job | None) -> None:
        """Kill the process. If `job` is given, undo an incomplete write to its output folder.

        The temporary folders of this output folder are deleted.
        """
        self.process.kill()
        self.process.wait()
        self.listener.join()
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                with contextlib.suppress(OSError):
                    pipe.close()
        if job is not None and job.out is not None:
            recover(job.out)


def _death(status: int) -> dict[str, Any]:
    # Status -9 is SIGKILL, sent by a user or by the operating system if memory runs out. Other negative
    # numbers are signals, mostly crashes of native code. Positive numbers are exit codes.
    if status == -9:
        return _lost("its process was killed twice, most likely for lack of memory")
    return _lost(f"its process died twice (status {status})")


def _lost(why: str) -> dict[str, Any]:
    hint = "try a smaller resolution or fewer jobs at a time"
    return {"kind": "resource", "message": f"{why}; {hint}", "file": None, "object": None, "code": 4}
