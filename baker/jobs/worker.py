"""A process that bakes one job after the other, so that libraries and kernels are loaded once.

Protocol: one line of JSON for each job on stdin, lines of JSON on stdout. A job is
{"scene", "out", "settings", "force"}. The worker writes {"stage", "fraction"} while the job runs, and
{"done": true} or {"error": {"kind", "message", "file", "object", "code"}} at its end. The process exits when
stdin ends.
"""

from __future__ import annotations

import json
import os
import queue
import signal
import sys
import threading
import time
from typing import Any, TextIO

from baker.core.error_mapping import bug, explain
from baker.core.errors import BakerError

# Seconds between two lines about progress.
_INTERVAL = 0.1
# Seconds from the end of stdin to the exit of the process, in which a running bake can stop.
_GRACE = 0.6


def main() -> None:
    """Bake jobs until stdin ends."""
    # Ctrl-C is sent to the whole process group, but only the parent stops this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Redirect descriptor 1 to stderr, since native libraries may print to it; keep a copy for the protocol.
    sink = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[dict[str, Any] | None] = queue.SimpleQueue()
    stop = threading.Event()
    threading.Thread(target=_listen, args=(jobs, stop), daemon=True).start()
    # Import the pipeline before the first job arrives.
    import baker.pipeline.bake  # noqa: F401

    while (job := jobs.get()) is not None:
        _answer(sink, _run(job, sink, stop))
    os._exit(0)


def _listen(jobs: queue.SimpleQueue[dict[str, Any] | None], stop: threading.Event) -> None:
    for line in sys.stdin:
        jobs.put(json.loads(line))
    stop.set()
    jobs.put(None)
    time.sleep(_GRACE)
    os._exit(0)


def _run(job: dict[str, Any], sink: TextIO, stop: threading.Event) -> dict[str, Any]:
    """Bake one job and return the last message of the protocol."""
    from baker.core.settings import make_settings
    from baker.pipeline.bake import bake

    last_report = 0.0

    def progress(stage: str, fraction: float, detail: str = "", /) -> object:
        nonlocal last_report
        now = time.monotonic()
        if now - last_report >= _INTERVAL:
            last_report = now
            _answer(sink, {"stage": stage, "fraction": fraction})
        return stop.is_set()

    try:
        settings = make_settings(job["settings"])
        bake(job["scene"], settings=settings, out=job["out"], progress=progress, force=job["force"])
    except Exception as error:
        return {"error": describe(error)}
    return {"done": True}


def describe(error: BaseException) -> dict[str, Any]:
    """Return an error as plain values.

    Parameters
    ----------
    error : BaseException
        Any exception; one that `explain` does not map to a `BakerError` has the kind `internal`.

    Returns
    -------
    dict
        {kind, message, file, object, code}; `code` is the exit code.
    """
    known = explain(error)
    kind = "internal" if known is None else known.kind
    reported: BakerError = bug(error) if known is None else known
    return {
        "kind": kind,
        "message": reported.message,
        "file": reported.file,
        "object": reported.object,
        "code": reported.exit_code,
    }


def _answer(sink: TextIO, message: dict[str, Any]) -> None:
    try:
        sink.write(json.dumps(message) + "\n")
        sink.flush()
    except OSError:
        # The parent has closed the pipe; the end of stdin stops the work.
        return


if __name__ == "__main__":
    main()
