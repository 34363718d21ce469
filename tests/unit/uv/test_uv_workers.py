"""A worker process that is lost is replaced once only."""

from __future__ import annotations

import os
import signal

import pytest
from uv_scenes import ball_mesh, job_of

from baker.core.errors import ResourceError
from baker.core.progress import silent
from baker.uv import pool
from baker.uv.xatlas_charts import ChartJob, cut_charts


@pytest.fixture
def jobs() -> list[ChartJob]:
    return [job_of(ball_mesh(4))] * 2


@pytest.fixture
def lose(monkeypatch: pytest.MonkeyPatch):
    """Return a function `lose(number, times)`: signal `number` kills the next `times` workers that start."""

    def lose(number: int, times: int) -> list[int]:
        ended: list[int] = []
        start = pool.start_module

        def start_and_end(module: str):
            process = start(module)
            if len(ended) < times:
                ended.append(process.pid)
                os.kill(process.pid, number)
            return process

        monkeypatch.setattr(pool, "start_module", start_and_end)
        return ended

    return lose


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGSEGV])
def test_a_lost_worker_is_replaced(jobs, lose, number) -> None:
    ended = lose(number, 1)
    answers = pool.run_jobs(jobs, 1, silent, 1.0)
    assert len(ended) == 1
    for job, answer in zip(jobs, answers, strict=True):
        assert answer.chart.tobytes() == cut_charts(job).chart.tobytes()


def test_a_worker_that_is_killed_twice_is_a_lack_of_memory(jobs, lose) -> None:
    lose(signal.SIGKILL, 99)
    with pytest.raises(ResourceError, match="has died twice, most likely for lack of memory") as caught:
        pool.run_jobs(jobs, 2, silent, 1.0)
    assert caught.value.exit_code == 4


def test_where_the_library_crashes_twice_the_triangles_have_no_chart(jobs, lose) -> None:
    """The triangles get the chart -1, so `baker` lays them out without xatlas."""
    lose(signal.SIGSEGV, 2)
    answers = pool.run_jobs(jobs[:1], 1, silent, 1.0)
    assert (answers[0].chart == -1).all()
