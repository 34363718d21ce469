"""Makes small meshes and scenes for the tests of the unwrap."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from baker.core.scene import Instance, Material, Mesh, Scene
from baker.topology.weld import weld
from baker.uv.xatlas_charts import ChartJob

Matrix = NDArray[np.float64]


def make_mesh(position, triangle, name: str = "mesh", lightmap_uv=None) -> Mesh:
    position = np.asarray(position, np.float32)
    triangle = np.asarray(triangle, np.int32)
    zero_t, zero_v = np.zeros(len(triangle), np.int32), np.zeros(len(position), np.int32)
    up = np.tile(np.float32([0, 1, 0]), (len(position), 1))
    uv = None if lightmap_uv is None else np.asarray(lightmap_uv, np.float32)
    row = np.arange(len(position), dtype=np.int32)
    return Mesh(name, position, up, triangle, zero_t, zero_t, zero_v, row, (None, uv))


def make_scene(meshes: Sequence[Mesh], instances: Sequence[tuple[int, Matrix]]) -> Scene:
    placed = tuple(Instance(k, f"object {k}", m, w) for k, (m, w) in enumerate(instances))
    return Scene("test", None, tuple(meshes), (Material(),), placed)


def place(x: float = 0.0, scale: float | tuple[float, float, float] = 1.0) -> Matrix:
    matrix = np.eye(4)
    matrix[:3, :3] = np.diag(np.broadcast_to(scale, 3))
    matrix[0, 3] = x
    return matrix


def box_mesh(size=(1.0, 1.0, 1.0), name: str = "box", uv=None) -> Mesh:
    """Return a box of 12 triangles with four separate vertices per face. `uv` (24, 2) is its TEXCOORD_1."""
    faces, triangles = [], []
    for axis in range(3):
        for side in (0.0, 1.0):
            quad = np.zeros((4, 3))
            quad[:, axis] = side
            quad[:, (axis + 1) % 3] = [0, 1, 1, 0]
            quad[:, (axis + 2) % 3] = [0, 0, 1, 1]
            turn = [0, 1, 2, 3] if side else [3, 2, 1, 0]
            base = 4 * len(faces)
            faces.append(quad[turn])
            triangles += [[base, base + 1, base + 2], [base, base + 2, base + 3]]
    position = np.concatenate(faces) * size
    return make_mesh(position, triangles, name, uv)


def box_uv(low: float = 0.02, high: float = 0.98) -> NDArray[np.float32]:
    """Return uv (24, 2) for `box_mesh`: six separate rectangles in a 3 x 2 grid from `low` to `high`."""
    uv = []
    for k in range(6):
        cell = np.array([k % 3, k // 3]) / (3, 2)
        for corner in ([0, 0], [1, 0], [1, 1], [0, 1]):
            uv.append(cell + (0.04 + 0.92 * np.array(corner)) / (3, 2))
    return np.float32(np.array(uv) * (high - low) + low)


def grid_mesh(
    rows: int, columns: int, surface, name: str = "grid", wrap: tuple[bool, bool] = (False, False)
) -> Mesh:
    """Return a grid of triangles on surface(s, t), with s and t in 0 to 1. `wrap` closes it along s or t."""
    n_s, n_t = rows + (not wrap[0]), columns + (not wrap[1])
    s, t = np.meshgrid(np.arange(n_s) / rows, np.arange(n_t) / columns, indexing="ij")
    position = np.stack(surface(s, t), axis=-1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    a, b = i * n_t + j, (i + 1) % n_s * n_t + j
    c, d = (i + 1) % n_s * n_t + (j + 1) % n_t, i * n_t + (j + 1) % n_t
    return make_mesh(position, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), name)


def torus_mesh(major: int = 48, minor: int = 24) -> Mesh:
    def surface(s, t):
        u, v = 2 * np.pi * s, 2 * np.pi * t
        return (1 + 0.3 * np.cos(v)) * np.cos(u), (1 + 0.3 * np.cos(v)) * np.sin(u), 0.3 * np.sin(v)

    return grid_mesh(major, minor, surface, "torus", (True, True))


def bent_mesh() -> Mesh:
    """Return a strip along a half circle of radius 1. The strip can be unrolled without stretch."""
    return grid_mesh(24, 4, lambda s, t: (np.cos(np.pi * s), np.sin(np.pi * s), t), "strip")


def ball_mesh(subdivisions: int) -> Mesh:
    golden = (1 + 5**0.5) / 2
    position = [[-1, golden, 0], [1, golden, 0], [-1, -golden, 0], [1, -golden, 0]]
    position += [[0, -1, golden], [0, 1, golden], [0, -1, -golden], [0, 1, -golden]]
    position += [[golden, 0, -1], [golden, 0, 1], [-golden, 0, -1], [-golden, 0, 1]]
    position = np.array(position, float)
    triangle = np.array(
        [
            "0",
            "11",
            "5",
            "0",
            "5",
            "1",
            "0",
            "1",
            "7",
            "0",
            "7",
            "10",
            "0",
            "10",
            "11",
            "1",
            "5",
            "9",
            "5",
            "11",
            "4",
            "11",
            "10",
            "2",
            "10",
            "7",
            "6",
            "7",
            "1",
            "8",
            "3",
            "9",
            "4",
            "3",
            "4",
            "2",
            "3",
            "2",
            "6",
            "3",
            "6",
            "8",
            "3",
            "8",
            "9",
            "4",
            "9",
            "5",
            "2",
            "4",
            "11",
            "6",
            "2",
            "10",
            "8",
            "6",
            "7",
            "9",
            "8",
            "1",
        ],
        int,
    ).reshape(-1, 3)
    for _ in range(subdivisions):
        corner = position[triangle]
        a, b, c = (0.5 * (corner[:, k] + corner[:, (k + 1) % 3]) for k in range(3))
        parts = np.stack([corner[:, 0], a, c, a, corner[:, 1], b, c, b, corner[:, 2], a, b, c], axis=1)
        position, triangle = np.unique(parts.reshape(-1, 3).round(12), axis=0, return_inverse=True)
        triangle = triangle.reshape(-1, 3)
    return make_mesh(position / np.linalg.norm(position, axis=1, keepdims=True), triangle, "ball")


def welded(mesh):
    """Return the distinct positions of a mesh's vertices, and its triangles as indices of these positions."""
    label = weld(mesh.position)
    place = np.zeros((label.max() + 1, 3))
    place[label] = mesh.position
    return place, label[mesh.triangle]


def job_of(mesh) -> ChartJob:
    """Return a mesh as one job of a worker."""
    place, triangle = welded(mesh)
    return ChartJob(place, triangle, np.array([0, len(place)]), np.array([0, len(triangle)]))
