"""Imports PLY, STL and OFF files with the parsers of trimesh.

The mesh class of trimesh is not used, because it would merge, reorder and drop vertices.
"""

from __future__ import annotations

import hashlib
import io
import logging
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import linear_from_srgb
from baker.core.errors import InputError
from baker.core.scene import Material, Scene
from baker.core.source_mesh import SourcePrimitive
from baker.io.load import IMPORTERS, SceneFile
from baker.io.mesh.scene import scene_of_meshes, to_world

# trimesh logs errors with a traceback. Without a handler, Python would print them to stderr.
logging.getLogger("trimesh").addHandler(logging.NullHandler())

# Name of the object. The name of the file is not used, so that a renamed file gives the same bytes.
_NAME = "mesh"
_GREY = Material(name="default", base_colour=(0.8, 0.8, 0.8, 1.0), metallic=0.0)


@IMPORTERS.register(".ply")
@IMPORTERS.register(".stl")
@IMPORTERS.register(".off")
def import_mesh_file(source: SceneFile) -> Scene:
    """Read a PLY, STL or OFF file. The base colour is grey, multiplied by vertex colours if there are any.

    Parameters
    ----------
    source : SceneFile
        The file; `up` and `scale` are used to convert positions to metres, +Y up.

    Raises
    ------
    InputError
        If the file cannot be parsed, an index is out of range, or no triangle is left.
    """
    file, kind = str(source.path), source.path.suffix.lower()[1:]
    try:
        solids = _parse(source.data, kind)
        arrays = [_arrays(solid) for solid in solids]
    except MemoryError:
        raise
    except Exception as error:  # the parsers raise many kinds of exceptions on broken data
        why = f"{type(error).__name__}: {' '.join(str(error).split())}"[:160]
        raise InputError(f"the file cannot be parsed as {kind.upper()} ({why})", file=file) from None
    primitives = []
    for number, (position, face, normal, colour) in enumerate(arrays):
        if not source.lenient and len(face) and not (face.min() >= 0 and face.max() < len(position)):
            worst = face.max() if face.max() >= len(position) else face.min()
            raise InputError(
                f"face index {worst} is out of range: there are {len(position)} vertices", file=file
            )
        primitives.append(
            SourcePrimitive(
                index=number,
                material=0,
                position=to_world(position, source.up, source.scale),
                triangle=face,
                normal=None if normal is None else to_world(normal, source.up, 1.0),
                colour=colour,
            )
        )
    sha256 = hashlib.sha256(source.data).hexdigest()
    return scene_of_meshes(source, [(_NAME, primitives)], [_GREY], [], sha256)


def _parse(data: bytes, kind: str) -> list[dict[str, Any]]:
    from trimesh.exchange.off import load_off
    from trimesh.exchange.ply import load_ply
    from trimesh.exchange.stl import load_stl

    stream = io.BytesIO(data)
    if kind == "ply":
        found = load_ply(stream, fix_texture=False, skip_materials=True)
    elif kind == "stl":
        found = load_stl(stream)
    else:
        found = load_off(stream)
    if found.get("geometry") == {} and b"facet" not in data:
        # The parser treats a truncated binary file as a text file without a solid.
        raise ValueError("it is neither text nor as long as its header says; it may be cut off")
    # For a text STL with several solids, the parser returns a dictionary of solids.
    return list(found["geometry"].values()) if "geometry" in found else [found]


def _arrays(
    solid: dict[str, Any],
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64] | None, NDArray[np.float32] | None]:
    """Return position (V, 3), face (T, 3), normal (V, 3) and colour (V, 4) of a parsed solid."""
    position = np.array(solid["vertices"], np.float64).reshape(-1, 3)
    faces = solid.get("faces")
    face = np.zeros((0, 3), np.int64) if faces is None or not len(faces) else np.array(faces, np.int64)
    if face.shape[1] == 4:
        face = face[:, [0, 1, 2, 0, 2, 3]]
    normal = solid.get("vertex_normals")
    given = None if normal is None else np.array(normal, np.float64).reshape(len(position), 3)
    return position, face.reshape(-1, 3), given, _colour(solid.get("vertex_colors"), len(position))


def _colour(value: Any, count: int) -> NDArray[np.float32] | None:
    """Return vertex colours (V, 4), linear Rec.709 and alpha; None if a vertex has no colour."""
    if value is None or len(value) != count:
        return None
    stored = np.array(value)
    colour: NDArray[np.float32] = stored.astype(np.float32)
    if stored.dtype.kind in "iu":
        colour /= np.float32(np.iinfo(stored.dtype).max)
    rgb = linear_from_srgb(np.clip(colour[:, :3], 0.0, 1.0))
    alpha = colour[:, 3:4] if colour.shape[1] > 3 else np.ones((count, 1), np.float32)
    return np.concatenate([rgb, alpha], axis=1)
