"""`run_batch` with an executor that does not bake: order, slots, memory, threads, failures, locks."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections import deque
from dataclasses import replace

import pytest
from gltf_builder import quad_builder, write

from baker.cli.flags import in_flags
from baker.core.errors import Cancelled
from baker.core.progress import silent
from baker.core.settings import BakeSettings
from baker.io.bake.lock import OutputLock
from baker.jobs import memory
from baker.jobs.executor import Event
from baker.jobs.jobs_file import Job
from baker.jobs.run import BatchOptions, batch_json, run_batch, write_junit


class FakeExecutor:
    """Finishes jobs in the order of their start. Makes an empty output folder instead of a bake."""

    def __init__(self, slots, failing=()):
        self.slots = slots
        self.failing = failing
        self.running = deque()
        self.log = []
        self.threads = {}
        self.most = 0
        self.closed = False

    def start(self, ticket, job, *, threads, force):
        assert len(self.running) < self.slots
        self.running.append((ticket, job))
        self.log.append(job.scene.stem)
        self.threads[job.scene.stem] = threads
        self.most = max(self.most, len(self.running))

    def next_event(self, timeout):
        if not self.running:
            return None
        ticket, job = self.running.popleft()
        if job.scene.stem in self.failing:
            error = {"kind": "input", "message": "it is broken", "file": "x", "object": None, "code": 3}
            return Event(ticket, ended=True, error=error)
        job.out.mkdir()
        return Event(ticket, ended=True)

    def close(self):
        self.closed = True


@pytest.fixture
def jobs(tmp_path):
    scenes = [write(tmp_path / f"{name}.glb", quad_builder()) for name in "abcdef"]
    return [Job(scene, tmp_path / "out" / scene.stem, BakeSettings(resolution=64)) for scene in scenes]


def states(outcomes):
    return "".join(outcome.state[0] for outcome in outcomes)


def test_all_in_order_within_slots_and_threads_shared(jobs, tmp_path):
    executor = FakeExecutor(2)
    found = run_batch(jobs, executor, BatchOptions(threads=4), silent)
    assert states(found) == "bbbbbb"
    assert (executor.log, executor.most, executor.closed) == (list("abcdef"), 2, True)
    assert executor.threads == dict.fromkeys("abcdef", 2)
    assert [o.job for o in found] == jobs
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == list("abcdef"), "no lock is left"


def test_a_job_alone_gets_all_threads_and_its_own_limit_counts(jobs):
    executor = FakeExecutor(3)
    run_batch(jobs[:1], executor, BatchOptions(threads=6), silent)
    own = [Job(jobs[1].scene, jobs[1].out, BakeSettings(threads=1))]
    run_batch(own, executor, BatchOptions(threads=6), silent)
    assert executor.threads == {"a": 6, "b": 1}


def test_failures_do_not_stop_the_others(jobs):
    found = run_batch(jobs, FakeExecutor(2, failing="b"), BatchOptions(), silent)
    assert states(found) == "bfbbbb"
    assert (found[1].code, found[1].why) == (3, "x: it is broken")


def test_fail_fast_starts_nothing_more(jobs, tmp_path):
    executor = FakeExecutor(2, failing="b")
    found = run_batch(jobs, executor, BatchOptions(fail_fast=True), silent)
    assert executor.log == list("abc"), "c ran beside b and is finished"
    assert states(found) == "bfbfff"
    assert "not run" in found[3].why
    assert not (tmp_path / "out" / "d").exists()


def test_memory_is_shared_and_what_never_fits_is_refused(jobs, monkeypatch):
    need = dict(zip("abcdef", (5, 5, 5, 20, 1, 5), strict=True))
    monkeypatch.setattr(memory, "estimate_peak", lambda scene, settings: need[scene.stem])
    executor = FakeExecutor(3)
    found = run_batch(jobs, executor, BatchOptions(memory=10), silent)
    assert states(found) == "bbbfbb"
    assert found[3].code == 4
    assert "20" in found[3].why
    assert "`memory` 10" in found[3].why
    assert executor.most == 2
    assert sorted(executor.log) == list("abcef")


def test_dry_run_touches_nothing(jobs, tmp_path):
    executor = FakeExecutor(1)
    before = sorted(tmp_path.rglob("*"))
    found = run_batch(jobs, executor, BatchOptions(dry_run=True), silent)
    assert states(found) == "bbbbbb"
    assert found[0].why == "not baked yet"
    assert executor.log == []
    assert sorted(tmp_path.rglob("*")) == before


def test_an_output_that_another_run_holds_comes_later(jobs):
    executor = FakeExecutor(1)
    lock = OutputLock(jobs[0].out)
    assert lock.acquire()
    waited = []

    def progress(stage, fraction, detail=""):
        if "waiting for another run" in detail:
            waited.append(detail)
            lock.release()

    found = run_batch(jobs[:3], executor, BatchOptions(), progress)
    assert executor.log == list("bca")
    assert states(found) == "bbb"
    assert waited


def test_scenes_that_cannot_be_read_fail_alone(jobs, tmp_path):
    (tmp_path / "a.glb").write_bytes(b"glTF")
    (tmp_path / "b.glb").unlink()
    found = run_batch(jobs[:3], FakeExecutor(1), BatchOptions(), silent)
    assert states(found) == "ffb"
    assert [o.code for o in found] == [3, 3, 0]
    assert "does not exist" in found[1].why


def test_cancelling_closes_the_executor_and_frees_the_locks(jobs, tmp_path):
    executor = FakeExecutor(2)
    told = []

    def progress(stage, fraction, detail=""):
        told.append(detail)
        return len(told) > len(jobs) + 2

    with pytest.raises(Cancelled):
        run_batch(jobs, executor, BatchOptions(), progress)
    assert executor.closed
    assert list(tmp_path.rglob(".*")) == []


def test_json_and_junit_say_the_same(jobs, tmp_path):
    found = run_batch(jobs[:2], FakeExecutor(1, failing="b"), BatchOptions(), silent)
    rows = batch_json(found, dry_run=False)["jobs"]
    assert [set(row) for row in rows] == [{"scene", "out", "state", "seconds", "why"}] * 2
    assert [row["state"] for row in rows] == ["baked", "failed"]
    write_junit(tmp_path / "j.xml", found)
    root = ElementTree.parse(tmp_path / "j.xml").getroot()
    assert (root.get("tests"), root.get("failures"), root.get("errors")) == ("2", "1", "0")
    assert root.find(".//failure").get("message") == "x: it is broken"


def test_junit_of_a_batch_names_flags(jobs, tmp_path):
    found = run_batch(jobs[:1], FakeExecutor(1), BatchOptions(), silent)
    failed = replace(found[0], state="failed", why="too large: lower `resolution`", code=3)
    write_junit(tmp_path / "j.xml", [failed], in_flags)
    root = ElementTree.parse(tmp_path / "j.xml").getroot()
    assert root.find(".//failure").get("message") == "too large: lower --resolution"
