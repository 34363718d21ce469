"""Runs the `baker` command with a fake pipeline. The first argument names how the pipeline hangs or fails."""

from __future__ import annotations

import ctypes
import os
import signal
import subprocess
import sys
import time
import types
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path


def bake(scene, *, out, settings, progress, force):
    out = Path(out)
    temporary = out.with_name(f".{out.name}.baker-{os.getpid()}-0123abcd")
    temporary.mkdir(parents=True)
    (temporary / "half.exr").write_bytes(b"half")
    if HOW == "exchanging":
        # Leave the folder as if a kill interrupted the exchange of files: the old manifest is moved away, and
        # the new one is not yet in its place.
        for part in ("new", "old"):
            (temporary / part).mkdir()
        (temporary / "new" / "bake.json").write_text("new")
        (temporary / "journal.json").write_text('{"old": ["bake.json"], "new": ["bake.json"], "folders": []}')
        (out / "bake.json").rename(temporary / "old" / "bake.json")
    try:
        HOWS[HOW](progress, out)
    finally:
        if HOW == "polite":
            (temporary / "half.exr").unlink()
            temporary.rmdir()


def _ready(out):
    (out.parent / "ready").write_text(str(os.getpid()))


def polite(progress, out):
    _ready(out)
    while not progress("trace", 0.5, "1.0 Mrays/s"):
        time.sleep(0.02)


def deaf(progress, out):
    # `PyDLL` does not release the interpreter lock during a C call, so no signal handler and no other thread
    # runs. Locking a mutex twice blocks forever and cannot be interrupted by signals.
    _ready(out)
    signal.alarm(30)
    lock = ctypes.PyDLL(None).pthread_mutex_lock
    mutex = ctypes.create_string_buffer(64)
    lock(mutex)
    lock(mutex)


def threads(progress, out):
    with ThreadPoolExecutor(2) as pool:
        work = [pool.submit(ctypes.CDLL(None).sleep, 60) for _ in range(2)]
        _ready(out)
        for item in work:
            item.result()


def helper(progress, out):
    worker = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(60)"])
    (out.parent / "helper").write_text(str(worker.pid))
    deaf(progress, out)


def crash(progress, out):
    os.abort()


def killed(progress, out):
    os.kill(os.getpid(), signal.SIGKILL)


HOWS = {f.__name__: f for f in (polite, deaf, threads, helper, crash, killed)} | {"exchanging": deaf}

if __name__ == "__main__":
    HOW = sys.argv.pop(1)
    sys.modules["baker.pipeline.bake"] = types.SimpleNamespace(bake=bake)
    from baker.cli.start import main

    main()
