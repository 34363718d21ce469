"""Writes a closed room with bumpy blobs. Its shape is the same for any number of triangles.

The bumps are several times larger than the triangles if there are at least 10 000, so all such versions look
alike. The scene has lightmap uv, so that a bake measures rays and not the unwrap.

    python benchmarks/scenes.py 100000 blobs.glb
"""

from __future__ import annotations

import json
import math
import struct
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Number of blobs along a side of their square grid. A blob is a cube whose faces are projected onto a sphere.
ROWS = 3
# Half the side of the square floor, and height of the room, metres.
HALF, HEIGHT = 5.0, 5.0
# Number of lightmap cells along a side of the page, for 54 blob faces, 6 walls and 1 ceiling light.
CELLS = 8
# Empty border of a cell, as a share of its side.
GUTTER = 0.06
# Height of the bumps, metres. A blob has the radius 0.9 m + `BUMP` times a function from -1.5 to 1.5.
BUMP = 0.08
# Radiance of the ceiling light, cd/m2.
EMISSION = (60.0, 55.0, 48.0)
# Position, normal, uv and triangles of a part of the mesh.
Patch = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]


def write_blobs(triangles: int, path: Path) -> int:
    """Write the room to a GLB file with about `triangles` triangles; return the actual number."""
    side = max(2, round(math.sqrt(triangles / (ROWS * ROWS * 6 * 2))))
    cell = iter(range(CELLS * CELLS))
    blobs = [
        _face(axis, sign, side, ((i - 1) * 3.0, 1.5 + 0.4 * ((i + 2 * k) % 3), (k - 1) * 3.0), next(cell))
        for i in range(ROWS)
        for k in range(ROWS)
        for axis in range(3)
        for sign in (-1.0, 1.0)
    ]
    walls = [_wall(axis, sign, next(cell)) for axis in range(3) for sign in (-1.0, 1.0)]
    light = [_ceiling_light(next(cell))]
    _write(path, {"blobs": blobs, "walls": walls, "lamp": light})
    return sum(len(patch[3]) for patch in (*blobs, *walls, *light))


def _sheet(position: NDArray[np.float64], normal: NDArray[np.float64], cell: int, *, flip: bool) -> Patch:
    """Return the triangles of a grid of points (n, n, 3), with uv that fill one cell of the page.

    flip : bool, whether to reverse the winding of the triangles
    """
    n = len(position)
    ticks = np.linspace(GUTTER, 1.0 - GUTTER, n)
    u, v = np.meshgrid(ticks, ticks, indexing="ij")
    uv = np.stack([(cell % CELLS + u) / CELLS, (cell // CELLS + v) / CELLS], axis=-1)
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    triangle = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    if flip:
        triangle = triangle[:, ::-1]
    return position.reshape(-1, 3), normal.reshape(-1, 3), uv.reshape(-1, 2), triangle


def _grid(axis: int, sign: float, n: int) -> NDArray[np.float64]:
    # Divide a face of the cube in equal angles, so that its triangles on the sphere have similar sizes.
    ticks = np.tan(np.linspace(-math.pi / 4, math.pi / 4, n))
    ticks[0], ticks[-1] = -1.0, 1.0
    u, v = np.meshgrid(ticks, ticks, indexing="ij")
    point = np.zeros((n, n, 3))
    point[..., axis], point[..., (axis + 1) % 3], point[..., (axis + 2) % 3] = sign, u, v
    return point


def _face(axis: int, sign: float, side: int, centre: tuple[float, float, float], cell: int) -> Patch:
    direction = _grid(axis, sign, side + 1)
    direction /= np.sqrt((direction**2).sum(axis=2, keepdims=True))
    x, y, z = direction[..., 0], direction[..., 1], direction[..., 2]
    phase = centre[0] + 2.0 * centre[2]
    bump = np.sin(5 * x + phase) * np.sin(4 * y - phase) + 0.5 * np.sin(7 * z + 2 * x + phase)
    radius = 0.9 + BUMP * bump
    position = direction * radius[..., None]
    # Compute the normal of the surface r = R(d), where d is a direction. It is d - grad R / R, with the
    # gradient on the unit sphere.
    gradient = np.stack(
        [
            5 * np.cos(5 * x + phase) * np.sin(4 * y - phase) + np.cos(7 * z + 2 * x + phase),
            4 * np.sin(5 * x + phase) * np.cos(4 * y - phase),
            3.5 * np.cos(7 * z + 2 * x + phase),
        ],
        axis=-1,
    )
    gradient = BUMP * (gradient - (gradient * direction).sum(axis=2, keepdims=True) * direction)
    normal = direction - gradient / radius[..., None]
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    return _sheet(position + np.array(centre), normal, cell, flip=sign < 0)


def _wall(axis: int, sign: float, cell: int) -> Patch:
    scale = np.array([HALF, HEIGHT / 2, HALF])
    point = _grid(axis, sign, 2)
    normal = np.zeros_like(point)
    normal[..., axis] = -sign
    # Reverse the winding, because walls face inwards.
    return _sheet(point * scale + [0.0, HEIGHT / 2, 0.0], normal, cell, flip=sign > 0)


def _ceiling_light(cell: int) -> Patch:
    point = _grid(1, 1.0, 2) * [1.5, 0.0, 1.5] + [0.0, HEIGHT - 0.02, 0.0]
    normal = np.zeros_like(point)
    normal[..., 1] = -1.0
    return _sheet(point, normal, cell, flip=True)


def _write(path: Path, parts: dict[str, list[Patch]]) -> None:
    """Write a GLB file with one mesh, material and node for each part."""
    body = bytearray()
    views: list[dict[str, int]] = []
    accessors: list[dict[str, object]] = []

    def store(array: NDArray[np.generic], kind: str, component: int) -> int:
        views.append({"buffer": 0, "byteOffset": len(body), "byteLength": array.nbytes})
        body.extend(array.tobytes())
        entry: dict[str, object] = {
            "bufferView": len(views) - 1,
            "componentType": component,
            "count": len(array),
            "type": kind,
        }
        if kind == "VEC3":
            entry |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append(entry)
        return len(accessors) - 1

    meshes = []
    for number, (name, patches) in enumerate(parts.items()):
        start = np.cumsum([0, *(len(patch[0]) for patch in patches)])
        triangle = np.concatenate([patch[3] + s for patch, s in zip(patches, start, strict=False)])
        position, normal, uv = (
            np.concatenate([patch[k] for patch in patches]).astype("<f4") for k in range(3)
        )
        attributes = {
            "POSITION": store(position, "VEC3", 5126),
            "NORMAL": store(normal, "VEC3", 5126),
            "TEXCOORD_1": store(uv, "VEC2", 5126),
        }
        attributes["TEXCOORD_0"] = attributes["TEXCOORD_1"]
        index = store(triangle.astype("<u4").reshape(-1), "SCALAR", 5125)
        primitive = {"attributes": attributes, "indices": index, "material": number}
        meshes.append({"name": name, "primitives": [primitive]})
    strength = max(EMISSION)
    materials: list[dict[str, object]] = [
        {"name": name, "pbrMetallicRoughness": {"baseColorFactor": [*colour, 1.0], "metallicFactor": 0.0}}
        for name, colour in (
            ("clay", (0.6, 0.45, 0.35)),
            ("plaster", (0.7, 0.7, 0.7)),
            ("lamp", (0.8, 0.8, 0.8)),
        )
    ]
    materials[2]["emissiveFactor"] = [part / strength for part in EMISSION]
    materials[2]["extensions"] = {"KHR_materials_emissive_strength": {"emissiveStrength": strength}}
    document = {
        "asset": {"version": "2.0", "generator": "baker benchmarks/scenes.py"},
        "extensionsUsed": ["KHR_materials_emissive_strength"],
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"name": mesh["name"], "mesh": number} for number, mesh in enumerate(meshes)],
        "meshes": meshes,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(body)}],
    }
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(body))
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(body), b"BIN\0") + body
    path.write_bytes(header + chunks)


if __name__ == "__main__":
    print(write_blobs(int(sys.argv[1]), Path(sys.argv[2])), "triangles")
