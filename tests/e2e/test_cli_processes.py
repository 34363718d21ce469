"""Processes of the command line: start time, imports, and standard streams that are noisy, full or closed."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest


@pytest.mark.timed
def test_help_is_quick_and_imports_nothing_heavy():
    # Take the fastest of three runs, because other processes may slow single runs.
    seconds = []
    for _ in range(3):
        began = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "baker.cli", "--help"], capture_output=True, text=True, check=True
        )
        seconds.append(time.perf_counter() - began)
    assert min(seconds) < 0.5
    assert all(name in done.stdout for name in ("bake", "ao", "inspect"))
    code = "import sys; from baker.cli.app import run; run(['--help']); print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert not {"numpy", "numba", "pydantic", "scipy", "baker.core.settings"} & set(loaded)


def test_json_stdout_is_kept_clean_of_what_libraries_print():
    code = (
        "import os, sys, types\n"
        "def look(path, own):\n    os.write(1, b'library noise')\n    return {'kind': 'x'}\n"
        "sys.modules['baker.io.inspect'] = types.SimpleNamespace(inspect_path=look)\n"
        "from baker.cli.app import main\nmain()\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "inspect", "a", "--json"], capture_output=True, check=True
    )
    assert json.loads(done.stdout) == {"kind": "x"}
    assert b"library noise" in done.stderr


def test_full_or_closed_standard_output_is_no_traceback():
    version = [sys.executable, "-m", "baker.cli", "--version"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(version, stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 4
    assert done.stderr == "baker: the disk is full; free some space, or write elsewhere with -o\n"
    with subprocess.Popen(version, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as closed:
        closed.stdout.close()
        assert closed.stderr.read() == ""
    assert closed.returncode == 0
