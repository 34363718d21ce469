"""Runs chart jobs in this process, or in worker processes that end before the call returns."""

from __future__ import annotations

import contextlib
import queue
import signal
import subprocess
import threading
from collections.abc import Sequence

import numpy as np

from baker.core.child_process import start_module
from baker.core.errors import ResourceError
from baker.core.progress import Progress, report
from baker.core.stage import Stage
from baker.uv.worker import receive_charts, send_job
from baker.uv.xatlas_charts import ChartJob, FlatCharts, cut_charts

# Limit of the number of triangles of all jobs. Below this limit, the jobs run in this process, because
# starting a worker process takes 0.2 s, which is longer than cutting the triangles.
IN_PROCESS_TRIANGLES = 3000
# Time to wait for the end of a worker process after its pipe has closed, seconds. The process is then killed.
_MOMENT = 1.0
# Values of `Popen.returncode` of a process in which native code crashed.
_CRASHES = {-getattr(signal, name, 0) for name in ("SIGSEGV", "SIGABRT", "SIGBUS", "SIGFPE", "SIGILL")}
_LOST = (
    "a process that cuts charts has died twice, most likely for lack of memory; close other programs, or "
    "use fewer `threads`"
)


def run_jobs(jobs: Sequence[ChartJob], threads: int, progress: Progress, until: float) -> list[FlatCharts]:
    """Cut the parts of all jobs into charts. The result does not depend on `threads`.

    Parameters
    ----------
    jobs : sequence of ChartJob
        The jobs.
    threads : int
        Largest number of worker processes.
    progress : Progress
        Called with fractions of the stage from 0 to `until`.
    until : float
        Fraction of the stage to report when all jobs are done.

    Returns
    -------
    list of FlatCharts
        Charts of each job, in the order of `jobs`. If xatlas crashed twice on a job, all triangles of this
        job have chart -1.

    Raises
    ------
    Cancelled
        If `progress` returned a truthy value. The worker processes are then killed.
    ResourceError
        If a worker process was lost twice at one job for another reason than a crash.
    """
    total = sum(len(job.triangle) for job in jobs)
    if total < IN_PROCESS_TRIANGLES:
        report(progress, Stage.UNWRAP, 0.0)
        return [cut_charts(job) for job in jobs]
    return _Pool(jobs, min(threads, len(jobs)), total).run(progress, until)


class _Pool:
    """Worker processes. A thread for each process sends it jobs. The largest jobs are started first."""

    def __init__(self, jobs: Sequence[ChartJob], n_workers: int, total: int) -> None:
        self.jobs = jobs
        self.total = total
        self.results: list[FlatCharts | None] = [None] * len(jobs)
        self.done = 0
        self.stopped = False
        self.lock = threading.Lock()
        self.waiting: queue.SimpleQueue[int] = queue.SimpleQueue()
        for k in sorted(range(len(jobs)), key=lambda j: (-len(jobs[j].triangle), j)):
            self.waiting.put(k)
        self.processes: list[subprocess.Popen[bytes]] = []
        self.errors: list[BaseException] = []
        # Jobs at which a worker was lost once.
        self.retried: set[int] = set()
        self.threads = [threading.Thread(target=self._feed, daemon=True) for _ in range(n_workers)]

    def run(self, progress: Progress, until: float) -> list[FlatCharts]:
        try:
            for thread in self.threads:
                thread.start()
            while not self.errors and any(thread.is_alive() for thread in self.threads):
                report(
                    progress,
                    Stage.UNWRAP,
                    until * self.done / self.total,
                    f"{self.done} of {self.total} triangles",
                )
                for thread in self.threads:
                    thread.join(0.1 / len(self.threads))
        finally:
            self._stop()
        if self.errors:
            raise self.errors[0]
        return [result for result in self.results if result is not None]

    def _stop(self) -> None:
        with self.lock:
            self.stopped = True
            for process in self.processes:
                process.kill()
        for thread in self.threads:
            if thread.ident is not None:
                thread.join()

    def _start(self) -> subprocess.Popen[bytes] | None:
        with self.lock:
            if self.stopped:
                return None
            process = start_module("baker.uv.worker")
            self.processes.append(process)
            return process

    def _feed(self) -> None:
        process: subprocess.Popen[bytes] | None = None
        try:
            while not self.stopped:
                try:
                    k = self.waiting.get_nowait()
                except queue.Empty:
                    break
                process = process or self._start()
                if process is None:
                    break
                charts = self._ask(process, self.jobs[k])
                if charts is None:
                    ended, process = self._how_it_ended(process), None
                    if k not in self.retried:
                        self.retried.add(k)
                        self.waiting.put(k)
                        continue
                    if ended not in _CRASHES:
                        raise ResourceError(_LOST)
                    # xatlas crashed twice on this job. Give its triangles chart -1; `planar_charts` lays them
                    # out later.
                    n = len(self.jobs[k].triangle)
                    charts = FlatCharts(np.zeros((n, 3, 2)), np.full(n, -1, np.int32))
                self.results[k] = charts
                with self.lock:
                    self.done += len(self.jobs[k].triangle)
        except BaseException as error:
            self.errors.append(error)
        finally:
            if process is not None:
                self._end(process)

    @staticmethod
    def _ask(process: subprocess.Popen[bytes], job: ChartJob) -> FlatCharts | None:
        assert process.stdin is not None
        assert process.stdout is not None
        try:
            send_job(process.stdin, job)
            return receive_charts(process.stdout)
        except (BrokenPipeError, OSError):
            return None

    def _how_it_ended(self, process: subprocess.Popen[bytes]) -> int:
        """Return the exit code of a process that has closed its pipe, or minus the signal that ended it."""
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(_MOMENT)
        self._end(process)
        return process.returncode

    @staticmethod
    def _end(process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        process.kill()
        process.wait()
        process.stdout.close()
        # Closing the pipe flushes its buffer, which fails because the process has ended.
        with contextlib.suppress(OSError):
            process.stdin.close()
