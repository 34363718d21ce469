"""Work in tiles on a pool of threads, with progress and cancel between tiles.

Kernels release the GIL, so Python threads run them at the same time. Each tile writes its own part
of the output: results do not depend on the number of threads or on the order of tiles.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice

from baker.core.progress import Progress, report

# Seconds between two looks at the caller's wish to stop.
_LOOK = 0.1


def thread_count(threads: int | None) -> int:
    """Return `threads`, or the number of cores this process may use."""
    if threads:
        return threads
    if hasattr(os, "sched_getaffinity"):
        return max(len(os.sched_getaffinity(0)), 1)
    return os.cpu_count() or 1


def run_tiles(
    n: int,
    tile: int,
    work: Callable[[int, int], object],
    *,
    threads: int,
    stage: str,
    progress: Progress,
    rays_per_item: float = 0.0,
) -> None:
    """Call `work(begin, end)` for each tile of `tile` items out of n.

    Parameters
    ----------
    stage : str
        Name shown by `progress`.
    rays_per_item : float
        If positive, the rate shown is Mrays/s, else items per second.

    Raises
    ------
    Cancelled
        If `progress` answers so; running tiles end first, waiting ones never start.
    """
    report(progress, stage, 0.0)
    if n == 0:
        return
    spans = [(begin, min(begin + tile, n)) for begin in range(0, n, tile)]
    done = 0
    start = time.perf_counter()
    waiting = iter(spans)
    pool = ThreadPoolExecutor(max_workers=threads)
    running: dict[Future[object], int] = {}
    try:
        for begin, end in islice(waiting, 2 * threads):
            running[pool.submit(work, begin, end)] = end - begin
        while running:
            finished, _ = wait(running, timeout=_LOOK, return_when=FIRST_COMPLETED)
            for future in finished:
                done += running.pop(future)
                future.result()
                span = next(waiting, None)
                if span is not None:
                    running[pool.submit(work, *span)] = span[1] - span[0]
            elapsed = max(time.perf_counter() - start, 1e-9)
            rate = f"{done * rays_per_item / elapsed / 1e6:.1f} Mrays/s" if rays_per_item else ""
            report(progress, stage, done / n, rate)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)
