"""Decodes buffer views that are compressed with EXT_meshopt_compression or KHR_meshopt_compression.

A view whose uncompressed data is in the file as well (a fallback buffer) is not decoded.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.io.gltf.decoded import DecodedData, is_listed, remove_extension
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject
from baker.io.gltf.packer import view_span

if TYPE_CHECKING:
    from baker.io.meshopt.stream import Layout

MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")


def decode_views(document: GltfDocument) -> GltfDocument:
    """Decode all compressed views.

    Parameters
    ----------
    document : GltfDocument
        Its JSON is changed in place.

    Returns
    -------
    GltfDocument
        The document with plain views. Views that cannot be decoded keep their extension, and their errors are
        in `data_faults`.
    """
    decoded = DecodedData(document)
    found = False
    for view in document.root.children("bufferViews"):
        try:
            names = [name for name in MESHOPT if view.extension(name) is not None]
        except InputError as error:
            decoded.faults[view.where] = error
            continue
        for name in names:
            found = True
            try:
                _replace(document, view, name, decoded)
            except InputError as error:
                decoded.faults[view.where] = error
    found = found or bool(decoded.faults) or is_listed(document.root.value, MESHOPT)
    return decoded.finish(MESHOPT) if found else document


def _has_fallback(document: GltfDocument, view: JsonObject) -> bool:
    """Return whether the uncompressed data of a view is in the file."""
    number = view.value.get("buffer")
    if not isinstance(number, int) or not 0 <= number < len(document.buffers):
        return False
    return number not in document.buffer_faults and (
        view_span(view.value, len(document.buffers[number])) is not None
    )


def _replace(document: GltfDocument, view: JsonObject, name: str, decoded: DecodedData) -> None:
    """Remove the extension of a view, and decode its data into `decoded` unless there is a fallback."""
    extension = view.extension(name)
    assert extension is not None
    fallback = _has_fallback(document, view)
    try:
        number, offset, length = document.span(extension)
        source = np.frombuffer(document.buffers[number], np.uint8, length, offset)
        if not fallback:
            decoded.append(view.value, _decode(view, extension, source, decoded))
        decoded.drop(number, offset, length)
    except InputError:
        if not fallback:
            raise
    remove_extension(view.value, name)


def _decode(
    view: JsonObject, extension: JsonObject, source: NDArray[np.uint8], decoded: DecodedData
) -> NDArray[np.uint8]:
    """Return the elements of a view as (N,) uint8."""
    # Import here, because Numba takes longer to import than most files take to load.
    from baker.io.meshopt.stream import Layout, StreamError, decode_stream

    layout = Layout(
        extension.string("mode"),
        extension.string("filter", "NONE"),
        extension.integer("count", minimum=1),
        extension.integer("byteStride", minimum=1),
    )
    _check_size(view, extension, layout, decoded)
    try:
        return decode_stream(source, layout)
    except StreamError as error:
        extension.fail(f"{error}; export the file again")


def _check_size(view: JsonObject, extension: JsonObject, layout: Layout, decoded: DecodedData) -> None:
    """Raise if the decoded size differs from that of the view, or exceeds the size of a file."""
    size, expected = layout.elements * layout.stride, view.integer("byteLength", minimum=1)
    if size != expected:
        extension.fail(
            f"{layout.elements} elements of {layout.stride} bytes are not the {expected} bytes of the view; "
            "export the file again"
        )
    if not decoded.has_room(size):
        extension.fail(f"decoding its {size} bytes would exceed the largest size of a scene, 4 GiB")
