"""Packs a glTF document and all its data into one GLB file.

Accessors and buffer views keep their indices, because unknown extensions may refer to them. A new accessor or
view takes the list entry of replaced data if one is free; otherwise it is appended.

Based on: Khronos Group, glTF 2.0 specification, 3.6 Binary Data Storage and 4 GLB File Format.
"""

from __future__ import annotations

import copy
import hashlib
import json
import math
import struct
import sys
from collections.abc import Iterator
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import ResourceError
from baker.io.gltf.chunks import CHUNK_BIN, CHUNK_JSON
from baker.io.gltf.compact import drop_words

Json = dict[str, Any]

ARRAY_BUFFER = 34962
ELEMENT_ARRAY_BUFFER = 34963

COMPONENT: dict[int, np.dtype[Any]] = {
    5120: np.dtype("<i1"), 5121: np.dtype("<u1"), 5122: np.dtype("<i2"),
    5123: np.dtype("<u2"), 5125: np.dtype("<u4"), 5126: np.dtype("<f4"),
}  # fmt: skip

# Prefixes of extensions that are known to refer to no accessor and no buffer view.
_NO_DATA = (
    "KHR_materials_", "KHR_lights_punctual", "KHR_texture_", "EXT_texture_", "MSFT_texture_dds",
    "KHR_mesh_quantization", "KHR_xmp",
)  # fmt: skip


def is_index(value: object) -> TypeGuard[int]:
    """Return whether a JSON value is a non-negative integer.

    Parameters
    ----------
    value : object
        Any JSON value; True and False are no integers.

    Returns
    -------
    bool
        Whether the value can be an index.
    """
    return isinstance(value, int) and not isinstance(value, bool) and value >= 0


def objects(document: Json, key: str) -> Iterator[tuple[int, Json]]:
    """Yield the objects in a list of a document; skip elements that are no objects.

    Parameters
    ----------
    document : dict
        The document, or another object with lists.
    key : str
        Key of the list.

    Yields
    ------
    (int, dict)
        Index and object.
    """
    items = document.get(key)
    if isinstance(items, list):
        yield from ((number, item) for number, item in enumerate(items) if isinstance(item, dict))


class Packer:
    """Builds a GLB file: a document and the bytes of its single buffer.

    Parameters
    ----------
    document : dict
        glTF JSON; changed in place. Rewritten primitives must no longer refer to the accessors in `replaced`.
    buffers : tuple of bytes
        The buffers of the document.
    replaced : set of int
        Accessors that the rewritten primitives used before. An accessor is dropped if nothing else in the
        document can refer to it.
    missing : set of int
        Indices of buffers that cannot be read. Their entries stay in the document, after the single buffer.

    Attributes
    ----------
    chunks : tuple of (int, bytes)
        Type and content of further GLB chunks, which follow the buffer.
    """

    def __init__(
        self,
        document: Json,
        buffers: tuple[bytes, ...] = (),
        replaced: frozenset[int] = frozenset(),
        *,
        missing: frozenset[int] = frozenset(),
    ) -> None:
        self.document = document
        self.chunks: tuple[tuple[int, bytes], ...] = ()
        self._missing = [item for k, item in enumerate(document.get("buffers", [])) if k in missing]
        self._accessors: list[Json] = document.get("accessors", [])
        self._views: list[Json] = document.get("bufferViews", [])
        self._cache: dict[tuple[bytes, str], int] = {}
        self._free_accessors, self._free_views = _unused(document, replaced)
        self._chunks, self._length = _merge(self._views, buffers, self._free_views, sorted(missing))

    def add_bytes(self, data: bytes, **keys: Any) -> int:
        """Append `data` in a new buffer view, and return the index of the view."""
        view = {"buffer": 0, "byteOffset": self._length, "byteLength": len(data), **keys}
        padded = data + b"\0" * (-len(data) % 4)
        self._chunks.append(padded)
        self._length += len(padded)
        return _place(self._views, self._free_views, view)

    def add_rows(self, rows: NDArray[np.uint8], like: Json, *, bounds: bool = False) -> int:
        """Add a vertex attribute and return the index of its accessor.

        Parameters
        ----------
        rows : (N, B) uint8
            Bytes of each element.
        like : dict
            Accessor from which component type, type, normalisation, name and extras are copied.
        bounds : bool
            Write `min` and `max` even if `like` has none. Matrices and infinite values get neither.

        Returns
        -------
        int
            Index of the accessor.
        """
        size = rows.shape[1]
        # Align elements to four bytes (glTF 2.0, section 3.6.2.4).
        padded = rows
        if size % 4:
            padded = np.zeros((len(rows), size + -size % 4), np.uint8)
            padded[:, :size] = rows
        keep = {key: value for key, value in like.items() if key not in _OWN_KEYS}
        accessor: Json = {**copy.deepcopy(keep), "count": len(rows)}
        if (bounds or "min" in like) and not like["type"].startswith("MAT"):
            accessor.update(_bounds(rows, COMPONENT[like["componentType"]]))
        stride = {"byteStride": padded.shape[1]} if size % 4 else {}
        return self._add(padded.tobytes(), accessor, {"target": ARRAY_BUFFER, **stride})

    def add_floats(self, values: NDArray[np.float32], *, bounds: bool = False) -> int:
        """Add a float vertex attribute (N, C), C = 2 to 4, and return the index of its accessor."""
        like = {"componentType": 5126, "type": f"VEC{values.shape[1]}"}
        data = np.ascontiguousarray(values, "<f4")
        return self.add_rows(data.view(np.uint8).reshape(len(data), -1), like, bounds=bounds)

    def add_indices(self, triangle: NDArray[np.integer[Any]]) -> int:
        """Add triangle corners (T, 3) as 16-bit or 32-bit indices, and return the index of the accessor.

        8-bit indices are valid but slow or unsupported in current graphics APIs. The 16-bit index 65535 means
        primitive restart, so 16-bit indices are used only up to 65534.
        """
        kind = 5123 if int(triangle.max(initial=0)) < 65535 else 5125
        data = triangle.ravel().astype(COMPONENT[kind]).tobytes()
        accessor = {"componentType": kind, "count": triangle.size, "type": "SCALAR"}
        return self._add(data, accessor, {"target": ELEMENT_ARRAY_BUFFER})

    def glb(self) -> bytes:
        """Return the content of the file; call it once, after all data is added.

        Raises
        ------
        ResourceError
            If the file would have 4 GiB or more.
        """
        _tidy(self._accessors, self._free_accessors, {"componentType": 5126, "count": 1, "type": "SCALAR"})
        _tidy(self._views, self._free_views, {"buffer": 0, "byteOffset": 0, "byteLength": 4})
        for key, items in (("accessors", self._accessors), ("bufferViews", self._views)):
            if items:
                self.document[key] = items
            else:
                self.document.pop(key, None)
        binary = b"".join(self._chunks) or b"\0" * (4 * bool(self._missing))
        if binary:
            whole = [b for _, b in objects(self.document, "buffers") if b not in self._missing]
            first = whole[0] if whole else {}
            kept = {key: value for key, value in first.items() if key not in ("uri", "byteLength")}
            self.document["buffers"] = [{**kept, "byteLength": len(binary)}, *self._missing]
        else:
            self.document.pop("buffers", None)
        text = _dump(self.document)
        text += b" " * (-len(text) % 4)
        parts = [struct.pack("<II", len(text), CHUNK_JSON), text]
        if binary:
            parts += [struct.pack("<II", len(binary), CHUNK_BIN), binary]
        for kind, data in self.chunks:
            padded = data + b"\0" * (-len(data) % 4)
            parts += [struct.pack("<II", len(padded), kind), padded]
        total = 12 + sum(map(len, parts))
        if total >= 2**32:
            raise ResourceError(
                f"the scene takes {total / 2**30:.1f} GiB, but GLB files end at 4; split the scene"
            )
        return struct.pack("<III", 0x46546C67, 2, total) + b"".join(parts)

    def _add(self, data: bytes, accessor: Json, keys: Json) -> int:
        """Add an accessor with a new view; if an equal one was added before, return the index of that one."""
        name = (hashlib.sha256(data).digest(), json.dumps([accessor, keys], sort_keys=True))
        if name not in self._cache:
            view = self.add_bytes(data, **keys)
            self._cache[name] = _place(
                self._accessors, self._free_accessors, {"bufferView": view, **accessor}
            )
        return self._cache[name]


def _dump(document: Json) -> bytes:
    try:
        return json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    except ValueError:
        # Numbers such as 1e999 in extras are valid JSON, but infinite in Python.
        return json.dumps(_finite(document), separators=(",", ":"), allow_nan=False).encode()


def _finite(node: Any) -> Any:
    """Return a JSON value with infinite numbers replaced by the largest finite ones."""
    if isinstance(node, dict):
        return {key: _finite(value) for key, value in node.items()}
    if isinstance(node, list):
        return [_finite(value) for value in node]
    if isinstance(node, float) and math.isinf(node):
        return math.copysign(sys.float_info.max, node)
    return node


_OWN_KEYS = {"bufferView", "byteOffset", "count", "sparse", "min", "max"}


def primitive_accessors(primitive: Json) -> Iterator[int]:
    """Yield the accessors that a primitive refers to."""
    targets = primitive.get("targets")
    holders = [primitive.get("attributes"), *(targets if isinstance(targets, list) else [])]
    for holder in holders:
        if isinstance(holder, dict):
            yield from filter(is_index, holder.values())
    if is_index(primitive.get("indices")):
        yield primitive["indices"]


def _bounds(rows: NDArray[np.uint8], dtype: np.dtype[Any]) -> Json:
    """Return min and max of an accessor; return {} without rows, or if a value is not finite."""
    values = np.ascontiguousarray(rows).view(dtype)
    if not len(values) or not np.isfinite(values).all():
        return {}
    return {"min": values.min(axis=0).tolist(), "max": values.max(axis=0).tolist()}


def _place(items: list[Json], free: list[int], item: Json) -> int:
    """Store `item` in the first free entry of the list, or append it; return its index."""
    if free:
        index = free.pop(0)
        items[index] = item
        return index
    items.append(item)
    return len(items) - 1


def _tidy(items: list[Json], free: list[int], blank: Json) -> None:
    """Remove free entries from the end of the list, and overwrite all other free entries with `blank`."""
    while free and free[-1] == len(items) - 1:
        free.pop()
        items.pop()
    for index in free:
        items[index] = dict(blank)


def _unused(document: Json, replaced: frozenset[int]) -> tuple[list[int], list[int]]:
    """Return the replaced accessors that nothing else can refer to, and the views that only they use."""
    used: set[int] = set()
    for _, mesh in objects(document, "meshes"):
        for _, primitive in objects(mesh, "primitives"):
            used.update(primitive_accessors(primitive))
    for _, skin in objects(document, "skins"):
        used.update(filter(is_index, [skin.get("inverseBindMatrices")]))
    for _, animation in objects(document, "animations"):
        for _, sampler in objects(animation, "samplers"):
            used.update(filter(is_index, [sampler.get("input"), sampler.get("output")]))
    named = set(_numbers(document, False))
    accessors = document.get("accessors", [])
    free = sorted(index for index in replaced - used - named if index < len(accessors))
    gone = set(free)
    views = {view for index in free for view in _views_of(accessors[index])}
    kept = {
        view
        for index, item in objects(document, "accessors")
        if index not in gone
        for view in _views_of(item)
    }
    kept.update(
        image["bufferView"] for _, image in objects(document, "images") if is_index(image.get("bufferView"))
    )
    extended = {index for index, view in objects(document, "bufferViews") if view.get("extensions")}
    known = len(document.get("bufferViews", []))
    return free, sorted(view for view in views - kept - named - extended if view < known)


def _views_of(accessor: Any) -> Iterator[int]:
    if not isinstance(accessor, dict):
        return
    sparse = accessor.get("sparse")
    holders = [accessor]
    if isinstance(sparse, dict):
        holders += [sparse.get("indices", {}), sparse.get("values", {})]
    for holder in holders:
        if isinstance(holder, dict) and is_index(holder.get("bufferView")):
            yield holder["bufferView"]


def _numbers(node: Any, collect: bool) -> Iterator[int]:
    """Yield every integer in extensions that may be the index of an accessor or a view."""
    if isinstance(node, dict):
        for key, value in node.items():
            if key == "extensions" and isinstance(value, dict):
                for name, extension in value.items():
                    yield from _numbers(extension, not name.startswith(_NO_DATA))
            else:
                yield from _numbers(value, collect)
    elif isinstance(node, list):
        for value in node:
            yield from _numbers(value, collect)
    elif collect and isinstance(node, int) and not isinstance(node, bool):
        yield node


def _merge(
    views: list[Json], buffers: tuple[bytes, ...], free: list[int], missing: list[int]
) -> tuple[list[bytes], int]:
    """Concatenate all readable buffers without the bytes that only free views cover.

    Return the parts of the new buffer, and its length in bytes.

    The views are changed in place: `buffer` becomes 0 and `byteOffset` is updated. Missing buffers get the
    indices 1, 2, ..., which are written to their views.
    """
    gone = set(free)
    chunks: list[bytes] = []
    length = 0
    holders = [(index, view) for index, view in enumerate(views) if isinstance(view, dict)]
    # Compression extensions of views have `buffer` and `byteOffset` as well, so update them in the same way.
    holders += [
        (-1, extension)
        for _, view in holders
        for extension in extensions_of(view)
        if isinstance(extension, dict) and "buffer" in extension
    ]
    moved: list[tuple[Json, int]] = []
    for number, data in enumerate(buffers):
        if number in missing:
            continue
        # Leave views that exceed their buffer unchanged; see `dangling.py`.
        mine = [
            (index, holder, span)
            for index, holder in holders
            if holder.get("buffer") == number and (span := view_span(holder, len(data))) is not None
        ]
        dead = [span for index, _, span in mine if index in gone]
        kept, before = drop_words(data, dead, [span for index, _, span in mine if index not in gone])
        for index, holder, (start, _) in mine:
            if index not in gone:
                moved.append((holder, length + start - 4 * int(before[start // 4])))
        chunks.append(kept)
        length += len(chunks[-1])
    for _, holder in holders:
        if holder.get("buffer") in missing:
            holder["buffer"] = 1 + missing.index(holder["buffer"])
    for holder, offset in moved:
        holder["buffer"] = 0
        if offset or "byteOffset" in holder:
            holder["byteOffset"] = offset
    return chunks, length


def extensions_of(holder: Json) -> list[Any]:
    """Return the values of all extensions of an object."""
    extensions = holder.get("extensions")
    return list(extensions.values()) if isinstance(extensions, dict) else []


def view_span(view: Json, size: int) -> tuple[int, int] | None:
    """Return the range of bytes of a view, end exclusive, or None if it exceeds its buffer."""
    start, length = view.get("byteOffset", 0), view.get("byteLength")
    if not is_index(start) or not is_index(length) or start + length > size:
        return None
    return start, start + length
