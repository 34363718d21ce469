"""Runs a page kernel over bands of rows on several threads."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

# Rows of a band: enough that the call's overhead is negligible, few enough for an even distribution.
ROWS = 64


def over_rows(kernel: Callable[[int, int], object], height: int, threads: int, band_rows: int = ROWS) -> None:
    """Call `kernel(first_row, end_row)` for all bands of a page of `height` rows.

    Parameters
    ----------
    kernel : callable
        Must write its own rows only, so that the number of threads cannot change the result.
    height : int
    threads : int
        At least 1.
    band_rows : int
    """
    bands = [(first, min(first + band_rows, height)) for first in range(0, height, band_rows)]
    if threads <= 1 or len(bands) == 1:
        for band in bands:
            kernel(*band)
        return
    with ThreadPoolExecutor(threads) as pool:
        for _ in pool.map(lambda band: kernel(*band), bands):
            pass
