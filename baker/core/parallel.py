"""Runs tiles of work on a pool of threads, with progress reports and cancellation between tiles.

A tile is a range of items, such as texels. Kernels release the GIL, so several Python threads run them at the
same time. Each tile writes a separate part of the output, so results depend neither on the number of threads
nor on the order of tiles.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from itertools import islice
from typing import Any, Protocol

from baker.core.progress import Progress, report
from baker.core.stage import Stage

# Time after which progress is reported even if no tile has finished, seconds. The caller may cancel at each
# report.
_REPORT_SECONDS = 0.1


def thread_count(threads: int | None) -> int:
    """Return the number of threads to use.

    Parameters
    ----------
    threads : int or None
        Requested number; None or 0 for one thread per core.

    Returns
    -------
    int
        The requested number, or the number of cores that this process may use.
    """
    if threads:
        return threads
    if hasattr(os, "sched_getaffinity"):
        return max(len(os.sched_getaffinity(0)), 1)
    return os.cpu_count() or 1


# The result of a tile, a tuple of arrays with one row for each item and of numbers, such as numbers of rays.
Part = tuple[Any, ...]


class TileRunner(Protocol):
    """Runs all tiles of a stage, in this process (`run_tiles`) or in other processes."""

    def __call__(
        self,
        n: int,
        tile: int,
        work: Callable[[int, int], Part],
        *,
        keep: Callable[[int, int, Part], object],
        threads: int,
        stage: Stage,
        progress: Progress,
        rays_per_item: float = 0.0,
    ) -> None:
        """Call `keep(begin, end, work(begin, end))` for each tile; see `run_tiles`."""


def run_tiles(
    n: int,
    tile: int,
    work: Callable[[int, int], Any],
    *,
    keep: Callable[[int, int, Any], object] | None = None,
    threads: int,
    stage: Stage,
    progress: Progress,
    rays_per_item: float = 0.0,
) -> None:
    """Call `work(begin, end)` for each tile of `tile` items out of `n`.

    Parameters
    ----------
    n, tile : int
        Number of items, and number of items in a tile. The last tile may have fewer.
    work : callable
        `work(begin, end)` returns the result of the tile of items `begin` to `end - 1`.
    keep : callable or None
        `keep(begin, end, part)` stores the result `part` of a tile, in the thread that computed it. None if
        `work` stores its result.
    threads : int
        Number of threads.
    stage : Stage
        Name of the stage in progress reports.
    progress : Progress
        Receives reports, and may cancel.
    rays_per_item : float
        Number of rays per item. If it is positive, progress reports contain the mean rate in Mrays/s.

    Raises
    ------
    Cancelled
        If `progress` cancels. Running tiles end first; waiting tiles do not start.
    """
    report(progress, stage, 0.0)
    if n == 0:
        return
    done, start = 0, time.perf_counter()
    waiting = iter((begin, min(begin + tile, n)) for begin in range(0, n, tile))
    do = _work_and_keep(work, keep)
    pool = ThreadPoolExecutor(max_workers=threads)
    running: dict[Future[object], int] = {}
    try:
        for begin, end in islice(waiting, 2 * threads):
            running[pool.submit(do, begin, end)] = end - begin
        while running:
            finished, _ = wait(running, timeout=_REPORT_SECONDS, return_when=FIRST_COMPLETED)
            for future in finished:
                done += running.pop(future)
                future.result()
                span = next(waiting, None)
                if span is not None:
                    running[pool.submit(do, *span)] = span[1] - span[0]
            elapsed = max(time.perf_counter() - start, 1e-9)
            rate = f"{done * rays_per_item / elapsed / 1e6:.1f} Mrays/s" if rays_per_item else ""
            report(progress, stage, done / n, rate)
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def _work_and_keep(
    work: Callable[[int, int], Any], keep: Callable[[int, int, Any], object] | None
) -> Callable[[int, int], object]:
    """Return a function (begin, end) that calls `work` and, if `keep` is not None, `keep` with the result."""
    if keep is None:
        return work

    def do(begin: int, end: int) -> None:
        keep(begin, end, work(begin, end))

    return do
