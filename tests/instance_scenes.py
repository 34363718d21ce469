"""Makes glTF scenes in which nodes share a mesh, and looks up their light in the written files.

The lookup uses no code of `baker` but its EXR decoder: it reads scene.glb and bake.json as an engine does.
"""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
from glb_reader import Glb
from gltf_builder import GltfBuilder

from baker.core.encoding import encoding_of

# Position of the light, metres, and its intensity, cd.
LIGHT, INTENSITY = np.array([0.0, 12.0, 0.0]), 1000.0


def box_arrays() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return positions and normals (24, 3), and triangles (12, 3) of a box of 1 x 1 x 0.5 m around 0."""
    position, normal, triangle = [], [], []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corner = np.zeros((4, 3))
            corner[:, axis] = sign
            corner[:, (axis + 1) % 3] = np.array([-1, 1, 1, -1]) * sign
            corner[:, (axis + 2) % 3] = [-1, -1, 1, 1]
            base = 4 * len(position)
            position.append(corner * [0.5, 0.5, 0.25])
            normal.append(np.tile(np.eye(3)[axis] * sign, (4, 1)))
            triangle += [[base, base + 1, base + 2], [base, base + 2, base + 3]]
    arrays = np.concatenate(position), np.concatenate(normal)
    return *(a.astype(np.float32) for a in arrays), np.array(triangle, np.uint16)


def boxes(nodes: list[dict], *, material: dict | None = None) -> GltfBuilder:
    """Return a scene of one box mesh, on nodes with the given members, under a point light."""
    builder = GltfBuilder()
    position, normal, triangle = box_arrays()
    extra = {} if material is None else {"material": builder.add("materials", material)}
    box = builder.mesh(builder.primitive(position, triangle, NORMAL=normal, **extra), name="box")
    for number, members in enumerate(nodes):
        builder.node(**{"name": f"box {number}", "mesh": box, **members})
    add_light(builder)
    return builder


def add_light(builder: GltfBuilder) -> None:
    """Add a point light of `INTENSITY` at `LIGHT`."""
    light = {"type": "point", "intensity": INTENSITY, "color": [1, 1, 1]}
    builder.json["extensions"] = {"KHR_lights_punctual": {"lights": [light]}}
    builder.json["extensionsUsed"] = ["KHR_lights_punctual"]
    builder.node(translation=LIGHT.tolist(), extensions={"KHR_lights_punctual": {"light": 0}})


def irradiance(point: np.ndarray, normal: np.ndarray) -> float:
    """Return E of the light without obstacles, lx: I cos / r^2."""
    away = LIGHT - point
    distance = float(np.linalg.norm(away))
    return INTENSITY * max(float(normal @ away) / distance, 0.0) / distance**2


class WrittenBake:
    """Looks up the light of objects in an output folder."""

    def __init__(self, out: Path) -> None:
        self.out = out
        self.glb = Glb((out / "scene.glb").read_bytes())
        self.manifest = json.loads((out / "bake.json").read_text("utf-8"))
        self.rows = {row["node"]: row for row in self.manifest["instances"]}
        self.pages = {}
        for page in self.manifest["pages"]:
            encoding = encoding_of(page["file"])
            assert encoding is not None
            self.pages[page["channel"], page["page"]] = encoding.decode(out / page["file"]).pixels
        self.matrix: dict[int, np.ndarray] = {}
        self._place(self.glb.json["scenes"][self.glb.json.get("scene", 0)]["nodes"], np.eye(4))

    def _place(self, nodes: list[int], parent: np.ndarray) -> None:
        for index in nodes:
            node = self.glb.json["nodes"][index]
            self.matrix[index] = parent @ _matrix(node)
            self._place(node.get("children", []), self.matrix[index])

    def primitives(self, node: int) -> list[dict]:
        """Return the primitives of a node's mesh."""
        return self.glb.json["meshes"][self.glb.json["nodes"][node]["mesh"]]["primitives"]

    def page_corners(self, node: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the world positions (T, 3, 3) and the page uv (T, 3, 2) of a node's triangles."""
        position, uv = [], []
        for primitive in self.primitives(node):
            position.append(self.glb.corners(primitive, "POSITION").astype(float))
            uv.append(self.glb.corners(primitive, "TEXCOORD_1").astype(float))
        row, matrix = self.rows[node], self.matrix[node]
        corner = np.concatenate(position) @ matrix[:3, :3].T + matrix[:3, 3]
        return corner, np.concatenate(uv) * row["uv_scale"] + row["uv_offset"]

    def samples(self, node: int, n: int, seed: int = 0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return n surface points of a node: positions and normals (n, 3), and page uv (n, 2).

        Points near the edges of triangles are left out.
        """
        rng = np.random.default_rng(seed)
        corner, uv = self.page_corners(node)
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        if np.linalg.det(self.matrix[node][:3, :3]) < 0:
            cross = -cross
        pick = rng.integers(len(corner), size=n)
        weight = 0.1 + 0.7 * rng.dirichlet([1, 1, 1], n)
        normal = cross[pick] / np.linalg.norm(cross[pick], axis=1, keepdims=True)
        point = np.einsum("nk,nkx->nx", weight, corner[pick])
        return point, normal, np.einsum("nk,nkx->nx", weight, uv[pick])

    def value(self, node: int, uv: np.ndarray, channel: str = "irradiance") -> np.ndarray:
        """Return the bilinear lookup (C,) of a page at uv (2,)."""
        page = self.pages[channel, self.rows[node]["page"]]
        x, y = uv[0] * page.shape[1] - 0.5, uv[1] * page.shape[0] - 0.5
        c, r = math.floor(x), math.floor(y)
        low = page[r, c] * (c + 1 - x) + page[r, c + 1] * (x - c)
        high = page[r + 1, c] * (c + 1 - x) + page[r + 1, c + 1] * (x - c)
        return low * (r + 1 - y) + high * (y - r)


def _matrix(node: dict) -> np.ndarray:
    """Return the matrix of a glTF node."""
    if "matrix" in node:
        return np.array(node["matrix"], float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.array(node.get("scale", (1, 1, 1)), float)
    matrix[:3, 3] = node.get("translation", (0, 0, 0))
    return matrix
