"""Collects the good triangles of all instances in world space, and traces rays against them for checks.

Every triangle stops rays, even if its material is transparent.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from baker.checks.mesh_facts import MeshFacts
from baker.core.scene import Material
from baker.core.source_mesh import SourceInstance
from baker.core.stage import Stage

if TYPE_CHECKING:
    from baker.trace.embree import RayScene, Tracer

# Number of rays in each call of the kernel. A call is one task of a thread.
_TILE = 1 << 16


class WorldTriangles:
    """The good faces (see `MeshFacts`) of all instances as T triangles in world space, sorted by instance.

    Parameters
    ----------
    instances : sequence of SourceInstance
        The instances of the source scene.
    meshes : sequence of MeshFacts
        The meshes that `SourceInstance.mesh` refers to.
    materials : sequence of Material
        The materials of the scene.
    origin : (3,) float64, metres, world
        `Scene.origin`, which is subtracted from all positions.
    threads : int
        Number of threads for tracing rays.

    Attributes
    ----------
    position : (V, 3) float32, metres, world, relative to `origin`
        Vertices of all instances.
    triangle : (T, 3) int64
        Indices into `position`, counter-clockwise seen from the front. If a node mirrors its mesh,
        the corners are in reverse order compared with the mesh.
    instance : (T,) int64
        Index of the triangle's instance in `instances`.
    face : (T,) int64
        Index of the triangle's face in the `MeshFacts` of its mesh.
    normal : (T, 3) float64, unit, world; 0 for triangles without area
    area : (T,) float64, m2
    material : (T,) int32
    double_sided : (T,) bool
    """

    def __init__(
        self,
        instances: Sequence[SourceInstance],
        meshes: Sequence[MeshFacts],
        materials: Sequence[Material],
        origin: NDArray[np.float64],
        *,
        threads: int,
    ) -> None:
        self.instances, self.meshes, self.materials = instances, meshes, materials
        self.origin = origin
        self.threads = threads
        position, triangle, instance, face, material = [], [], [], [], []
        start = 0
        for k, shown in enumerate(instances):
            facts = meshes[shown.mesh]
            matrix = shown.world_from_object
            with np.errstate(over="ignore", invalid="ignore"):
                world = facts.position.astype(np.float64) @ matrix[:3, :3].T + (matrix[:3, 3] - origin)
            corner = facts.triangle[facts.good]
            if np.linalg.det(matrix[:3, :3]) < 0:
                corner = corner[:, ::-1]
            position.append(world.astype(np.float32))
            triangle.append(corner + start)
            instance.append(np.full(len(corner), k, np.int64))
            face.append(facts.good)
            material.append(facts.material[facts.good])
            start += len(world)
        none = np.zeros(0, np.int64)
        self.position = np.concatenate(position or [np.zeros((0, 3), np.float32)])
        self.triangle: NDArray[np.int64] = np.concatenate(triangle or [np.zeros((0, 3), np.int64)])
        self.instance: NDArray[np.int64] = np.concatenate(instance or [none])
        self.face: NDArray[np.int64] = np.concatenate(face or [none])
        self.material: NDArray[np.int32] = np.concatenate(material or [none.astype(np.int32)])
        sided = np.array([m.double_sided for m in materials], bool)
        self.double_sided: NDArray[np.bool_] = sided[self.material]
        # Compute areas and normals. Areas may be 0, because a node may have a scale of zero.
        a, b, c = (self.position[self.triangle[:, k]].astype(np.float64) for k in range(3))
        cross = np.cross(b - a, c - a)
        length = np.sqrt(np.einsum("tx,tx->t", cross, cross))
        self.area: NDArray[np.float64] = 0.5 * length
        self.normal: NDArray[np.float64] = cross / np.maximum(length, 1e-300)[:, None]

    @cached_property
    def size(self) -> NDArray[np.float64]:
        """Return (T,) metres: the largest |x|, |y| or |z| of the two edges at corner 0 of each triangle."""
        corner = self.position[self.triangle].astype(np.float64)
        return np.asarray(np.abs(corner[:, 1:] - corner[:, :1]).max(axis=(1, 2), initial=0.0))

    def lifted(
        self, point: NDArray[np.float64], triangle: NDArray[np.int64], normal: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return ray origins (n, 3): points (n, 3) on triangles (n,), moved along normals (n, 3)."""
        # Import the module here, because it imports the compiler.
        from baker.kernels.surface import OFFSET, ROUNDING

        far, size = np.abs(point).max(axis=1, initial=0.0), self.size[triangle]
        step = np.maximum(ROUNDING * np.maximum(far, size), OFFSET * np.minimum(far, size))
        return np.asarray(point + step[:, None] * normal)

    def middle_of(self, triangle: int) -> tuple[float, float, float]:
        """Return the centroid of triangle number `triangle`, metres, world."""
        middle = self.position[self.triangle[triangle]].mean(axis=0) + self.origin
        x, y, z = (float(v) for v in middle)
        return x, y, z

    @cached_property
    def rays(self) -> RayScene:
        """Return the ray tree of all triangles."""
        from baker.trace.embree import RayScene

        return RayScene(self.position, self.triangle.astype(np.uint32), threads=self.threads)

    def first_hits(
        self,
        origin: NDArray[np.floating],
        direction: NDArray[np.floating],
        near: NDArray[np.floating],
        far: NDArray[np.floating],
    ) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
        """Return the first hits of n rays: triangles (n,) int32 and distances (n,) float32.

        The triangle is -1 for rays without a hit. Distances are in lengths of `direction`.

        Parameters
        ----------
        origin : (n, 3) float, metres, relative to `Scene.origin`
        direction : (n, 3) float
            Need not have unit length.
        near, far : (n,) float
            Range of distances within which hits are searched, in lengths of `direction`.
        """
        return cast(self.rays.tracer, self.threads, origin, direction, near, far)


def cast(
    tracer: Tracer,
    threads: int,
    origin: NDArray[np.floating],
    direction: NDArray[np.floating],
    near: NDArray[np.floating],
    far: NDArray[np.floating],
) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """Trace n rays with a tracer; return triangles and distances as `WorldTriangles.first_hits` does."""
    from baker.core.parallel import run_tiles
    from baker.core.progress import silent
    from baker.kernels.cast import first_hits
    from baker.trace.packets import new_packet_buffers

    n = len(origin)
    triangle, distance = np.full(n, -1, np.int32), np.zeros(n, np.float32)
    a, b, c, d = (np.ascontiguousarray(value, np.float32) for value in (origin, direction, near, far))

    def work(i: int, j: int) -> None:
        first_hits(new_packet_buffers(tracer), a[i:j], b[i:j], c[i:j], d[i:j], triangle[i:j], distance[i:j])

    if 0 < n <= _TILE:
        # Start no threads for one tile: `check` casts a few rays for each mesh.
        work(0, n)
        return triangle, distance
    run_tiles(n, _TILE, work, threads=threads, stage=Stage.CHECKS, progress=silent)
    return triangle, distance
