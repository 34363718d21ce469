"""Ctrl-C while a command starts, commands with closed streams, and a kill of the waiting parent process."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from baker.io.bake.lock import OutputLock
from baker.io.bake.recovery import recover
from baker.io.file_lock import is_alive

ROOT = Path(__file__).parents[2]
SCENE = ROOT / "assets" / "cornell.glb"
FAKE = Path(__file__).with_name("fake_baker.py")
# A Python program that starts like the installed command, but sends itself SIGINT when it imports the module
# that its first argument names.
INTERRUPTED_AT = """
import os, signal, sys
module = sys.argv.pop(1)
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == module:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder())
from baker.cli.start import main
main()
"""


MODULES = ["baker.cli.app", "baker.cli.session", "typer", "baker.cli.check", "pydantic", "numpy"]


@pytest.mark.parametrize(("module", "as_json"), [(name, k % 2 == 1) for k, name in enumerate(MODULES)])
def test_ctrl_c_during_imports(module, as_json):
    words = [module, "check", str(SCENE), "-q", *(["--json"] if as_json else [])]
    done = subprocess.run([sys.executable, "-c", INTERRUPTED_AT, *words], capture_output=True, text=True)
    assert done.returncode == 130, done.stderr
    assert done.stderr == "baker: interrupted\n"
    if as_json:
        assert json.loads(done.stdout)["error"]["kind"] == "cancelled"
    else:
        assert done.stdout == ""


def test_few_modules_are_imported_before_ctrl_c_is_handled():
    """While these modules are imported, Ctrl-C still ends with Python's own traceback."""
    # `-S` leaves out the site packages with their import hook, so this program itself makes the folder `cli`
    # importable as `baker.cli`.
    code = (
        f"import sys, os; sys.path.insert(0, {str(ROOT)!r}); before = set(sys.modules)\n"
        "import baker, cli; sys.modules['baker.cli'] = cli\n"
        "import baker.cli.start; print(*sorted(set(sys.modules) - before))"
    )
    done = subprocess.run([sys.executable, "-I", "-S", "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    slow = {"typing", "enum", "re", "signal", "functools", "collections", "pathlib", "json"}
    assert not slow & set(done.stdout.split())


@pytest.mark.parametrize("closed", ["<&-", ">&-", "2>&-", "<&- >&- 2>&-"])
@pytest.mark.parametrize("words", ["inspect SCENE --json", "inspect missing.glb"])
def test_closed_streams(closed, words, tmp_path):
    command = f"{sys.executable} -m baker.cli {words.replace('SCENE', str(SCENE))} {closed}"
    done = subprocess.run(["sh", "-c", command], cwd=tmp_path, capture_output=True, text=True, stdin=None)
    assert done.returncode == (3 if "missing" in words else 0), done.stderr
    assert "Traceback" not in done.stderr
    assert ("no such file" in done.stderr) == ("missing" in words and "2>" not in closed)
    assert bool(done.stdout) == (" >&-" not in f" {closed}" and "missing" not in words)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere a thread looks for the parent")
def test_a_kill_of_the_parent_ends_the_child(tmp_path):
    command = [sys.executable, str(FAKE), "deaf", "bake", "scene.glb", "-o", str(tmp_path / "out")]
    process = subprocess.Popen(command, cwd=tmp_path, stdout=subprocess.DEVNULL)
    ready = tmp_path / "ready"
    while not (ready.exists() and ready.read_text()):
        assert process.poll() is None
        time.sleep(0.01)
    worker = int(ready.read_text())
    process.send_signal(signal.SIGKILL)
    process.wait()
    lock = OutputLock(tmp_path / "out")
    end = time.monotonic() + 10
    while not lock.acquire():
        assert time.monotonic() < end, "the work goes on"
        time.sleep(0.01)
    lock.release()
    ready.unlink()
    recover(tmp_path / "out")
    assert list(tmp_path.iterdir()) == []
    while is_alive(worker):
        assert time.monotonic() < end
        time.sleep(0.01)
