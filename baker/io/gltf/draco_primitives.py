"""Decodes primitives that are compressed with KHR_draco_mesh_compression.

A primitive is not decoded if the file also contains all its attributes and indices in uncompressed form.

Based on: Khronos Group, KHR_draco_mesh_compression.
"""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.io.draco.decoder import DracoDecoder, DracoError, DracoMesh
from baker.io.gltf.dangling import holders_with
from baker.io.gltf.decoded import DecodedData, is_listed, remove_extension
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject
from baker.io.gltf.packer import ARRAY_BUFFER, COMPONENT, ELEMENT_ARRAY_BUFFER, Json, is_index

DRACO = "KHR_draco_mesh_compression"
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}
_TRIANGLES, _STRIP = 4, 5
# Id of the faces of a stream, where other arrays have the id of an attribute.
_FACES = -1
_INDEX_TYPE = {1: 5121, 2: 5123, 4: 5125}


def decode_primitives(document: GltfDocument) -> GltfDocument:
    """Decode all compressed primitives.

    Parameters
    ----------
    document : GltfDocument
        Its JSON is changed in place.

    Returns
    -------
    GltfDocument
        The document with plain primitives. Primitives that cannot be decoded keep their extension, and their
        errors are in `data_faults`.
    """
    found = [primitive for mesh in document.root.children("meshes") for primitive in _compressed(mesh)]
    if not found and not is_listed(document.root.value, (DRACO,)):
        return document
    decoded = DecodedData(document)
    # Find uncompressed copies first. After a primitive is decoded, its data would look like an uncompressed
    # copy for other primitives with the same accessors.
    uncompressed = {primitive.where for primitive in found if _has_plain_copy(document, primitive)}
    with DracoDecoder() as decoder:
        reader = _Reader(document, decoded, decoder)
        for primitive in found:
            try:
                if primitive.where not in uncompressed:
                    reader.read(primitive)
                remove_extension(primitive.value, DRACO)
            except InputError as error:
                decoded.faults[primitive.where] = error
    reader.drop_streams()
    return decoded.finish((DRACO,))


def _compressed(mesh: JsonObject) -> list[JsonObject]:
    """Return the compressed primitives of a mesh; malformed ones raise an error when they are needed."""
    try:
        return [p for p in mesh.children("primitives") if p.extension(DRACO) is not None]
    except InputError:
        return []


def _has_plain_copy(document: GltfDocument, primitive: JsonObject) -> bool:
    """Return whether all attributes and indices of a primitive have uncompressed data."""
    accessors = document.root.children("accessors")
    try:
        attributes = primitive.child("attributes")
        used = [attributes.index(key, len(accessors), "accessors") for key in attributes.value]
        if "indices" in primitive:
            used.append(primitive.index("indices", len(accessors), "accessors"))
        return all("bufferView" in accessors[k] or "sparse" in accessors[k] for k in used)
    except InputError:
        return False


class _Reader:
    """Decodes the streams of a document, and lets accessors refer to the decoded data."""

    def __init__(self, document: GltfDocument, decoded: DecodedData, decoder: DracoDecoder) -> None:
        self._document = document
        self._decoded = decoded
        self._decoder = decoder
        self._meshes: dict[int, DracoMesh] = {}
        # For each accessor with decoded data: the view of its stream, and the id of its attribute.
        self._filled: dict[int, tuple[int, int]] = {}
        # The accessors of the views that were appended to the document, in the order of the views.
        self._added: list[Json] = []

    def read(self, primitive: JsonObject) -> None:
        """Decode a primitive; its JSON is changed only if all of its data can be decoded."""
        extension = primitive.extension(DRACO)
        assert extension is not None
        root = self._document.root
        mode = primitive.integer("mode", _TRIANGLES)
        if mode not in (_TRIANGLES, _STRIP):
            primitive.fail(f"{DRACO} stores triangles, but the mode is {mode}", "mode")
        stream = extension.index("bufferView", len(root.children("bufferViews")), "bufferViews")
        attributes, ids = primitive.child("attributes"), extension.child("attributes")
        mesh = self._mesh(extension, stream, primitive)
        arrays: list[tuple[str, int, NDArray[Any]]] = []
        for name in ids.value:
            if name in attributes:
                number = ids.integer(name)
                if number not in mesh.attributes:
                    ids.fail(f"the compressed data has no attribute {number}", name)
                arrays.append((name, number, _converted(self._accessor(attributes, name), mesh, number)))
        if "indices" in primitive:
            kind = self._accessor(primitive, "indices").integer("componentType")
        else:
            root.value["accessors"].append({"componentType": 5125, "type": "SCALAR", "count": 1})
            kind, primitive.value["indices"] = 5125, len(root.value["accessors"]) - 1
        for name, number, array in arrays:
            self._fill(attributes.value, name, (stream, number), array)
        self._fill(primitive.value, "indices", (stream, _FACES), _narrowed(mesh.faces, kind))
        # Decoded faces are separate triangles, also if the primitive was a strip.
        primitive.value.pop("mode", None)

    def _accessor(self, holder: JsonObject, key: str) -> JsonObject:
        accessors = self._document.root.children("accessors")
        return accessors[holder.index(key, len(accessors), "accessors")]

    def _mesh(self, extension: JsonObject, stream: int, primitive: JsonObject) -> DracoMesh:
        """Return the decoded mesh of a view."""
        if stream not in self._meshes:
            data, offset, length, _ = self._document.view(stream)
            size = self._size(primitive)
            if not self._decoded.has_room(size):
                extension.fail(f"decoding its {size} bytes would exceed the largest size of a scene, 4 GiB")
            try:
                self._meshes[stream] = self._decoder.decode(data[offset : offset + length], size)
            except DracoError as error:
                extension.fail(f"{DRACO} cannot be decoded: {error}")
        return self._meshes[stream]

    def _size(self, primitive: JsonObject) -> int:
        """Return an upper bound of the size of the decoded primitive, bytes: 16 for each element."""
        attributes = primitive.child("attributes")
        used = [(attributes, key) for key in attributes.value]
        used += [(primitive, "indices")] if "indices" in primitive else []
        return sum(16 * self._accessor(holder, key).integer("count") for holder, key in used)

    def _fill(self, holder: Json, key: str, source: tuple[int, int], array: NDArray[Any]) -> None:
        """Store an array as the data of the accessor `holder[key]`, or of a copy if that has other data."""
        root = self._document.root.value
        accessors, index = root["accessors"], holder[key]
        if self._filled.get(index) == source:
            return
        if index in self._filled or "bufferView" in accessors[index]:
            accessors.append(copy.deepcopy(accessors[index]))
            index = holder[key] = len(accessors) - 1
        self._filled[index] = source
        rows = np.ascontiguousarray(array).view(np.uint8).reshape(len(array), -1)
        view: Json = {"target": ELEMENT_ARRAY_BUFFER if source[1] == _FACES else ARRAY_BUFFER}
        if source[1] != _FACES and rows.shape[1] % 4:
            rows = np.pad(rows, ((0, 0), (0, -rows.shape[1] % 4)))
            view["byteStride"] = rows.shape[1]
        self._decoded.append(view, rows.reshape(-1))
        root["bufferViews"].append(view)
        accessor = accessors[index]
        accessor["bufferView"], accessor["count"] = len(root["bufferViews"]) - 1, len(array)
        accessor.pop("byteOffset", None)
        if source[1] == _FACES:
            accessor["componentType"] = _INDEX_TYPE[array.dtype.itemsize]
        self._added.append(accessor)
        self._document.root.forget("accessors")

    def drop_streams(self) -> None:
        """Remove the compressed data that nothing refers to any more."""
        root = self._document.root.value
        named = (holder["bufferView"] for holder in holders_with(root, "bufferView"))
        used = set(filter(is_index, named))
        for stream in sorted(self._meshes.keys() - used):
            view = root["bufferViews"][stream]
            self._decoded.drop(view["buffer"], view.get("byteOffset", 0), view["byteLength"])
            # Views keep their indices, so the last one of the new views takes the entry of the stream.
            self._added.pop()["bufferView"] = stream
            root["bufferViews"][stream] = root["bufferViews"].pop()


def _converted(accessor: JsonObject, mesh: DracoMesh, number: int) -> NDArray[Any]:
    """Return an attribute, (V, C), with the component type of its accessor."""
    array, kind = mesh.attributes[number], accessor.string("type")
    if _WIDTH.get(kind) != array.shape[1]:
        accessor.fail(f"'{kind[:20]}' does not have the {array.shape[1]} components of the data", "type")
    code = accessor.integer("componentType")
    if code not in COMPONENT:
        accessor.fail(f"{code} is not a component type", "componentType")
    dtype = COMPONENT[code]
    if dtype.kind != "f":
        limits = np.iinfo(dtype)
        if array.dtype.kind not in "iu" or (
            len(array) and not limits.min <= int(array.min()) <= int(array.max()) <= limits.max
        ):
            accessor.fail(f"the compressed data does not fit the component type {code}", "componentType")
    return array.astype(dtype, copy=False)


def _narrowed(faces: NDArray[np.uint32], code: int) -> NDArray[Any]:
    """Return indices, (3 T, 1), with the component type `code` if it is large enough, else as uint32."""
    # The largest number of a type means primitive restart.
    most = {5121: 254, 5123: 65534}.get(code, -1)
    dtype = COMPONENT[code] if int(faces.max(initial=0)) <= most else COMPONENT[5125]
    return faces.reshape(-1, 1).astype(dtype)
