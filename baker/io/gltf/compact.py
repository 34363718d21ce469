"""Removes unused bytes from a buffer, in words of four bytes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

# First byte of a range, and the byte after its last one.
Span = tuple[int, int]


def drop_words(data: bytes, dead: Iterable[Span], live: Iterable[Span]) -> tuple[bytes, NDArray[np.int64]]:
    """Remove the words of four bytes that dead ranges cover and live ranges do not touch.

    Parameters
    ----------
    data : bytes
        The buffer.
    dead, live : iterable of (int, int)
        Ranges of bytes within the buffer.

    Returns
    -------
    data : bytes
        The remaining words; the last one is filled with zeros.
    before : (W + 1,) int64
        Number of removed words before each of the W words of the buffer; the last item is the number of all
        removed words.
    """
    words = np.frombuffer(data + b"\0" * (-len(data) % 4), np.uint32)
    drop = np.zeros(len(words), bool)
    for start, end in dead:
        drop[-(-start // 4) : end // 4] = True
    for start, end in live:
        drop[start // 4 : -(-end // 4)] = False
    before = np.concatenate([[0], np.cumsum(drop, dtype=np.int64)])
    return (words[~drop] if drop.any() else words).tobytes(), before
