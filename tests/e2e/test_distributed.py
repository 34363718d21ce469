"""Distributed bakes with a scheduler and two workers as processes on this machine."""

from __future__ import annotations

import hashlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from gltf_builder import quad_builder, write

from baker.core.errors import ResourceError, SettingsError
from baker.core.settings import make_settings
from baker.distributed.connection import Cluster
from baker.distributed.tile_executor import DistributedTileExecutor
from baker.pipeline.bake import bake

pytest.importorskip("distributed")

ASSETS = Path(__file__).parents[2] / "assets"
SETTINGS = {"resolution": 64, "samples": 8, "ao_samples": 4, "denoise": False, "threads": 1}
# Program of a worker that reports another version of baker.
OTHER = """
import sys
import baker.core.version
from distributed.cli.dask_worker import main
baker.core.version.VERSION = "9.9.9"
sys.argv[0] = "dask-worker"
main()
"""


class Machines:
    """A scheduler and workers without nanny processes, so a killed worker is not restarted."""

    def __init__(self, folder):
        self.file = folder / "scheduler.json"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
        self.quiet = quiet
        self.scheduler = subprocess.Popen(
            [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0",
             "--no-dashboard", "--dashboard-address", "127.0.0.1:0", "--scheduler-file", str(self.file)],
            **quiet,
        )  # fmt: skip
        end = time.monotonic() + 60
        while not self.file.exists():
            assert time.monotonic() < end
            time.sleep(0.05)
        self.address = json.loads(self.file.read_text())["address"]
        self.workers = []

    def add(self, *how):
        flags = ["--host", "127.0.0.1", "--no-nanny", "--nthreads", "1", "--no-dashboard"]
        command = [sys.executable, *(how or ("-m", "distributed.cli.dask_worker")), self.address, *flags]
        self.workers.append(subprocess.Popen(command, **self.quiet))
        return self.workers[-1]

    def wait_for(self, n):
        from distributed import Client

        with Client(self.address, set_as_default=False) as client:
            client.wait_for_workers(n, timeout=60)
            end = time.monotonic() + 30
            while len(client.nthreads()) != n:
                assert time.monotonic() < end
                time.sleep(0.05)

    def close(self):
        for process in [*self.workers, self.scheduler]:
            process.kill()
            process.wait()


@pytest.fixture(scope="module")
def machines(tmp_path_factory):
    found = Machines(tmp_path_factory.mktemp("cluster"))
    for _ in range(2):
        found.add()
    found.wait_for(2)
    yield found
    found.close()


@pytest.fixture(scope="module")
def alone():
    return bake(ASSETS / "cornell.glb", settings=make_settings(SETTINGS))


def same(first, second):
    for name, lightmap in first.lightmaps.items():
        assert np.array_equal(lightmap.value, second.lightmaps[name].value), name
    assert np.array_equal(first.status, second.status)
    assert (first.rays, first.solve) == (second.rays, second.solve)


def content(folder):
    """Return {file name: hash} of a bake; times are removed from the manifest first."""
    found = {}
    for path in sorted(folder.iterdir()):
        data = path.read_bytes()
        if path.name == "bake.json":
            data = json.dumps({k: v for k, v in json.loads(data).items() if k not in ("created", "timings")})
            data = data.encode()
        found[path.name] = hashlib.sha256(data).hexdigest()
    return found


def run(*words, cwd):
    command = [sys.executable, "-m", "baker.cli", *map(str, words)]
    return subprocess.run(command, cwd=cwd, capture_output=True, text=True, timeout=120)


def test_a_bake_is_spread_and_its_bytes_are_the_same(machines, alone):
    cluster = Cluster(machines.address)
    sent = []
    send = cluster.send
    cluster.send = lambda value: sent.append(value) or send(value)
    same(
        alone,
        bake(
            ASSETS / "cornell.glb",
            settings=make_settings(SETTINGS),
            executor=DistributedTileExecutor(cluster),
        ),
    )
    cluster.close()
    assert sum(isinstance(value, tuple) for value in sent) == 1, "the scene goes out once"
    assert len(sent) == 5, "and what each of four stages needs"


def test_the_commands_write_the_same_folders(machines, tmp_path):
    for name in "ab":
        builder = quad_builder()
        builder.json["extras"] = {"name": name}
        write(tmp_path / f"{name}.glb", builder)
    flags = ["--resolution", "16", "--samples", "1", "--sky", "1", "--no-denoise", "-q"]
    text = "resolution = 16\nsamples = 1\nsky = 1\ndenoise = false"
    jobs = f'[defaults]\nout = "jobs/{{stem}}"\n{text}\n[[job]]\nglob = "*.glb"\n'
    (tmp_path / "JOBS.toml").write_text(jobs)
    assert run("bake", "a.glb", "-o", "here/a", *flags, cwd=tmp_path).returncode == 0
    done = run("bake", "a.glb", "-o", "there/a", *flags, "--cluster", machines.address, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    done = run("batch", "JOBS.toml", "--json", "--cluster", machines.address, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert [job["state"] for job in json.loads(done.stdout)["jobs"]] == ["baked", "baked"]
    assert content(tmp_path / "here/a") == content(tmp_path / "there/a") == content(tmp_path / "jobs/a")
    done = run("batch", "JOBS.toml", "--json", cwd=tmp_path)
    assert [job["state"] for job in json.loads(done.stdout)["jobs"]] == ["unchanged", "unchanged"]


def test_another_version_is_refused_and_both_are_named(machines, tmp_path):
    script = tmp_path / "other.py"
    script.write_text(OTHER)
    other = machines.add(str(script))
    machines.wait_for(3)
    with pytest.raises(ResourceError, match=r"worker tcp://127.*baker 9\.9\.9.*baker \d+\.\d+"):
        Cluster(machines.address)
    other.kill()
    machines.wait_for(2)


def test_a_worker_killed_in_the_middle_costs_its_tiles_only(machines, alone):
    """The bake finishes. This must be the last test with `machines`, because the worker is not restarted."""
    victim = machines.workers[0]
    fractions = []

    def progress(stage, fraction, detail=""):
        if stage == "form factors":
            fractions.append(fraction)
            if 0.1 < fraction < 1 and victim.poll() is None:
                os.kill(victim.pid, signal.SIGKILL)
                victim.wait()

    cluster = Cluster(machines.address)
    settings = make_settings(SETTINGS)
    result = bake(
        ASSETS / "cornell.glb",
        settings=settings,
        executor=DistributedTileExecutor(cluster),
        progress=progress,
    )
    assert victim.poll() is not None, "it was killed"
    assert len(cluster.workers()) == 1
    cluster.close()
    same(alone, result)
    assert fractions == sorted(fractions), "nothing done was undone"


def test_addresses_that_lead_nowhere(tmp_path):
    for address in ("nowhere", "local:", "local:0", "http://x"):
        with pytest.raises(SettingsError):
            Cluster(address)
    scene = write(tmp_path / "a.glb", quad_builder())
    done = run("bake", scene, "-o", "out", "--cluster", "nowhere", "--json", cwd=tmp_path)
    assert done.returncode == 2
    assert "tcp://HOST:8786" in json.loads(done.stdout)["error"]["message"]
    assert list(tmp_path.iterdir()) == [scene]
