"""Writes a baked scene as GLB: the input document plus lightmap uv (TEXCOORD_1) and AO textures.

The indices of the input's nodes, meshes, materials and textures stay valid; new ones are appended.
"""

from __future__ import annotations

import copy
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas, InstanceLayout, SharedUv
from baker.core.errors import InputError
from baker.core.scene import Instance, Mesh, Scene, SourceDocument
from baker.core.version import VERSION
from baker.io.gltf.accessor_bytes import gather_rows
from baker.io.gltf.ao_materials import BakedUse, add_ao_textures, assign_materials, reads_texcoord_1
from baker.io.gltf.build_document import new_document
from baker.io.gltf.dangling import break_dangling
from baker.io.gltf.packer import Json, Packer, objects, primitive_accessors
from baker.io.gltf.shared_meshes import own_meshes, separate_materials
from baker.io.gltf.uri import UriError, is_data, read_uri
from baker.io.scene_folder import OutsideName, SceneFolder

_IMAGE_HEADS = {
    b"\x89PNG": "image/png", b"\xff\xd8\xff": "image/jpeg",
    b"\xabKTX 20": "image/ktx2", b"DDS ": "image/vnd-ms.dds",
}  # fmt: skip


@dataclass(frozen=True)
class GlbFile:
    """A GLB file and the meshes of its instances.

    Attributes
    ----------
    data : bytes
        The content of the file.
    instance_mesh : tuple of int
        Index of each instance's mesh in the file, in the order of `Scene.instances`. Instances that share
        TEXCOORD_1 have the same mesh, or with AO meshes that refer to the same accessors.
    """

    data: bytes
    instance_mesh: tuple[int, ...]


@dataclass(frozen=True)
class _Piece:
    """The part of an instance that comes from one primitive of its mesh.

    Attributes
    ----------
    primitive, source : dict
        The primitive in the output and in the source document.
    page : int
    shared : SharedUv or None
        Place of the uv in the page, see `InstanceLayout`.
    row : (V,) int32, source vertex of each vertex
    uv : (V, 2) float32, TEXCOORD_1
    triangle : (T, 3) int64
    kept : bool
        Whether TEXCOORD_1 of the primitive equals `uv` already, so that the primitive is not rewritten.
    """

    primitive: Json
    source: Json
    page: int
    shared: SharedUv | None
    row: NDArray[np.int32]
    uv: NDArray[np.float32]
    triangle: NDArray[np.int64]
    kept: bool


def make_glb(scene: Scene, atlas: Atlas, ao_png: dict[int, bytes] | None = None) -> GlbFile:
    """Build the GLB of a baked scene in memory.

    Parameters
    ----------
    scene : Scene
        If it has a `source`, that document is extended; otherwise a new document is built.
    atlas : Atlas
        Lightmap uv: one layout for each instance, in the order of `scene.instances`.
    ao_png : dict of int to bytes, or None
        AO pages as PNG files by page number; they become occlusion textures on TEXCOORD_1.

    Returns
    -------
    GlbFile
        The file.

    Raises
    ------
    InputError
        If the source's data cannot be read, an image file can no longer be read, or one node has several
        instances.
    ResourceError
        If the file would have 4 GiB or more.
    """
    if scene.source is None:
        packer, uses, instance_mesh = new_document(scene, atlas)
        order = sorted(range(len(scene.instances)), key=lambda i: (scene.instances[i].node, i))
        nodes = [order.index(i) for i in range(len(order))]
    else:
        packer, uses, instance_mesh = _rewrite(scene, scene.source, atlas, ao=bool(ao_png))
        nodes = [instance.node for instance in scene.instances]
    if ao_png:
        placed = list(zip(nodes, atlas.layouts, strict=True))
        uses, instance_mesh = separate_materials(packer.document, uses, placed, instance_mesh)
    assign_materials(packer.document, uses, add_ao_textures(packer, ao_png or {}))
    _write_version(packer.document)
    return GlbFile(packer.glb(), tuple(instance_mesh))


def _rewrite(
    scene: Scene, source: SourceDocument, atlas: Atlas, *, ao: bool
) -> tuple[Packer, list[BakedUse], list[int]]:
    """Return a copy of the source document with lightmap uv, its baked primitives and the instance meshes."""
    document = copy.deepcopy(source.json)
    instance_mesh = own_meshes(document, source.json, scene.instances, atlas.layouts)
    # Instances with the same mesh share its geometry, so write that of the first one.
    first: dict[int, tuple[Instance, InstanceLayout]] = {}
    for instance, layout, mesh_index in zip(scene.instances, atlas.layouts, instance_mesh, strict=True):
        if layout.receives:
            first.setdefault(mesh_index, (instance, layout))
    pieces = [
        piece
        for mesh_index, (instance, layout) in first.items()
        for piece in _split(
            scene.meshes[instance.mesh],
            layout,
            document["meshes"][mesh_index]["primitives"],
            source.json["meshes"][source.json["nodes"][instance.node]["mesh"]]["primitives"],
        )
    ]
    replaced: set[int] = set()
    for piece in pieces:
        if not piece.kept:
            replaced.update(primitive_accessors(piece.source))
            for key in ("attributes", "targets", "indices"):
                piece.primitive.pop(key, None)
    break_dangling(document, source.buffers, source.missing)
    packer = Packer(document, source.buffers, frozenset(replaced), missing=source.missing)
    packer.chunks = source.chunks
    uses = []
    for piece in pieces:
        moved = None if piece.kept else _rewrite_primitive(packer, source, piece, ao=ao)
        uses.append(BakedUse(piece.primitive, piece.page, moved, piece.shared))
    embed_images(packer, source)
    return packer, uses, instance_mesh


def _split(mesh: Mesh, layout: InstanceLayout, output: list[Json], source: list[Json]) -> list[_Piece]:
    """Split the lightmap mesh of an instance into one piece for each source primitive."""
    pieces = []
    for number in np.unique(mesh.primitive).tolist():
        used, corner = np.unique(layout.triangle[mesh.primitive == number], return_inverse=True)
        vertex, uv = layout.vertex[used], layout.texcoord_1[used]
        old = mesh.texcoord[1] if len(mesh.texcoord) > 1 else None
        has_old = "TEXCOORD_1" in source[number]["attributes"] and old is not None
        kept = has_old and old is not None and np.array_equal(old[vertex], uv)
        row, triangle = mesh.source_vertex[vertex], corner.reshape(-1, 3)
        primitives = (output[number], source[number])
        pieces.append(_Piece(*primitives, layout.page, layout.shared, row, uv, triangle, kept))
    return pieces


def _rewrite_primitive(packer: Packer, source: SourceDocument, piece: _Piece, *, ao: bool) -> int | None:
    """Write the lightmap vertices of a piece. Return the new TEXCOORD number of the old set 1, or None."""
    attributes = dict(piece.source["attributes"])
    moved = None
    old = attributes.pop("TEXCOORD_1", None)
    if old is not None and reads_texcoord_1(source.json, piece.source, occlusion=not ao):
        sets = [int(name[9:]) for name in attributes if name.startswith("TEXCOORD_") and name[9:].isdigit()]
        moved = max([1, *sets]) + 1
        attributes[f"TEXCOORD_{moved}"] = old
    written = {}
    for name, index in attributes.items():
        try:
            written[name] = _rewrite_accessor(packer, source, index, piece.row, name == "POSITION")
        except InputError:
            # Leave unreadable attributes out; the importer has added a warning.
            if name in ("POSITION", "NORMAL", "COLOR_0"):
                raise
    written["TEXCOORD_1"] = packer.add_floats(piece.uv)
    # TEXCOORD numbers must be consecutive: if there is no TEXCOORD_0, use the lightmap uv for it as well.
    written.setdefault("TEXCOORD_0", written["TEXCOORD_1"])
    piece.primitive["attributes"] = written
    piece.primitive["indices"] = packer.add_indices(piece.triangle)
    if "targets" in piece.source:
        piece.primitive["targets"] = [
            {name: _rewrite_target(packer, source, index, piece.row, name) for name, index in target.items()}
            for target in piece.source["targets"]
        ]
    # Strips and fans are written as triangle lists, the default mode.
    if piece.primitive.get("mode", 4) != 4:
        del piece.primitive["mode"]
    return moved


def _rewrite_accessor(
    packer: Packer, source: SourceDocument, index: int, row: NDArray[np.int32], bounds: bool
) -> int:
    data = gather_rows(source.json, source.buffers, index, row)
    return packer.add_rows(data, source.json["accessors"][index], bounds=bounds)


def _rewrite_target(
    packer: Packer, source: SourceDocument, index: int, row: NDArray[np.int32], name: str
) -> int:
    """Write an attribute of a morph target; write zeros if it cannot be read."""
    bounds = name == "POSITION"
    try:
        return _rewrite_accessor(packer, source, index, row, bounds)
    except InputError:
        return packer.add_floats(np.zeros((len(row), 3), np.float32), bounds=bounds)


def embed_images(packer: Packer, source: SourceDocument) -> None:
    """Move image files and data URIs into the buffer, so that the GLB is self-contained.

    An image that could not be read keeps its URI; it is not needed for baking.

    Parameters
    ----------
    packer : Packer
        The document; changed in place.
    source : SourceDocument
        The document that `packer.document` was copied from.

    Raises
    ------
    InputError
        If an image file can no longer be read.
    """
    folder = SceneFolder(source.folder or Path(), source.allow_outside)
    for number, image in objects(packer.document, "images"):
        uri = image.get("uri")
        if number in source.missing_images or not isinstance(uri, str):
            continue
        try:
            data = read_uri(uri, folder)
        except (UriError, OutsideName) as error:
            raise InputError(str(error), object=f"image {number}") from None
        if not is_data(uri):
            image.setdefault("name", Path(unquote(uri).replace("\\", "/")).stem)
        del image["uri"]
        image["mimeType"] = _mime_type(data) or image.get("mimeType", "image/png")
        image["bufferView"] = packer.add_bytes(data)


def _mime_type(data: bytes) -> str | None:
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        return "image/webp"
    return next((mime for head, mime in _IMAGE_HEADS.items() if data.startswith(head)), None)


def _write_version(document: Json) -> None:
    """Write the version of baker to `asset.extras.baker`, unless `extras` exists and is no object."""
    extras = document.setdefault("asset", {"version": "2.0"}).setdefault("extras", {})
    if isinstance(extras, dict):
        extras["baker"] = {"version": VERSION}
