"""Bakes one job after another in a worker process, so that libraries and kernels are loaded only once.

The process reads one line of JSON for each job from stdin, and writes lines of JSON to stdout. A job is
{"scene", "out", "settings", "force"}. While a job runs, the process writes {"stage", "fraction"}. At the end
of the job it writes {"done": true} or {"error": {"kind", "message", "file", "object", "code"}}. The process
exits when stdin ends.
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
from baker.core.parent_death import end_with_parent

# Shortest time between two progress messages, seconds.
_INTERVAL = 0.1
# Time between the end of stdin, which asks a running bake to stop, and the exit of the process, seconds.
_GRACE = 0.6


def main() -> None:
    """Bake jobs until stdin ends."""
    # Ignore Ctrl-C, which all processes of the group receive, because the parent stops this process.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    end_with_parent(int(sys.argv[1]))
    # Native libraries may print to stdout: redirect descriptor 1 to stderr, and keep a copy for the messages.
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
    """Bake one job, and return the last message about it."""
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
        Any exception. If `explain` does not map it to a `BakerError`, its kind is `internal`.

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
        # The parent has closed the pipe. It has closed stdin as well, which stops the work.
        return


if __name__ == "__main__":
    main()
