"""Converts the whole scene to one list of world-space triangles with lightmap uv.

The list contains the triangles of a mesh once for each instance of the mesh, because each instance has
separate texels.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.errors import InputError
from baker.core.scene import Scene


@dataclass(frozen=True)
class Geometry:
    """World-space triangles, sorted by instance and then by their index in the mesh.

    Attributes
    ----------
    position : (V, 3) float32, metres, world, relative to `origin`
    normal : (V, 3) float32, shading normals, world; unit, or 0 if the mesh has a normal of 0
    uv : (V, 2) float32, lightmap uv in the page, 0 to 1
    vertex_source : (V,) int32, index of the mesh vertex that each vertex is a copy of
    triangle : (T, 3) int32, indices into the vertices, counter-clockwise seen from the front
    face_normal : (T, 3) float32, world; unit, or 0 for triangles without area
    area : (T,) float32, m2, area of each triangle
    page, instance, chart, material : (T,) int32, indices of each triangle's page, instance, chart, material
    double_sided : (T,) bool, whether the material is double-sided
    origin : (3,) float64, metres, world: `Scene.origin`
    """

    position: NDArray[np.float32]
    normal: NDArray[np.float32]
    uv: NDArray[np.float32]
    vertex_source: NDArray[np.int32]
    triangle: NDArray[np.int32]
    face_normal: NDArray[np.float32]
    area: NDArray[np.float32]
    page: NDArray[np.int32]
    instance: NDArray[np.int32]
    chart: NDArray[np.int32]
    material: NDArray[np.int32]
    double_sided: NDArray[np.bool_]
    origin: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

    @property
    def diagonal(self) -> float:
        """Return the diagonal length of the bounding box of all vertices, metres; 0 without vertices."""
        if not len(self.position):
            return 0.0
        return float(np.linalg.norm(self.position.max(axis=0) - self.position.min(axis=0)))


def world_geometry(scene: Scene, atlas: Atlas, origin: NDArray[np.float64] | None = None) -> Geometry:
    """Transform the triangles of all instances to world space and attach the lightmap uv of their layouts.

    Parameters
    ----------
    scene : Scene
        The meshes, instances and materials.
    atlas : Atlas
        One layout for each instance, in order.
    origin : (3,) float64, metres, world, optional
        Point that positions are relative to; `scene.origin` by default.

    Returns
    -------
    Geometry
        The triangles of all instances, in the order of instances.

    Raises
    ------
    InputError
        If there are vertices and all have the same position in float32.
    """
    origin = scene.origin if origin is None else origin
    columns: dict[str, list[NDArray[Any]]] = {name: [] for name in _COLUMNS}
    double_sided = np.array([m.double_sided for m in scene.materials], bool)
    start = 0
    for index, (instance, layout) in enumerate(zip(scene.instances, atlas.layouts, strict=True)):
        mesh = scene.meshes[instance.mesh]
        matrix = instance.world_from_object
        # Transform each mesh vertex once, so that its copies at chart borders have bitwise equal positions.
        # Subtract the origin in float64, because float32 numbers are widely spaced far from 0.
        shift = matrix[:3, 3] - origin
        position = (mesh.position.astype(np.float64) @ matrix[:3, :3].T + shift).astype(np.float32)
        normal = mesh.normal.astype(np.float64) @ np.linalg.inv(matrix[:3, :3])
        normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
        triangle = layout.triangle
        if np.linalg.det(matrix[:3, :3]) < 0:
            triangle = triangle[:, ::-1]
        columns["position"].append(position[layout.vertex])
        columns["normal"].append(normal.astype(np.float32)[layout.vertex])
        columns["uv"].append(layout.uv)
        columns["vertex_source"].append(layout.vertex)
        columns["triangle"].append(triangle + np.int32(start))
        n = len(triangle)
        columns["page"].append(np.full(n, layout.page, np.int32))
        columns["instance"].append(np.full(n, index, np.int32))
        columns["chart"].append(layout.chart)
        columns["material"].append(mesh.material)
        start += len(layout.vertex)
    data: dict[str, Any] = {
        name: np.concatenate(parts) if parts else _COLUMNS[name] for name, parts in columns.items()
    }
    face_normal, area = face_normals(data["position"], data["triangle"])
    geometry = Geometry(
        **data,
        face_normal=face_normal,
        area=area,
        double_sided=double_sided[data["material"]],
        origin=origin,
    )
    if len(geometry.position) and geometry.diagonal == 0.0:
        raise InputError(
            "all surfaces lie in one point, as far as 32-bit numbers can tell: the scene is too small, or"
            " too far from the origin for its size; scale it up, or move it to the origin",
            file=str(scene.path),
        )
    return geometry


def face_normals(
    position: NDArray[np.float32], triangle: NDArray[np.int32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return the unit normals and the areas of triangles.

    Parameters
    ----------
    position : (V, 3) float32, metres
        Vertices.
    triangle : (T, 3) int32
        Indices into the vertices, counter-clockwise seen from the front.

    Returns
    -------
    face_normal : (T, 3) float32
        Unit normals; 0 for triangles without area.
    area : (T,) float32, m2
        Areas.
    """
    corner = position[triangle].astype(np.float64)
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(cross, axis=1)
    normal = cross / np.maximum(length, 1e-300)[:, None]
    return normal.astype(np.float32), (0.5 * length).astype(np.float32)


_COLUMNS: dict[str, NDArray[Any]] = {
    "position": np.zeros((0, 3), np.float32), "normal": np.zeros((0, 3), np.float32),
    "uv": np.zeros((0, 2), np.float32), "vertex_source": np.zeros(0, np.int32),
    "triangle": np.zeros((0, 3), np.int32), "page": np.zeros(0, np.int32),
    "instance": np.zeros(0, np.int32), "chart": np.zeros(0, np.int32), "material": np.zeros(0, np.int32),
}  # fmt: skip
