"""A simple NumPy path tracer on embreex, which shares no code with bakes. Tests compare bakes with it.

The path tracer computes irradiance at points, with light sampling of emissive triangles at every vertex of a
path, cosine-weighted bounces and Russian roulette. Surfaces are Lambertian without textures, one-sided or
double-sided.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from baker.core.scene import Scene

# Offset of ray origins along the normal, metres.
LIFT = 1e-4


class PathTracer:
    """The triangles, colours and emitters of a scene, world space."""

    def __init__(self, scene: Scene) -> None:
        corner, material = [], []
        for instance in scene.instances:
            mesh, matrix = scene.meshes[instance.mesh], instance.world_from_object
            world = mesh.position @ matrix[:3, :3].T + matrix[:3, 3]
            turned = np.linalg.det(matrix[:3, :3]) < 0
            corner.append(world[mesh.triangle[:, ::-1] if turned else mesh.triangle])
            material.append(mesh.material)
        self.corner = np.concatenate(corner)
        self.material = np.concatenate(material)
        cross = np.cross(self.corner[:, 1] - self.corner[:, 0], self.corner[:, 2] - self.corner[:, 0])
        length = np.linalg.norm(cross, axis=1)
        self.normal, self.area = cross / length[:, None], length / 2
        self.albedo = np.array([m.base_colour[:3] for m in scene.materials])
        self.emission = np.array([m.emission for m in scene.materials])
        self.double_sided = np.array([m.double_sided for m in scene.materials])
        self.emitter = np.flatnonzero(self.emission[self.material].max(axis=1) > 0)
        power = self.area[self.emitter] * self.emission[self.material[self.emitter]].sum(axis=1)
        self.chance = power / power.sum()
        self.embree = EmbreeScene()
        self.mesh = TriangleMesh(self.embree, self.corner.astype(np.float32))

    def irradiance(self, point: Any, normal: Any, rng: np.random.Generator, *, depth: int = 60) -> np.ndarray:
        """Return one estimate of E, (n, 3) lx, for each of n points and normals (n, 3)."""
        point, normal = np.array(point, float), np.array(normal, float)
        result = np.zeros((len(point), 3))
        path, weight = np.arange(len(point)), np.ones((len(point), 3))
        for step in range(depth):
            result[path] += weight * self._emitters(point, normal, rng)
            direction = _cosine(normal, rng)
            hit, where = self._closest(point + LIFT * normal, direction)
            front = (self.normal[hit] * direction).sum(axis=1) < 0
            seen = (hit >= 0) & (front | self.double_sided[self.material[hit]])
            # The reflected part of E is pi / n sum L, and the surface hit has L = albedo E' / pi. Therefore
            # each bounce multiplies by the albedo of that surface.
            path, weight = path[seen], weight[seen] * self.albedo[self.material[hit[seen]]]
            point = where[seen]
            normal = np.where(front[seen, None], self.normal[hit[seen]], -self.normal[hit[seen]])
            if step >= 2 and len(path):
                survive = np.clip(weight.max(axis=1), 0.05, 0.95)
                alive = rng.random(len(path)) < survive
                path, point, normal = path[alive], point[alive], normal[alive]
                weight = weight[alive] / survive[alive, None]
            if not len(path):
                break
        return result

    def inside_geometry(self, point: Any, normal: Any) -> np.ndarray:
        """Return (n,) bool: the points whose ray along the normal hits the back of a one-sided surface."""
        normal = np.asarray(normal, float)
        hit, _ = self._closest(np.asarray(point, float) + LIFT * normal, normal)
        back = (self.normal[hit] * normal).sum(axis=1) > 0
        return (hit >= 0) & back & ~self.double_sided[self.material[hit]]

    def _emitters(self, point: np.ndarray, normal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return an estimate (n, 3) of direct irradiance, from one random emitter point for each point."""
        pick = rng.choice(len(self.emitter), len(point), p=self.chance)
        triangle = self.emitter[pick]
        root, share = np.sqrt(rng.random((len(point), 1))), rng.random((len(point), 1))
        a, b, c = (self.corner[triangle, k] for k in range(3))
        target = (1 - root) * a + root * (1 - share) * b + root * share * c
        origin = point + LIFT * normal
        arm = target - origin
        square = (arm * arm).sum(axis=1)
        direction = arm / np.sqrt(square)[:, None]
        here = np.maximum((direction * normal).sum(axis=1), 0)
        there = -(direction * self.normal[triangle]).sum(axis=1)
        there = np.where(self.double_sided[self.material[triangle]], np.abs(there), np.maximum(there, 0))
        value = here * there / square * self.area[triangle] / self.chance[pick]
        lit = np.flatnonzero(value > 0)
        if len(lit):
            hit, where = self._closest(origin[lit], direction[lit])
            reached = np.linalg.norm(where - origin[lit], axis=1) > np.sqrt(square[lit]) * (1 - 1e-3)
            value[lit] = np.where(reached | (hit < 0), value[lit], 0)
        return value[:, None] * self.emission[self.material[triangle]]

    def _closest(self, origin: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        answer = self.embree.run(
            origin.astype(np.float32), direction.astype(np.float32), query="INTERSECT", output=True
        )
        where = origin + np.minimum(answer["tfar"], 1e6)[:, None] * direction
        return answer["primID"].astype(np.int64), where


def _cosine(normal: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return cosine-weighted directions: normal plus a random point of the unit sphere, normalized."""
    z = 2 * rng.random(len(normal)) - 1
    turn = 2 * np.pi * rng.random(len(normal))
    radius = np.sqrt(1 - z * z)
    out = normal + np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=1)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)
