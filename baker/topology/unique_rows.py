"""Finds rows of arrays that are equal bit for bit.

Rows are compared by a 64-bit hash first, which is fast for millions of rows. Rows with equal hashes are then
compared in full, so that different rows are never merged.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

# Up to this number of rows, a dictionary is used, which is then faster than NumPy. Scenes may have many
# meshes with few rows.
FEW = 64


def first_equal(column: Sequence[NDArray[np.generic]], n_rows: int) -> NDArray[np.int64]:
    """Return for each row the index of the first row that equals it, bit for bit.

    Parameters
    ----------
    column : sequence of (N, any) arrays
        Two rows are equal if they are equal in every array.
    n_rows : int
        N, which cannot be derived from `column` if that is empty; all rows are then equal.

    Returns
    -------
    (N,) int64
        Index of the first equal row.
    """
    if n_rows == 0:
        return np.zeros(0, np.int64)
    if n_rows <= FEW:
        parts = [byte_rows(array) for array in column]
        rows = [b"".join(row) for row in zip(*parts, strict=True)] if parts else [b""] * n_rows
        index_of: dict[bytes, int] = {}
        return np.array([index_of.setdefault(row, k) for k, row in enumerate(rows)], np.int64)
    data = [_words(array) for array in column]
    key = np.zeros(n_rows, np.uint64)
    for words in data:
        for k in range(words.shape[1]):
            key = mix(key ^ words[:, k])
    _, index, inverse = np.unique(key, return_index=True, return_inverse=True)
    first: NDArray[np.int64] = index[inverse].astype(np.int64)
    if all(np.array_equal(words, words[first]) for words in data):
        return first
    # Two different rows have the same hash, which is very unlikely. Sort the rows instead of their hashes.
    joined = np.concatenate(data, axis=1)
    _, index, inverse = np.unique(joined, axis=0, return_index=True, return_inverse=True)
    return index[inverse.ravel()].astype(np.int64)


def unique_rows(
    column: Sequence[NDArray[np.generic]], n_rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first index of each of the K distinct rows, and for each row the number of its distinct row.

    Parameters
    ----------
    column : sequence of (N, any) arrays
        Two rows are equal if they are equal in every array, bit for bit.
    n_rows : int
        N. It is needed if `column` is empty; all rows are then equal.

    Returns
    -------
    first : (K,) int64
        Index of the first row with each distinct value, ascending.
    inverse : (N,) int64
        Row i equals row `first[inverse[i]]`.

    Notes
    -----
    -0 and 0 have different bits. Add 0 to an array in which they should be equal.
    """
    equal = first_equal(column, n_rows)
    is_first = equal == np.arange(n_rows)
    return np.flatnonzero(is_first), (np.cumsum(is_first) - 1)[equal]


def byte_rows(array: NDArray[np.generic]) -> list[bytes]:
    """Return the bytes of each row of an array.

    Parameters
    ----------
    array : (N, any) array
        Few rows, because one Python object is made for each.

    Returns
    -------
    list of bytes
        N items.
    """
    whole = np.ascontiguousarray(array).tobytes()
    width = len(whole) // max(len(array), 1)
    return [whole[k * width : (k + 1) * width] for k in range(len(array))]


def _words(array: NDArray[np.generic]) -> NDArray[np.uint64]:
    """Return the bytes of each of N rows as 64-bit words (N, K) uint64, padded with zeros."""
    flat = np.ascontiguousarray(array).reshape(len(array), -1).view(np.uint8)
    padded = np.pad(flat, ((0, 0), (0, -flat.shape[1] % 8)))
    return padded.view(np.uint64)


def mix(value: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Return a hash (N,) of each number (N,). One changed bit of a number changes about half of the hash."""
    # Based on: Sebastiano Vigna, SplitMix64's finaliser, 2015.
    value = value + np.uint64(0x9E3779B97F4A7C15)
    value = (value ^ (value >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    value = (value ^ (value >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return value ^ (value >> np.uint64(31))
