"""Reads the primitives of a glTF mesh: triangles, strips and fans, with or without indices.

Positions are in object space, and triangles have the winding of the file. A node whose matrix has a negative
determinant reverses the winding in world space (glTF 2.0, section 3.7.4); `baker.core.geometry` does that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.scene import SceneWarning
from baker.core.source_mesh import SourcePrimitive
from baker.io.gltf.accessor import FLOAT, component_type, read_accessor, read_indices
from baker.io.gltf.accessor_bytes import fault_of, gather_rows
from baker.io.gltf.document import GltfDocument
from baker.io.gltf.json import JsonObject
from baker.io.gltf.material import MaterialReader
from baker.io.gltf.texture import MAX_TEXCOORDS

_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_primitives(
    document: GltfDocument, mesh: JsonObject, name: str, materials: MaterialReader, *, lenient: bool = False
) -> tuple[list[SourcePrimitive], list[SceneWarning]]:
    """Return the triangle primitives of a mesh; points and lines are left out with a warning.

    Parameters
    ----------
    document : GltfDocument
        The document.
    mesh : JsonObject
        The mesh.
    name : str
        Name of the mesh, for warnings.
    materials : MaterialReader
        Reads the materials of the primitives.
    lenient : bool
        Accept indices out of range, and also read the attributes that baking does not use.

    Returns
    -------
    primitives : list of SourcePrimitive
        The triangle primitives, in the file's order.
    warnings : list of SceneWarning
        Warnings about the mesh.

    Raises
    ------
    InputError
        For malformed primitives: a missing POSITION, arrays of different length, an index out of range. For
        compressed data that could not be decoded.
    """
    arrays: list[SourcePrimitive] = []
    warnings: list[SceneWarning] = []
    skipped = 0
    for i, primitive in enumerate(mesh.children("primitives")):
        mode = primitive.integer("mode", _TRIANGLES)
        if mode > _FAN:
            primitive.fail(f"{mode} is not a primitive mode; known are 0 to 6", "mode")
        if mode < _TRIANGLES:
            skipped += 1
            continue
        arrays.append(_primitive(document, primitive, i, mode, materials, lenient))
        if _unmarked_integers(document, primitive.child("attributes")):
            message = (
                f"COLOR_0 of primitive {i} holds integers that are not marked as normalized; they are read "
                "as 0 to 1: export it again with 'normalized', or an engine may show other colours"
            )
            warnings.append(SceneWarning("integer-colours", message, name))
        warnings += _unreadable(document, primitive, arrays[-1], name)
        left = _corner_count(document, primitive, arrays[-1]) % 3
        if mode == _TRIANGLES and left:
            warnings.append(
                SceneWarning("odd-indices", f"primitive {i} ends with {left} spare indices", name)
            )
    if skipped:
        some = "1 primitive" if skipped == 1 else f"{skipped} primitives"
        warnings.append(SceneWarning("not-triangles", f"{some} of points or lines left out", name))
    return arrays, warnings


def _corner_count(document: GltfDocument, primitive: JsonObject, arrays: SourcePrimitive) -> int:
    if "indices" not in primitive:
        return len(arrays.position)
    accessors = document.root.children("accessors")
    return accessors[primitive.integer("indices")].integer("count")


def _primitive(
    document: GltfDocument,
    primitive: JsonObject,
    number: int,
    mode: int,
    materials: MaterialReader,
    lenient: bool,
) -> SourcePrimitive:
    accessors = document.root.children("accessors")
    attributes = primitive.child("attributes")
    if primitive.where in document.data_faults:
        raise document.data_faults[primitive.where]
    if "POSITION" not in attributes:
        primitive.fail("the primitive has no POSITION")
    at = attributes.index("POSITION", len(accessors), "accessors")
    position = read_accessor(document, at, types=("VEC3",))
    if component_type(document, at) != FLOAT and "KHR_mesh_quantization" not in document.root.strings(
        "extensionsUsed"
    ):
        accessors[at].fail("POSITION must hold floats (componentType 5126)", "componentType")

    def optional(key: str, types: tuple[str, ...]) -> NDArray[np.float32] | None:
        if key not in attributes:
            return None
        where = attributes.index(key, len(accessors), "accessors")
        value = read_accessor(document, where, types=types)
        if len(value) != len(position):
            attributes.fail(f"the accessor has {len(value)} rows, POSITION has {len(position)}", key)
        return value

    material = materials.index_of(primitive)
    read = materials.need(material)
    textures = (read.base_colour_texture, read.emission_texture)
    needed = {texture.texcoord for texture in textures if texture is not None}

    def texcoord(k: int) -> NDArray[np.float32] | None:
        try:
            return optional(f"TEXCOORD_{k}", ("VEC2",))
        except InputError:
            if k in needed:
                raise
            return None

    texcoords = {k: texcoord(k) for k in range(MAX_TEXCOORDS)}
    colour = optional("COLOR_0", ("VEC3", "VEC4"))
    if colour is not None:
        colour = _colour(document, attributes, colour)
    return SourcePrimitive(
        index=number,
        material=material,
        position=position,
        triangle=triangles_of(_corners(document, primitive, len(position), lenient), mode),
        normal=optional("NORMAL", ("VEC3",)),
        texcoord={k: value for k, value in texcoords.items() if value is not None},
        colour=colour,
        further=_further(document, attributes, len(position)) if lenient else None,
        stitched=mode == _STRIP,
    )


def _further(document: GltfDocument, attributes: JsonObject, n_vertices: int) -> NDArray[np.uint8] | None:
    """Return the readable attributes that `_primitive` ignores as bytes, (V, B) uint8; None without any."""
    known = {"POSITION", "NORMAL", "COLOR_0", *(f"TEXCOORD_{k}" for k in range(MAX_TEXCOORDS))}
    root = document.root.value
    row = np.arange(n_vertices, dtype=np.int32)
    found = [
        gather_rows(root, document.buffers, attributes.integer(name), row)
        for name in sorted(set(attributes.value) - known)
        if fault_of(root, document.buffers, attributes.value[name], n_vertices) is None
    ]
    return np.concatenate(found, axis=1) if found else None


def _unreadable(
    document: GltfDocument, primitive: JsonObject, arrays: SourcePrimitive, mesh: str
) -> list[SceneWarning]:
    """Return a warning for each vertex attribute that cannot be read and is not needed for baking."""
    root, buffers, n_vertices = document.root.value, document.buffers, len(arrays.position)
    read = {"POSITION", "NORMAL", "COLOR_0", *(f"TEXCOORD_{k}" for k in arrays.texcoord)}
    attributes = primitive.child("attributes").value
    named = [(name, index) for name, index in attributes.items() if name not in read]
    for k, target in enumerate(primitive.children("targets")):
        named += [(f"{name} of morph target {k}", index) for name, index in target.value.items()]
    found = []
    for label, index in named:
        fault = fault_of(root, buffers, index, n_vertices)
        if fault is not None:
            message = (
                f"{label} of primitive {arrays.index} cannot be read ({fault.object}: {fault.message}); "
                "a bake does not need it, and scene.glb goes without"
            )
            found.append(SceneWarning("broken-attribute", message, mesh))
    return found


def _unmarked_integers(document: GltfDocument, attributes: JsonObject) -> bool:
    """Return whether vertex colours are integers that are not marked as normalized."""
    if "COLOR_0" not in attributes:
        return False
    accessor = attributes.integer("COLOR_0")
    unmarked = not document.root.children("accessors")[accessor].boolean("normalized", False)
    return unmarked and component_type(document, accessor) != FLOAT


def _colour(
    document: GltfDocument, attributes: JsonObject, colour: NDArray[np.float32]
) -> NDArray[np.float32]:
    accessor = attributes.integer("COLOR_0")
    if _unmarked_integers(document, attributes):
        # Normalise integer colours: some exporters omit "normalized".
        colour = colour / np.float32(255 if component_type(document, accessor) == 5121 else 65535)
    if colour.shape[1] == 3:
        colour = np.concatenate([colour, np.ones((len(colour), 1), np.float32)], axis=1)
    return colour


def _corners(
    document: GltfDocument, primitive: JsonObject, n_vertices: int, lenient: bool
) -> NDArray[np.int64]:
    if "indices" not in primitive:
        return np.arange(n_vertices, dtype=np.int64)
    accessors = document.root.children("accessors")
    at = primitive.index("indices", len(accessors), "accessors")
    corner = read_indices(document, at)
    largest = int(corner.max())
    if largest >= n_vertices and not lenient:
        primitive.fail(
            f"index {largest} in accessor {at} is out of range: POSITION has {n_vertices} vertices", "indices"
        )
    return corner


def triangles_of(corner: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """Return the triangles of a primitive.

    Parameters
    ----------
    corner : (N,) int64
        Vertex of each corner, in the order of the file.
    mode : int
        4 triangles, 5 strip, 6 fan. In mode 4, one or two corners left over at the end are dropped.

    Returns
    -------
    (T, 3) int64
        Vertices of each triangle.
    """
    n = len(corner)
    if mode == _TRIANGLES:
        return corner[: n - n % 3].reshape(-1, 3)
    i = np.arange(max(0, n - 2))
    if mode == _STRIP:
        # Reverse every second triangle of a strip, so that all triangles have the same winding.
        odd = i % 2
        return np.stack([corner[i], corner[i + 1 + odd], corner[i + 2 - odd]], axis=1)
    return np.stack([corner[i + 1], corner[i + 2], np.full(len(i), corner[0] if n else 0)], axis=1)
