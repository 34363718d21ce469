"""Reads glTF accessors into arrays, including strided, normalised and sparse ones and those without a view.

Based on: Khronos Group, glTF 2.0 Specification, section 3.6.2.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject

_DTYPE = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
FLOAT = 5126
UNSIGNED = (5121, 5123, 5125)
# Largest `count` accepted for an accessor without a buffer view, elements.
MAX_ZEROS = 1 << 22


def read_accessor(document: GltfDocument, index: int, *, types: tuple[str, ...]) -> NDArray[np.float32]:
    """Read the elements of an accessor as float32; normalised integers become 0 to 1 or -1 to 1.

    Parameters
    ----------
    document : GltfDocument
        The document.
    index : int
        A valid accessor index.
    types : tuple of str
        Allowed element types, such as ("VEC3",).

    Returns
    -------
    (N, width) float32
        The N elements; `width` is the number of components, 1 to 4.

    Raises
    ------
    InputError
        If the accessor is malformed, its element type is not in `types`, or its data exceeds its buffer view.
    """
    accessor = document.root.children("accessors")[index]
    raw = _rows(document, accessor, types)
    # Adding -0.0 turns signalling NaNs, which raise warnings in later casts, into quiet ones.
    with np.errstate(invalid="ignore"):
        value: NDArray[np.float32] = raw.astype(np.float32) + np.float32(-0.0)
    if accessor.boolean("normalized", False) and raw.dtype.kind in "iu":
        value /= np.float32(np.iinfo(raw.dtype).max)
        if raw.dtype.kind == "i":
            np.maximum(value, np.float32(-1.0), out=value)
    return value


def read_indices(document: GltfDocument, index: int) -> NDArray[np.int64]:
    """Read the values of an index accessor.

    Parameters
    ----------
    document : GltfDocument
        The document.
    index : int
        A valid accessor index.

    Returns
    -------
    (N,) int64
        The indices.

    Raises
    ------
    InputError
        If the accessor does not hold unsigned scalars, or its data lies outside its buffer view.
    """
    accessor = document.root.children("accessors")[index]
    if accessor.integer("componentType") not in UNSIGNED:
        accessor.fail("indices must have componentType 5121, 5123 or 5125", "componentType")
    return _rows(document, accessor, ("SCALAR",))[:, 0].astype(np.int64)


def component_type(document: GltfDocument, index: int) -> int:
    """Return the accessor's componentType."""
    return document.root.children("accessors")[index].integer("componentType")


def _rows(document: GltfDocument, accessor: JsonObject, types: tuple[str, ...]) -> NDArray[Any]:
    dtype = _dtype(accessor)
    kind = accessor.string("type")
    if kind not in types:
        accessor.fail(f"expected type {' or '.join(types)}, found '{kind[:20]}'", "type")
    width, count = _WIDTH[kind], accessor.integer("count", minimum=1)
    if "bufferView" in accessor:
        rows = _strided(document, accessor, dtype, count, width)
    elif count > MAX_ZEROS:
        accessor.fail(f"the accessor has {count} rows but no data", "count")
    else:
        rows = np.zeros((count, width), dtype)
    if "sparse" in accessor:
        rows = _apply_sparse(document, accessor.child("sparse"), rows)
    return rows


def _dtype(holder: JsonObject) -> np.dtype[Any]:
    code = holder.integer("componentType")
    if code not in _DTYPE:
        holder.fail(
            f"{code} is not a component type; known are {', '.join(map(str, _DTYPE))}", "componentType"
        )
    return np.dtype(_DTYPE[code])


def _strided(
    document: GltfDocument, holder: JsonObject, dtype: np.dtype[Any], count: int, width: int
) -> NDArray[Any]:
    """Return the elements, (count, width), without copying them; raise if they exceed the buffer view."""
    n_views = len(document.root.children("bufferViews"))
    data, view_offset, length, stride = document.view(holder.index("bufferView", n_views, "bufferViews"))
    offset, element = holder.integer("byteOffset", 0), dtype.itemsize * width
    if 0 < stride < element:
        holder.fail(f"the view's byteStride of {stride} is less than one element of {element} bytes")
    step = stride or element
    needed = offset + step * (count - 1) + element
    if needed > length:
        holder.fail(f"the data runs outside its view: {needed} bytes are needed, the view has {length}")
    return np.ndarray((count, width), dtype, data, view_offset + offset, (step, dtype.itemsize))


def _apply_sparse(document: GltfDocument, sparse: JsonObject, rows: NDArray[Any]) -> NDArray[Any]:
    count = sparse.integer("count", minimum=1)
    at, values = sparse.child("indices"), sparse.child("values")
    if at.integer("componentType") not in UNSIGNED:
        at.fail("indices must have componentType 5121, 5123 or 5125", "componentType")
    index = _strided(document, at, _dtype(at), count, 1)[:, 0].astype(np.int64)
    value = _strided(document, values, rows.dtype, count, rows.shape[1])
    if index.max() >= len(rows):
        at.fail(f"index {index.max()} is out of range: the accessor has {len(rows)} rows")
    out = rows.copy()
    out[index] = value
    return out
