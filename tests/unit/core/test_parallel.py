"""`run_tiles` processes each item once, raises a tile's error, can be cancelled, and ends its threads."""

from __future__ import annotations

import threading
import time

import numpy as np
import pytest

from baker.core.errors import Cancelled
from baker.core.parallel import run_tiles, thread_count
from baker.core.progress import report, silent


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize(
    ("n", "tile"), [(0, 4), (1, 1), (1, 100), (7, 3), (100, 10), (101, 10), (257, 256), (33, 1)]
)
def test_every_item_once(n, tile, threads):
    count, spans, lock = np.zeros(n, int), [], threading.Lock()

    def work(begin, end):
        with lock:
            spans.append((begin, end))
        count[begin:end] += 1

    run_tiles(n, tile, work, threads=threads, stage="test", progress=silent)
    assert (count == 1).all()
    assert sorted(spans) == [(a, min(a + tile, n)) for a in range(0, n, tile)]


def test_threads_work_at_the_same_time():
    meet = threading.Barrier(3, timeout=10)
    run_tiles(3, 1, lambda begin, end: meet.wait(), threads=3, stage="test", progress=silent)
    assert not meet.broken


def test_errors_come_through_and_stop_the_rest():
    done = []

    def work(begin, end):
        if begin == 3:
            raise RuntimeError("tile three")
        time.sleep(0.002)
        done.append(begin)

    with pytest.raises(RuntimeError, match="tile three"):
        run_tiles(1000, 1, work, threads=2, stage="test", progress=silent)
    assert len(done) < 20
    after = len(done)
    time.sleep(0.02)
    assert len(done) == after


@pytest.mark.parametrize("threads", [1, 3])
def test_cancel_stops_between_tiles(threads):
    started, finished = [], []

    def work(begin, end):
        started.append(begin)
        time.sleep(0.005)
        finished.append(begin)

    def progress(stage, fraction, detail=""):
        return fraction > 0.02

    with pytest.raises(Cancelled):
        run_tiles(500, 1, work, threads=threads, stage="test", progress=progress)
    # Tiles that had started finish before the call returns. The other tiles never start.
    assert sorted(started) == sorted(finished)
    assert len(started) < 60
    time.sleep(0.02)
    assert sorted(started) == sorted(finished)


def test_cancel_before_the_first_tile():
    calls = []
    with pytest.raises(Cancelled) as caught:
        run_tiles(5, 1, lambda *span: calls.append(span), threads=2, stage="test", progress=lambda *a: True)
    assert calls == []
    assert caught.value.exit_code == 130


def test_a_long_tile_is_still_cancelled():
    """`progress` is called while a tile runs, not only when a tile ends."""
    released, asked = threading.Event(), []

    def progress(stage, fraction, detail=""):
        asked.append(fraction)
        if len(asked) > 2:
            released.set()
            return True
        return None

    with pytest.raises(Cancelled):
        run_tiles(1, 1, lambda *span: released.wait(10), threads=1, stage="test", progress=progress)
    assert released.is_set()


def test_progress_rises_to_one():
    told = []

    def progress(stage, fraction, detail=""):
        told.append((stage, fraction, detail))

    run_tiles(40, 7, lambda *span: None, threads=2, stage="rays", progress=progress, rays_per_item=1e6)
    fractions = [fraction for _, fraction, _ in told]
    assert fractions == sorted(fractions)
    assert (fractions[0], fractions[-1]) == (0, 1)
    assert {stage for stage, _, _ in told} == {"rays"}
    assert told[-1][2].endswith("Mrays/s")
    assert report(silent, "x", 0.5) is None


def test_thread_count():
    assert thread_count(3) == 3
    assert thread_count(None) >= 1
    assert thread_count(0) == thread_count(None)


def test_one_core_is_enough(monkeypatch):
    import os

    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert thread_count(None) == 1
