"""Runs a kernel over bands of rows of an array, usually a page, on several threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

# Number of rows in a band. With fewer rows, the overhead of the calls would matter. With more
# rows, some threads would wait for the last bands.
ROWS = 64


def over_rows(kernel: Callable[[int, int], object], height: int, threads: int, band_rows: int = ROWS) -> None:
    """Call `kernel(first_row, end_row)` for each band of an array of `height` rows.

    Parameters
    ----------
    kernel : callable
        The function to call. It must write only the rows first_row to end_row - 1, so that the result does
        not depend on the number of threads.
    height : int
        Number of rows of the array.
    threads : int
        Number of threads; with 1, the bands run in the calling thread.
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
