"""Interruption: in every stage the command ends within a second with exit code 130 and leaves no files."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from baker.io.temporary import TemporaryFolder

FAKE = Path(__file__).with_name("fake_baker.py")
ASSETS = Path(__file__).parents[2] / "assets"
# Largest documented time from the signal to the end of the process, seconds.
LIMIT = 1.0


def _start(how: str, folder: Path, *flags: str) -> subprocess.Popen[str]:
    command = [
        sys.executable,
        str(FAKE),
        how,
        "bake",
        "scene.glb",
        "-o",
        str(folder / "deep" / "out"),
        *flags,
    ]
    return subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def _wait_for(path: Path, process: subprocess.Popen[str]) -> str:
    end = time.monotonic() + 20.0
    while not (path.exists() and path.read_text()):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end, "the command never began to work"
        time.sleep(0.01)
    return path.read_text()


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    state = Path(f"/proc/{process}/stat")
    # A zombie process (state Z) has ended, but its parent has not read the exit code yet.
    return not state.exists() or state.read_text().rpartition(")")[2].split()[0] != "Z"


@pytest.mark.timed
@pytest.mark.parametrize("how", ["polite", "deaf", "threads"])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stop_is_quick_and_clean(how, number, tmp_path):
    process = _start(how, tmp_path, "--json")
    child = int(_wait_for(tmp_path / "deep" / "ready", process))
    (tmp_path / "deep" / "ready").unlink()
    began = time.monotonic()
    process.send_signal(number)
    out, err = process.communicate(timeout=10)
    assert time.monotonic() - began < LIMIT
    assert process.returncode == 130
    assert json.loads(out)["error"]["kind"] == "cancelled"
    assert err == "baker: interrupted\n"
    assert not _alive(child)
    assert list(tmp_path.rglob("*baker-*")) == []


def test_a_kill_keeps_other_folders_and_removes_new_parent_folders(tmp_path):
    other = TemporaryFolder(tmp_path / "out")
    other.create()
    process = subprocess.Popen(
        [sys.executable, str(FAKE), "deaf", "bake", "s.glb", "-o", "out"], cwd=tmp_path
    )
    _wait_for(tmp_path / "ready", process)
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == 130
    assert sorted(path.name for path in tmp_path.iterdir()) == [other.path.name, "ready"]
    other.remove()


def test_a_kill_between_two_renames_restores_the_old_bake(tmp_path):
    old = tmp_path / "deep" / "out"
    old.mkdir(parents=True)
    (old / "bake.json").write_text("old")
    process = _start("exchanging", tmp_path)
    _wait_for(tmp_path / "deep" / "ready", process)
    assert not (old / "bake.json").exists()
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == 130
    assert (old / "bake.json").read_text() == "old"
    assert list(tmp_path.rglob("*baker-*")) == []
    process.communicate()


def test_helper_processes_end_with_the_command(tmp_path):
    process = _start("helper", tmp_path)
    _wait_for(tmp_path / "deep" / "ready", process)
    helper = int((tmp_path / "deep" / "helper").read_text())
    assert _alive(helper)
    process.send_signal(signal.SIGINT)
    assert process.wait(10) == 130
    process.communicate()
    end = time.monotonic() + 2.0
    while _alive(helper) and time.monotonic() < end:
        time.sleep(0.01)
    assert not _alive(helper)


@pytest.mark.parametrize(("how", "word"), [("crash", "SIGABRT"), ("killed", "memory")])
def test_death_of_native_code_is_one_sentence(how, word, tmp_path):
    process = _start(how, tmp_path, "--json")
    out, err = process.communicate(timeout=20)
    assert process.returncode == 4
    error = json.loads(out)["error"]
    assert error["kind"] == "resource"
    assert word in error["message"]
    assert err.splitlines()[-1].startswith("baker: ")
    assert "Traceback" not in err
    assert list(tmp_path.rglob("*baker-*")) == []


@pytest.mark.timed
@pytest.mark.parametrize("after", [0.4, 1.5])
def test_real_bake_stops_quickly(after, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "baker.cli", "bake", str(ASSETS / "hall.glb"), "-o", str(out)]
    command += ["--quality", "ultra", "--resolution", "2048"]
    process = subprocess.Popen(
        command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    time.sleep(after)
    began = time.monotonic()
    process.send_signal(signal.SIGINT)
    _, err = process.communicate(timeout=20)
    assert process.returncode == 130, err
    assert time.monotonic() - began < LIMIT
    assert err == "baker: interrupted\n"
    assert list(tmp_path.iterdir()) == []
