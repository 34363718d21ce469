"""Ends a process when its parent process ends, even if the parent was killed."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1
# Time between two tests whether the parent runs, seconds, on systems other than Linux.
_INTERVAL = 0.5


def end_with_parent(parent: int) -> None:
    """Kill this process as soon as its parent has ended.

    On Linux the kernel kills this process immediately. On other systems with `os.getppid`, a thread tests
    twice a second whether the parent runs. This thread cannot run while native code holds the global
    interpreter lock.

    Parameters
    ----------
    parent : int
        Id of the parent process, passed by the parent or read as early as possible. If the parent has ended
        since, this process exits immediately with status 1.
    """
    if sys.platform == "linux":
        import ctypes

        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    elif hasattr(os, "getppid"):
        threading.Thread(target=_watch, args=(parent,), daemon=True).start()
    if hasattr(os, "getppid") and os.getppid() != parent:
        os._exit(1)


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(_INTERVAL)
    os.kill(os.getpid(), signal.SIGKILL)
