"""The lock of an output folder is released when its process ends, also after a kill."""

from __future__ import annotations

import signal
import subprocess
import sys

import pytest

from baker.io.bake.lock import OutputLock

HOLDER = """
import sys, time
from pathlib import Path
from baker.io.bake.lock import OutputLock
lock = OutputLock(Path(sys.argv[1]))
print(lock.acquire(), flush=True)
time.sleep(60)
"""


def test_one_process_holds_the_lock_and_no_file_remains(tmp_path):
    out = tmp_path / "deep" / "out"
    first, second = OutputLock(out), OutputLock(out)
    assert first.acquire()
    assert not second.acquire()
    assert OutputLock(tmp_path / "deep" / "other").acquire()
    first.release()
    assert second.acquire()
    second.release()
    (tmp_path / "deep" / ".other.baker.lock").unlink()
    assert list((tmp_path / "deep").iterdir()) == []


def test_folders_made_for_nothing_are_removed(tmp_path):
    lock = OutputLock(tmp_path / "a" / "b" / "out")
    assert lock.acquire()
    lock.release()
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("step", ["try_lock", "os.open"])
def test_an_attempt_that_fails_leaves_nothing(tmp_path, monkeypatch, step):
    def fail(*arguments):
        raise OSError("no locks here")

    with monkeypatch.context() as patch:
        patch.setattr(f"baker.io.bake.lock.{step}", fail)
        with pytest.raises(OSError, match="no locks"):
            OutputLock(tmp_path / "a" / "b" / "out").acquire()
    assert list(tmp_path.iterdir()) == []


def test_a_killed_holder_does_not_leave_it_locked(tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-c", HOLDER, str(out)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "True\n"
    lock = OutputLock(out)
    assert not lock.acquire()
    process.send_signal(signal.SIGKILL)
    process.communicate()
    assert lock.acquire()
    lock.release()
    assert list(tmp_path.iterdir()) == []
