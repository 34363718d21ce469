"""All files are byte-identical for one thread, for two threads, and for a second run."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

CORNELL = Path(__file__).parents[2] / "assets" / "cornell.glb"


def bake(out, *, threads, seed=0):
    command = [sys.executable, "-m", "baker.cli", "bake", str(CORNELL), "-o", str(out), "--quiet"]
    command += ["--resolution", "64", "--samples", "16", "--threads", str(threads), "--seed", str(seed)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    files = {
        path.relative_to(out).as_posix(): path.read_bytes()
        for path in sorted(out.rglob("*"))
        if path.is_file()
    }
    manifest = json.loads(files.pop("bake.json"))
    # Only the date and the durations of the bake may differ.
    for key in ("timings", "created"):
        del manifest[key]
    return files, manifest


@pytest.fixture(scope="module")
def one_thread(tmp_path_factory):
    return bake(tmp_path_factory.mktemp("one") / "out", threads=1)


@pytest.mark.parametrize("threads", [1, 2])
def test_same_bytes_again(one_thread, threads, tmp_path):
    files, manifest = bake(tmp_path / "out", threads=threads)
    assert set(files) == set(one_thread[0])
    assert {"scene.glb", "irradiance_0.exr", "ao_0.exr", "status_0.png"} <= set(files)
    for name in files:
        assert files[name] == one_thread[0][name], name
    assert manifest == one_thread[1]


def test_another_seed_gives_other_noise(one_thread, tmp_path):
    files, _ = bake(tmp_path / "out", threads=2, seed=1)
    assert files["irradiance_0.exr"] != one_thread[0]["irradiance_0.exr"]
    assert set(files) == set(one_thread[0])
