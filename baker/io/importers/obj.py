"""Imports Wavefront OBJ scenes with their MTL libraries, with the parser of tinyobjloader.

Each object or group becomes a mesh with one instance. The mesh has one primitive for each material. In OBJ,
v = 0 is the last image row. In glTF and in `Scene` it is the first, so the importer replaces v by 1 - v.
"""

from __future__ import annotations

import codecs
import hashlib
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import linear_from_srgb
from baker.core.errors import IndexRangeError, InputError
from baker.core.scene import Material, Scene, SceneWarning
from baker.core.source_mesh import SourcePrimitive
from baker.io.images import decode_image
from baker.io.load import IMPORTERS, SceneFile
from baker.io.mesh.mtl import read_mtl
from baker.io.mesh.scene import scene_of_meshes, to_world
from baker.io.scene_folder import OutsideError, OutsideName, SceneFolder

# Material of faces without a known material. Its albedo is 0.8 and not 1, the default of glTF, because a
# white surface absorbs no light.
GREY = Material(name="default", base_colour=(0.8, 0.8, 0.8, 1.0), metallic=0.0)
_VERTEX = re.compile(rb"^[ \t]*v[ \t]([^\r\n#]*)", re.MULTILINE)
_NOT_NUMBERS = re.compile(rb"^[ \t]*v[ \t][^\r\n#]*[^0-9eE+\-. \t\r\n#]", re.MULTILINE)


@IMPORTERS.register(".obj")
def import_obj(source: SceneFile) -> Scene:
    """Read an OBJ file and the MTL files and images that it refers to.

    Parameters
    ----------
    source : SceneFile
        The file; `up` and `scale` are used to convert positions to metres, +Y up.

    Raises
    ------
    InputError
        If the file cannot be parsed, an index is out of range, or no triangle is left. If an image of a used
        material is missing and `missing_textures` is "error".
    """
    file = str(source.path)
    digest = hashlib.sha256(source.data)
    warnings: list[SceneWarning] = []
    text = without_groups(_decode(source.data), source.options.split)
    colour = source.options.missing_textures
    missing = None if colour == "error" else (colour, warnings)
    materials = _read_libraries(text, source.path, source.folder, digest, warnings, missing=missing)
    reader = _parse(text, materials, file)
    attributes = reader.GetAttrib()
    position = np.array(attributes.vertices, np.float64).reshape(-1, 3)
    position = _restore_nan(text.encode(), position)
    corners = _Corners(
        position=to_world(position, source.up, source.scale),
        normal=to_world(np.array(attributes.normals, np.float64).reshape(-1, 3), source.up, 1.0),
        texcoord=np.array(attributes.texcoords, np.float64).reshape(-1, 2),
        colour=_colours(attributes, len(position)),
    )
    groups: list[tuple[str, list[SourcePrimitive]]] = []
    for number, shape in enumerate(reader.GetShapes()):
        name = shape.name or f"shape_{number}"
        groups.append((name, _primitives(shape.mesh, corners, len(materials))))
    if any(p.material == len(materials) for _, primitives in groups for p in primitives):
        if materials:
            message = f"faces without a known material are grey; MTL names {len(materials)}"
            warnings.append(SceneWarning("no-material", message, source.path.name))
        materials.append(GREY)
    used = {p.material for _, primitives in groups for p in primitives}
    warnings += [_vanished(m.name) for k, m in enumerate(materials) if k in used and m.base_colour[3] == 0.0]
    return scene_of_meshes(source, groups, materials, warnings, digest.hexdigest())


def _vanished(name: str) -> SceneWarning:
    message = (
        f"the opacity of the material '{name}' is 0 (d 0 or Tr 1): it is invisible and blocks no light; "
        "write d 1 if it is opaque"
    )
    return SceneWarning("invisible-material", message, name)


def obj_sha256(path: Path, data: bytes, folder: SceneFolder) -> str:
    """Compute the hash that `import_obj` stores in the scene, without parsing geometry or decoding images.

    Parameters
    ----------
    path : Path
        The OBJ file.
    data : bytes
        The content of the file.
    folder : SceneFolder
        Folder that the file names in the OBJ file are relative to.

    Returns
    -------
    str
        SHA-256, hexadecimal.

    Raises
    ------
    InputError
        If a material library is malformed.
    """
    digest = hashlib.sha256(data)
    nothing = np.zeros((1, 1, 4), np.uint8)
    missing: tuple[str, list[SceneWarning]] = ("white", [])
    _read_libraries(
        _decode(data), path, folder, digest, [], missing=missing, decode=lambda content, **where: nothing
    )
    return digest.hexdigest()


def _decode(data: bytes) -> str:
    """Return the text of an OBJ or MTL file, with lines joined that end with a backslash."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        text = data.decode("utf-16", "replace")
    else:
        try:
            text = data.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
    return re.sub(r"\\[ \t]*\r?\n", " ", text) if "\\" in text else text


def without_groups(text: str, split: str) -> str:
    """Return an OBJ file without the statements that begin another mesh.

    Parameters
    ----------
    text : str
        The file.
    split : str
        "groups" keeps objects and groups, "objects" removes groups, and "none" removes both.

    Returns
    -------
    str
        The file, with the same number of lines.
    """
    if split == "groups":
        return text
    letters = "g" if split == "objects" else "go"
    return re.sub(rf"^[ \t]*[{letters}](?=[ \t\r\n]|$)[^\r\n]*", "", text, flags=re.MULTILINE)


def _read_libraries(
    text: str,
    path: Path,
    folder: SceneFolder,
    digest: hashlib._Hash,
    warnings: list[SceneWarning],
    *,
    missing: tuple[str, list[SceneWarning]] | None,
    decode: Callable[..., NDArray[np.uint8]] = decode_image,
) -> list[Material]:
    """Return the materials of all MTL files; add the bytes of the MTL files and images to `digest`."""

    def read_file(name: str, base: Path) -> bytes:
        data = folder.read(name, base=base)
        digest.update(data)
        return data

    materials: list[Material] = []
    # The parser reads one word after usemtl as the name, but some exporters write names with blanks.
    named = re.findall(r"^[ \t]*usemtl[ \t]+([^\r\n]*?)[ \t]*$", text, re.MULTILINE)
    used = {*named, *(name.split()[0] for name in named if name)}
    lines = re.findall(r"^[ \t]*mtllib[ \t]+([^\r\n]*?)[ \t]*$", text, re.MULTILINE)
    for line in dict.fromkeys(lines):
        # The text after mtllib is either one name with blanks, or several names.
        names = [line] if (path.parent / line).is_file() else line.split()
        for name in names:
            file = path.parent / name.replace("\\", "/")
            try:
                content = _decode(read_file(name.replace("\\", "/"), path.parent))
            except OutsideName as error:
                message = f"the material library '{name}' {error}"
                raise OutsideError(message, file=str(path), object="mtllib") from None
            except (OSError, ValueError):
                message = f"the material library '{name}' is missing or unreadable; its surfaces are grey"
                warnings.append(SceneWarning("missing-mtl", message, path.name))
                continue
            materials += read_mtl(
                content,
                file=str(file),
                folder=file.parent,
                read_file=read_file,
                used=used,
                missing=missing,
                decode=decode,
            )
    return materials


def _parse(text: str, materials: list[Material], file: str) -> Any:
    """Return the tinyobjloader reader after parsing: faces are triangulated, and all indices are in range."""
    # Check the indices before triangulation, because the parser's ear clipping crashes on invalid indices.
    reader = _run_parser(text, materials, file, triangulate=False)
    attributes = reader.GetAttrib()
    counts = tuple(
        len(v) // k for v, k in ((attributes.vertices, 3), (attributes.normals, 3), (attributes.texcoords, 2))
    )
    polygons = False
    for number, shape in enumerate(reader.GetShapes()):
        _check_indices(shape.mesh, counts, file, shape.name or f"shape_{number}")
        corners = np.array(shape.mesh.num_face_vertices, np.int64)
        polygons |= bool((corners != 3).any())
    return _run_parser(text, materials, file, triangulate=True) if polygons else reader


def _run_parser(text: str, materials: list[Material], file: str, *, triangulate: bool) -> Any:
    import tinyobjloader

    config = tinyobjloader.ObjReaderConfig()
    config.triangulate = triangulate
    reader = tinyobjloader.ObjReader()
    # Pass only the material names. `read_mtl` reads the values, because the Python binding lacks `Ke`.
    names = "".join(f"newmtl {material.name}\n" for material in materials)
    if not reader.ParseFromString(text, names, config):
        why = " ".join(reader.Error().split()).rstrip(".") or "it is not an OBJ file"
        raise InputError(f"the file cannot be parsed: {why[:200]}", file=file)
    return reader


def _check_indices(mesh: Any, counts: tuple[int, ...], file: str, shape: str) -> None:
    """Raise if an index is out of range."""
    # Use lists, because the binding's numpy_* calls return arrays of stride 0 (tinyobjloader 2.0.0rc13).
    kinds = (
        (mesh.vertex_indices(), "vertex"),
        (mesh.normal_indices(), "normal"),
        (mesh.texcoord_indices(), "texture vertex"),
    )
    for (index, what), count in zip(kinds, counts, strict=True):
        if index and max(index) >= count:
            message = f"a face names {what} {max(index) + 1}, but the file has {count}"
            raise IndexRangeError(message, file=file, object=shape)
    if kinds[0][0] and min(kinds[0][0]) < 0:
        raise IndexRangeError("a face has an index of zero or less", file=file, object=shape)


def _restore_nan(data: bytes, position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Set a position to NaN if one of its three words is no finite number; the parser reads 0 there."""
    if _NOT_NUMBERS.search(data) is None:
        return position
    position = position.copy()
    for row, match in enumerate(_VERTEX.finditer(data)):
        if row < len(position) and not all(_is_number(word) for word in match.group(1).split()[:3]):
            position[row] = np.nan
    return position


def _is_number(word: bytes) -> bool:
    try:
        return math.isfinite(float(word))
    except ValueError:
        return False


def _colours(attributes: Any, count: int) -> NDArray[np.float32] | None:
    """Return vertex colours (V, 4), or None if all are white, as for a file without vertex colours."""
    colour = np.array(attributes.colors, np.float32).reshape(-1, 3)
    if len(colour) != count or (colour == 1).all():
        return None
    return np.concatenate([linear_from_srgb(colour), np.ones((count, 1), np.float32)], axis=1)


class _Corners:
    """The vertex arrays of an OBJ file, to which the indices of the face corners refer."""

    def __init__(
        self,
        *,
        position: NDArray[np.float32],
        normal: NDArray[np.float32],
        texcoord: NDArray[np.float64],
        colour: NDArray[np.float32] | None,
    ) -> None:
        self.position = position
        self.normal = normal
        self.texcoord = (texcoord * (1.0, -1.0) + (0.0, 1.0)).astype(np.float32)
        self.colour = colour


def _primitives(mesh: Any, corners: _Corners, default: int) -> list[SourcePrimitive]:
    """Split a shape by material; faces without a known material get the material index `default`."""
    vertex, normal, texcoord = (
        np.array(values, np.int64)
        for values in (mesh.vertex_indices(), mesh.normal_indices(), mesh.texcoord_indices())
    )
    n = len(vertex) // 3
    material = np.array(mesh.material_ids, np.int64)[:n]
    material = np.where((material < 0) | (material >= default), default, material)
    if n and (material == material[0]).all():
        own = vertex[: 3 * n], normal[: 3 * n], texcoord[: 3 * n]
        return [_primitive(0, int(material[0]), *own, corners)]
    primitives = []
    for number, used in enumerate(np.unique(material)):
        mine = np.repeat(material == used, 3)
        primitives.append(
            _primitive(
                number,
                int(used),
                vertex[: 3 * n][mine],
                normal[: 3 * n][mine],
                texcoord[: 3 * n][mine],
                corners,
            )
        )
    return primitives


def _primitive(
    number: int,
    material: int,
    vertex: NDArray[np.int64],
    normal: NDArray[np.int64],
    texcoord: NDArray[np.int64],
    corners: _Corners,
) -> SourcePrimitive:
    """Return a primitive from the (3 T,) position, normal and texcoord indices of its corners."""
    # Create one vertex for each distinct index triple. Two steps keep the keys within 64 bits.
    first = vertex
    if (texcoord >= 0).any():
        _, first = np.unique(vertex * (len(corners.texcoord) + 1) + texcoord + 1, return_inverse=True)
    if (normal >= 0).any():
        first = first * (len(corners.normal) + 1) + normal + 1
    _, row, index = np.unique(first, return_index=True, return_inverse=True)
    v, n, t = vertex[row], normal[row], texcoord[row]
    given = None
    if (n >= 0).any():
        given = np.full((len(n), 3), np.nan, np.float32)
        given[n >= 0] = corners.normal[n[n >= 0]]
    uv = {}
    if (t >= 0).any():
        uv[0] = np.zeros((len(t), 2), np.float32)
        uv[0][t >= 0] = corners.texcoord[t[t >= 0]]
    return SourcePrimitive(
        index=number,
        material=material,
        position=corners.position[v],
        triangle=index.reshape(-1, 3),
        normal=given,
        texcoord=uv,
        colour=None if corners.colour is None else corners.colour[v],
    )
