"""Sends named arrays through pipes between processes.

A message is a length in 8 bytes, little-endian, followed by an npz file of that length.
"""

from __future__ import annotations

import io
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray


def write_message(stream: IO[bytes], **array: NDArray[Any]) -> None:
    """Write a message.

    Parameters
    ----------
    stream : binary stream
        The stream.
    **array : array
        The arrays by name.
    """
    buffer = io.BytesIO()
    np.savez(buffer, allow_pickle=False, **array)
    data = buffer.getbuffer()
    stream.write(len(data).to_bytes(8, "little"))
    stream.write(data)
    stream.flush()


def read_message(stream: IO[bytes]) -> dict[str, NDArray[Any]] | None:
    """Read a message.

    Parameters
    ----------
    stream : binary stream
        The stream.

    Returns
    -------
    dict of str to array, or None
        The arrays by name; None if the stream has ended.
    """
    head = stream.read(8)
    if len(head) < 8:
        return None
    size = int.from_bytes(head, "little")
    data = stream.read(size)
    if len(data) < size:
        return None
    with np.load(io.BytesIO(data), allow_pickle=False) as message:
        return {name: message[name] for name in message.files}
