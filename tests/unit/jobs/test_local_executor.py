"""`LocalJobExecutor`: a worker process that dies is replaced once for each job."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import pytest
from gltf_builder import quad_builder, write

from baker.core.progress import silent
from baker.core.settings import BakeSettings
from baker.jobs import executor
from baker.jobs.executor import LocalJobExecutor
from baker.jobs.jobs_file import Job
from baker.jobs.run import BatchOptions, run_batch

# Program of a worker that does not bake, but appends each job to log.txt. The scene's name contains a digit n
# and the name of a signal. At the first n tries of a job, the worker makes a temporary folder like that of a
# bake, and sends this signal to itself.
WORKER = """
import json, os, pathlib, signal, sys
for line in sys.stdin:
    job = json.loads(line)
    scene, out = pathlib.Path(job["scene"]), pathlib.Path(job["out"])
    log = scene.parent / "log.txt"
    with log.open("a") as stream:
        stream.write(f"{scene.stem} {job['settings']['threads']} {job['force']}\\n")
    tries = sum(line.startswith(scene.stem + " ") for line in log.read_text().splitlines())
    if tries <= int(scene.stem[1]):
        (out.parent / f".{out.name}.baker-{os.getpid()}-0123456789abcdef").mkdir()
        os.kill(os.getpid(), getattr(signal, scene.stem[2:]))
    out.mkdir()
    print(json.dumps({"done": True}), flush=True)
"""


def start_fake(module: str) -> subprocess.Popen[bytes]:
    assert module == "baker.jobs.worker"
    return subprocess.Popen(
        [sys.executable, "-S", "-c", WORKER], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )


@pytest.fixture
def run(tmp_path, monkeypatch):
    """Return a function that runs jobs of the named scenes and returns each job's outcome and tries."""
    monkeypatch.setattr(executor, "start_module", start_fake)

    def run(*names: str, slots: int = 1):
        for name in names:
            write(tmp_path / f"{name}.glb", quad_builder())
        (tmp_path / "out").mkdir()
        settings = BakeSettings(threads=1)
        jobs = [Job(tmp_path / f"{name}.glb", tmp_path / "out" / name, settings) for name in names]
        found = run_batch(jobs, LocalJobExecutor(slots), BatchOptions(force=True), silent)
        lines = (tmp_path / "log.txt").read_text().splitlines()
        assert {line.split(maxsplit=1)[1] for line in lines} == {"1 True"}, "a repeated job has its arguments"
        return found, Counter(line.split()[0] for line in lines)

    return run


@pytest.mark.parametrize("slots", [1, 2])
@pytest.mark.parametrize("number", ["SIGKILL", "SIGSEGV"])
def test_a_job_whose_worker_dies_is_repeated(run, tmp_path, slots, number):
    names = [f"a0{number}", f"b1{number}", f"c0{number}", f"d1{number}"]
    found, tries = run(*names, slots=slots)
    assert [outcome.state for outcome in found] == ["baked"] * 4
    assert [tries[name] for name in names] == [1, 2, 1, 2]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == names, "nothing else is left"


@pytest.mark.parametrize(
    ("number", "why"), [("SIGKILL", "its process was killed twice"), ("SIGSEGV", "died twice (status -11)")]
)
def test_a_job_whose_worker_dies_twice_fails_and_the_others_go_on(run, tmp_path, number, why):
    names = [f"a0{number}", f"b9{number}", f"c0{number}"]
    found, tries = run(*names)
    assert [outcome.state for outcome in found] == ["baked", "failed", "baked"]
    assert [tries[name] for name in names] == [1, 2, 1]
    assert found[1].code == 4
    assert why in found[1].why
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [names[0], names[2]]


def test_a_worker_that_cannot_be_replaced_costs_its_job_only(run, monkeypatch):
    started = []

    def start(module: str) -> subprocess.Popen[bytes]:
        started.append(module)
        if len(started) == 2:
            raise BlockingIOError(11, "Resource temporarily unavailable")
        return start_fake(module)

    monkeypatch.setattr(executor, "start_module", start)
    found, _ = run("a1SIGKILL", "b0SIGKILL")
    assert [outcome.state for outcome in found] == ["failed", "baked"]
    assert found[0].code == 4
    assert "no new process could be started (Resource temporarily unavailable)" in found[0].why


# Starts a worker, and a process that keeps the worker's standard input open, as a fork of the parent would.
PARENT = """
import subprocess, sys, time
from baker.core.child_process import start_module
worker = start_module("baker.jobs.worker")
kept = worker.stdin.fileno()
keeper = subprocess.Popen([sys.executable, "-S", "-c", "import time; time.sleep(60)"], pass_fds=[kept])
print(worker.pid, keeper.pid, flush=True)
time.sleep(60)
"""


@pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="states of processes are read from /proc")
@pytest.mark.parametrize("age", [0.0, 0.5])
def test_a_worker_ends_if_its_parent_is_killed(age):
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    worker, keeper = map(int, parent.stdout.readline().split())
    try:
        time.sleep(age)
        parent.kill()
        parent.wait()
        end = time.monotonic() + 20.0
        while is_running(worker):
            assert time.monotonic() < end, "the worker outlives its parent"
            time.sleep(0.02)
    finally:
        parent.stdout.close()
        for process in (worker, keeper):
            if is_running(process):
                os.kill(process, signal.SIGKILL)


def is_running(process: int) -> bool:
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
