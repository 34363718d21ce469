"""Runs a page kernel over bands of rows on several threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

# Rows of the page in a band: enough to make the overhead of a call negligible, few enough to balance threads.
ROWS = 64


def over_rows(kernel: Callable[[int, int], object], height: int, threads: int, band_rows: int = ROWS) -> None:
    """Call `kernel(first_row, end_row)` for all bands of a page of `height` rows.

    Parameters
    ----------
    kernel : callable
        Must write only the rows first_row to end_row - 1, so that the number of threads does not change the
        result.
    height : int
        Number of rows of the page.
    threads : int
        Number of threads; 1 runs the bands in the calling thread.
    band_rows : int
        Number of rows in a band.
    """
    bands = [(first, min(first + band_rows, height)) for first in range(0, height, band_rows)]
    if threads <= 1 or len(bands) == 1:
        for band in bands:
            kernel(*band)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(lambda band: kernel(*band), bands):
            pass
