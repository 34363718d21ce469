"""Reads the elements of accessors as bytes, to reorder vertices without converting them.

Based on: Khronos Group, glTF 2.0 specification, 3.6.2 Accessors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.io.gltf.packer import COMPONENT, Json

_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_MATRIX = {"MAT2": 2, "MAT3": 3, "MAT4": 4}


def element_size(accessor: Json) -> int:
    """Return the size of an element in bytes; each matrix column is padded to a multiple of four bytes."""
    component = COMPONENT[accessor["componentType"]].itemsize
    if accessor["type"] in _MATRIX:
        side = _MATRIX[accessor["type"]]
        return side * (-(-side * component // 4) * 4)
    return _WIDTH[accessor["type"]] * component


def gather_rows(
    document: Json, buffers: tuple[bytes, ...], index: int, rows: NDArray[np.int32]
) -> NDArray[np.uint8]:
    """Return the bytes of chosen elements of an accessor; the accessor may be sparse.

    Parameters
    ----------
    document : dict
        glTF JSON.
    buffers : tuple of bytes
        Buffers of the document.
    index : int
        Index of the accessor.
    rows : (N,) int32
        Indices of the chosen elements; an index may occur more than once.

    Returns
    -------
    (N, B) uint8
        The B bytes of each chosen element.

    Raises
    ------
    InputError
        If the accessor is malformed, exceeds its buffer or has too few elements.
    """
    name = f"accessor {index}"
    if not isinstance(index, int) or not 0 <= index < len(document.get("accessors", [])):
        raise InputError("its data cannot be read: there is no such accessor", object=name)
    try:
        accessor = document["accessors"][index]
        size, count = element_size(accessor), accessor["count"]
        if len(rows) and int(rows.max()) >= count:
            raise InputError(f"it has {count} elements where {int(rows.max()) + 1} are needed", object=name)
        if "bufferView" in accessor:
            offset = accessor.get("byteOffset", 0)
            data = _elements(document, buffers, accessor["bufferView"], offset, count, size)[rows]
        else:
            data = np.zeros((len(rows), size), np.uint8)
        if "sparse" in accessor:
            _substitute(document, buffers, accessor, rows, data)
    except (AttributeError, KeyError, IndexError, TypeError, ValueError) as error:
        raise InputError(f"its data cannot be read ({error!r}); repair the file", object=name) from None
    return data


def fault_of(document: Json, buffers: tuple[bytes, ...], index: Any, n_rows: int) -> InputError | None:
    """Return the error that reading the first `n_rows` elements of an accessor raises, or None.

    Parameters
    ----------
    document : dict
        glTF JSON.
    buffers : tuple of bytes
        Buffers of the document.
    index : Any
        Index of the accessor, possibly of a wrong type.
    n_rows : int
        Number of elements that are needed.

    Returns
    -------
    InputError or None
        None if the elements can be read.
    """
    try:
        # Reading the first and last element is enough, because `_elements` checks the range of all bytes.
        gather_rows(document, buffers, index, np.array([0, max(n_rows - 1, 0)], np.int32))
    except InputError as error:
        return error
    return None


def _elements(
    document: Json, buffers: tuple[bytes, ...], view_index: int, offset: int, count: int, size: int
) -> NDArray[np.uint8]:
    """Return the elements of a buffer view as bytes, (count, size), read-only and without copying them."""
    view = document["bufferViews"][view_index]
    stride = view.get("byteStride", size)
    start = view.get("byteOffset", 0) + offset
    span = stride * (count - 1) + size
    buffer = buffers[view["buffer"]]
    if start < 0 or offset + span > view["byteLength"] or start + span > len(buffer):
        raise InputError("it reaches beyond its buffer", object=f"buffer view {view_index}")
    flat = np.frombuffer(buffer, np.uint8, span, start)
    return np.lib.stride_tricks.as_strided(flat, (count, size), (stride, 1), writeable=False)


def _substitute(
    document: Json,
    buffers: tuple[bytes, ...],
    accessor: Json,
    rows: NDArray[np.int32],
    data: NDArray[np.uint8],
) -> None:
    """Overwrite the rows of `data` whose element has a sparse value; row i of `data` is element `rows[i]`."""
    sparse: dict[str, Any] = accessor["sparse"]
    count, size = sparse["count"], element_size(accessor)
    dtype = COMPONENT[sparse["indices"]["componentType"]]
    where, what = sparse["indices"], sparse["values"]
    indices = _elements(
        document, buffers, where["bufferView"], where.get("byteOffset", 0), count, dtype.itemsize
    )
    values = _elements(document, buffers, what["bufferView"], what.get("byteOffset", 0), count, size)
    replaced = np.full(accessor["count"], -1, np.int64)
    replaced[np.ascontiguousarray(indices).view(dtype).ravel()] = np.arange(count)
    found = replaced[rows]
    data[found >= 0] = values[found[found >= 0]]
