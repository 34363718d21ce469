"""Ends a process when the process that started it ends, even if that was killed."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time

_PR_SET_PDEATHSIG = 1
# Seconds between two looks at the parent, on systems without a signal for it.
_INTERVAL = 0.5


def end_with_parent(parent: int) -> None:
    """Kill this process as soon as its parent has ended.

    On Linux the kernel does it at once, whatever this process is doing. Elsewhere a thread looks twice a
    second, while the code that runs lets threads run.

    Parameters
    ----------
    parent : int
        Id of the parent process, as known before the start of this process or as early as possible.
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
