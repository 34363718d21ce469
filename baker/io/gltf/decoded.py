"""Stores decoded data in a document as a further buffer, and removes the compressed data from its buffers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.io.gltf.compact import drop_words
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.packer import Json, extensions_of, is_index, objects, view_span
from baker.io.regular_file import LARGEST


class DecodedData:
    """Collects decoded data.

    Parameters
    ----------
    document : GltfDocument
        Its JSON is changed in place: views are redirected to the new buffer.

    Attributes
    ----------
    faults : dict of str to InputError
        Errors of data that could not be decoded, by the path of the JSON object, such as "bufferViews[3]".
    """

    def __init__(self, document: GltfDocument) -> None:
        self._document = document
        self._root = document.root.value
        self._number = len(document.buffers)
        self._parts: list[NDArray[np.uint8]] = []
        self._dead: dict[int, list[tuple[int, int]]] = {}
        self._left: set[int] = set()
        self.length = 0
        self.faults: dict[str, InputError] = {}

    def has_room(self, size: int) -> bool:
        """Return whether `size` more bytes may be decoded."""
        return self.length + size <= LARGEST

    def append(self, view: Json, data: NDArray[np.uint8]) -> None:
        """Append (N,) uint8 to the new buffer, and let a view refer to it."""
        if is_index(view.get("buffer")):
            self._left.add(view["buffer"])
        view["buffer"], view["byteOffset"], view["byteLength"] = self._number, self.length, len(data)
        self._parts += [data, np.zeros(-len(data) % 4, np.uint8)]
        self.length += len(data) + -len(data) % 4

    def drop(self, buffer: int, offset: int, length: int) -> None:
        """Mark bytes and their padding as unused; `finish` removes those that nothing else refers to."""
        end = offset + length
        self._dead.setdefault(buffer, []).append((offset, end + -end % 4))

    def finish(self, names: tuple[str, ...]) -> GltfDocument:
        """Return the document with the new buffer, and without extensions that are no longer used.

        Parameters
        ----------
        names : tuple of str
            The extensions whose data was decoded.
        """
        buffers = list(self._document.buffers)
        for number, dead in self._dead.items():
            buffers[number] = self._without(number, buffers[number], dead)
        faults = dict(self._document.buffer_faults)
        if self._parts:
            buffers.append(b"".join(part.data for part in self._parts))
            self._root["buffers"].append({"byteLength": self.length})
        # Forget the errors of placeholder buffers, which stand for uncompressed data that is not in the file.
        named = (holder.get("buffer") for holder in _holders(self._root))
        for number in self._left - set(filter(is_index, named)):
            if faults.pop(number, None) is not None:
                buffers[number] = b""
        for name in names:
            if not _mentions(self._root, name):
                _forget(self._root, name)
        for key in ("buffers", "bufferViews", "accessors"):
            self._document.root.forget(key)
        return replace(
            self._document,
            buffers=tuple(buffers),
            buffer_faults=faults,
            data_faults={**self._document.data_faults, **self.faults},
        )

    def _without(self, number: int, data: bytes, dead: list[tuple[int, int]]) -> bytes:
        """Return the data of a buffer without the dead bytes, and move the views of the buffer."""
        live = [
            (holder, span)
            for holder in _holders(self._root)
            if holder.get("buffer") == number and (span := view_span(holder, len(data))) is not None
        ]
        data, before = drop_words(data, dead, [span for _, span in live])
        for holder, (start, _) in live:
            holder["byteOffset"] = start - 4 * int(before[start // 4])
        self._root["buffers"][number]["byteLength"] = len(data)
        return data


def _holders(root: Json) -> list[Json]:
    """Return the views and the extensions of views that refer to a buffer."""
    views = [view for _, view in objects(root, "bufferViews")]
    inside = [item for view in views for item in extensions_of(view) if isinstance(item, dict)]
    return views + [item for item in inside if "buffer" in item]


def _mentions(root: Json, name: str) -> bool:
    """Return whether a view, or a primitive of a mesh, still has an extension."""
    primitives = (p for _, mesh in objects(root, "meshes") for _, p in objects(mesh, "primitives"))
    views = (view for _, view in objects(root, "bufferViews"))
    return any(name in _extensions(holder) for holder in (*views, *primitives))


def _extensions(holder: Json) -> Any:
    extensions = holder.get("extensions")
    return extensions if isinstance(extensions, dict) else {}


def remove_extension(holder: Json, name: str) -> None:
    """Remove an extension from an object, and an empty `extensions` as well.

    Parameters
    ----------
    holder : dict
        The object; changed in place.
    name : str
        Name of the extension.
    """
    if name in _extensions(holder):
        del holder["extensions"][name]
        if not holder["extensions"]:
            del holder["extensions"]


def is_listed(root: Json, names: tuple[str, ...]) -> bool:
    """Return whether the document lists one of the extensions as used or required.

    Parameters
    ----------
    root : dict
        The document.
    names : tuple of str
        Names of extensions.

    Returns
    -------
    bool
        Whether a list contains one of them.
    """
    listed = (*root.get("extensionsUsed", []), *root.get("extensionsRequired", []))
    return any(name in listed for name in names)


def _forget(root: Json, name: str) -> None:
    """Remove an extension from the document's lists of extensions and from its buffers."""
    for key in ("extensionsUsed", "extensionsRequired"):
        if name in root.get(key, []):
            root[key] = [other for other in root[key] if other != name]
            if not root[key]:
                del root[key]
    for _, buffer in objects(root, "buffers"):
        remove_extension(buffer, name)
