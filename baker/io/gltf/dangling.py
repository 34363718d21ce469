"""Keeps invalid references of a glTF document invalid when `Packer` adds data to it.

`Packer` merges all buffers and appends to lists. A view that extends past the end of its buffer would then
become valid, and so would an index past the end of a list. Such references would yield unrelated data.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

from baker.io.gltf.accessor_bytes import element_size
from baker.io.gltf.packer import Json, extensions_of, is_index, objects, view_span

# An index that no list reaches.
NOWHERE = 2**31 - 1


def break_dangling(document: Json, buffers: tuple[bytes, ...], missing: frozenset[int]) -> None:
    """Replace invalid references to accessors, views and buffers by `NOWHERE`.

    A reference is invalid if the list has no such object. A view's reference to its buffer is also invalid if
    the view extends past the end of the buffer, and an accessor's reference to its view if the accessor
    extends past the end of the view. In extensions, only two members are replaced: `bufferView` in any
    extension, and `buffer` in the extensions of a view.

    Parameters
    ----------
    document : dict
        glTF JSON; changed in place.
    buffers : tuple of bytes
        The buffers of the document.
    missing : frozenset of int
        Indices of buffers that cannot be read. Views of these buffers are not changed.
    """
    views = dict(objects(document, "bufferViews"))
    for view in views.values():
        for holder in (view, *extensions_of(view)):
            if isinstance(holder, dict) and "buffer" in holder:
                _check_buffer(holder, buffers, missing)
    for holder in holders_with(document, "bufferView"):
        _check_index(holder, "bufferView", views)
    accessors = dict(objects(document, "accessors"))
    for accessor in accessors.values():
        for holder, exceeds in _parts(accessor, views):
            if exceeds:
                holder["bufferView"] = NOWHERE
    for holder, keys in _with_accessors(document):
        for key in keys:
            _check_index(holder, key, accessors)


def _check_buffer(view: Json, buffers: tuple[bytes, ...], missing: frozenset[int]) -> None:
    number = view["buffer"]
    known = is_index(number) and number < len(buffers)
    if not known or (number not in missing and view_span(view, len(buffers[number])) is None):
        view["buffer"] = NOWHERE


def _check_index(holder: Json, key: str, known: dict[int, Json]) -> None:
    if is_index(holder.get(key)) and holder[key] not in known:
        holder[key] = NOWHERE


def holders_with(node: Any, key: str) -> Iterator[Json]:
    """Yield all objects with a key, except in extras.

    Parameters
    ----------
    node : Any
        A JSON value.
    key : str
        The key.

    Yields
    ------
    dict
        Objects inside `node`, which may be `node` itself.
    """
    if isinstance(node, dict):
        if key in node:
            yield node
        node = [value for name, value in node.items() if name != "extras"]
    for value in node if isinstance(node, list) else ():
        yield from holders_with(value, key)


def _parts(accessor: Json, views: dict[int, Json]) -> Iterator[tuple[Json, bool]]:
    """Yield each object of an accessor that refers to a view, and whether its elements exceed the view."""
    sparse = accessor.get("sparse")
    sparse = sparse if isinstance(sparse, dict) else {}
    rows = ((accessor, accessor), (sparse, sparse.get("indices")), (sparse, sparse.get("values")))
    for counted, holder in rows:
        if not isinstance(holder, dict) or not is_index(holder.get("bufferView")):
            continue
        view = views.get(holder["bufferView"], {})
        # Sparse indices have a `componentType`; sparse values have the type of the accessor.
        typed = holder if "componentType" in holder else accessor
        try:
            size = element_size({"type": "SCALAR", **typed})
            span = view.get("byteStride", size) * (counted["count"] - 1) + size
            yield holder, holder.get("byteOffset", 0) + span > view["byteLength"]
        except (KeyError, TypeError):
            yield holder, True


def _with_accessors(document: Json) -> Iterator[tuple[Json, Iterable[str]]]:
    """Yield the objects that refer to accessors, with the keys of these references."""
    for _, mesh in objects(document, "meshes"):
        for _, primitive in objects(mesh, "primitives"):
            yield primitive, ("indices",)
            targets = primitive.get("targets")
            for holder in (primitive.get("attributes"), *(targets if isinstance(targets, list) else ())):
                if isinstance(holder, dict):
                    yield holder, holder.keys()
    for _, skin in objects(document, "skins"):
        yield skin, ("inverseBindMatrices",)
    for _, animation in objects(document, "animations"):
        for _, sampler in objects(animation, "samplers"):
            yield sampler, ("input", "output")
