"""Decodes the stream of one compressed buffer view; checks all sizes before memory is allocated.

Based on: Khronos Group, EXT_meshopt_compression and KHR_meshopt_compression.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.io.meshopt.attribute_codec import BLOCK_BYTES, BLOCK_ELEMENTS, GROUP, decode_attributes
from baker.io.meshopt.filters import FILTERS, apply_filter
from baker.io.meshopt.index_codec import decode_indices, decode_triangles
from baker.io.meshopt.status import DONE, REASONS, TOO_SHORT

# First bytes of streams: 0xa0 and 0xa1 attributes, 0xe1 triangles, 0xd1 indices.
_HEADERS = {"ATTRIBUTES": (0xA0, 0xA1), "TRIANGLES": (0xE1,), "INDICES": (0xD1,)}


class StreamError(Exception):
    """A stream cannot be decoded; the message is the reason."""


class Layout(NamedTuple):
    """How the elements of a compressed view are stored.

    Attributes
    ----------
    mode : str
        ATTRIBUTES, TRIANGLES or INDICES.
    filter : str
        A name in `FILTERS`, or NONE.
    elements : int
        Number of elements.
    stride : int
        Bytes of an element.
    """

    mode: str
    filter: str
    elements: int
    stride: int


def decode_stream(source: NDArray[np.uint8], layout: Layout) -> NDArray[np.uint8]:
    """Decode a stream.

    Parameters
    ----------
    source : (N,) uint8
        The compressed bytes.
    layout : Layout
        The layout of the elements, not checked yet.

    Returns
    -------
    (elements x stride,) uint8
        The elements.

    Raises
    ------
    StreamError
        If the layout is invalid, or does not fit the stream.
    """
    _check_layout(layout)
    if not len(source) or source[0] not in _HEADERS[layout.mode]:
        raise StreamError(f"the compressed data is no stream of the mode {layout.mode}")
    if len(source) < _shortest(layout, int(source[0]) & 1):
        raise StreamError(REASONS[TOO_SHORT])
    if layout.mode == "ATTRIBUTES":
        out = np.zeros(layout.elements * layout.stride, np.uint8)
        version = int(source[0]) & 1
        status = decode_attributes(source, layout.elements, layout.stride, version, out)
    else:
        index = np.zeros(layout.elements, np.uint16 if layout.stride == 2 else np.uint32)
        decode = decode_triangles if layout.mode == "TRIANGLES" else decode_indices
        status, out = decode(source, index), index.view(np.uint8)
    if status != DONE:
        raise StreamError(REASONS[status])
    if layout.filter != "NONE":
        apply_filter(layout.filter, out, layout.stride)
    return out


def _check_layout(layout: Layout) -> None:
    mode, name, count, stride = layout
    if mode not in _HEADERS:
        raise StreamError(f"'{mode[:20]}' is no mode; known are {', '.join(_HEADERS)}")
    if name != "NONE" and name not in FILTERS:
        raise StreamError(f"'{name[:20]}' is no filter; known are NONE, {', '.join(FILTERS)}")
    if mode == "ATTRIBUTES":
        if stride % 4 or not 4 <= stride <= 256:
            raise StreamError(f"byteStride is {stride}, but must be a multiple of 4 from 4 to 256")
        sizes = FILTERS[name][1] if name != "NONE" else ()
        if sizes and stride not in sizes:
            raise StreamError(f"the filter {name} does not exist for a byteStride of {stride}")
        return
    if name != "NONE":
        raise StreamError(f"the mode {mode} has no filter {name}")
    if stride not in (2, 4):
        raise StreamError(f"byteStride is {stride}, but must be 2 or 4")
    if mode == "TRIANGLES" and count % 3:
        raise StreamError(f"{count} indices are no whole number of triangles")


def _shortest(layout: Layout, version: int) -> int:
    """Return the size of the shortest stream with this layout, bytes."""
    mode, _, count, stride = layout
    if mode == "TRIANGLES":
        return 1 + count // 3 + 16
    if mode == "INDICES":
        return 1 + count + 4
    step = min(BLOCK_ELEMENTS, BLOCK_BYTES // stride // GROUP * GROUP)
    blocks = -(-count // step)
    tail = max(24, stride + stride // 4) if version else max(32, stride)
    # In version 1, a block has at least two bits for each byte of an element. In version 0, each byte of an
    # element has at least one byte for every four groups.
    body = blocks * (stride // 4) if version else stride * (-(-count // (4 * GROUP)))
    return 1 + body + tail
