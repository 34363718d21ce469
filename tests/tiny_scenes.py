"""Makes scenes of a few rectangles with known lightmap uv, for tests that run single stages of a bake."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.geometry import world_geometry
from baker.core.progress import silent
from baker.core.scene import Instance, Material, Mesh, Scene
from baker.lights.emissive import build_emitters
from baker.radiosity.emitter_choice import EmitterSampling
from baker.radiosity.kernels.side_table import SeenLight, SeenPatch, no_sides
from baker.radiosity.texels import build_texels
from baker.radiosity.trace_job import TraceJob
from baker.radiosity.triangle_lookup import build_triangle_lookup
from baker.shading.materials import resolve_materials
from baker.shading.scene_solids import hit_kinds, scene_solids
from baker.trace.embree import RayScene


@dataclass(frozen=True)
class Quad:
    """A rectangle with the corner `corner` and two edges; its front is towards edge_u x edge_v."""

    corner: tuple[float, float, float]
    edge_u: tuple[float, float, float]
    edge_v: tuple[float, float, float]
    material: Material = field(default_factory=lambda: Material(base_colour=(0.5, 0.5, 0.5, 1.0)))
    colour: Any = None


@dataclass(frozen=True)
class World:
    """The data of a `PreparedScene`, without searches for invalid points and split texels."""

    scene: Any
    atlas: Any
    geometry: Any
    shading: Any
    texels: Any
    surface: Any
    rays: Any
    emitters: Any
    table: Any

    @property
    def free(self):
        """Return (n,) uint16 point masks with all bits set: no point is inside geometry."""
        return np.full(self.texels.n, 0xFFFF, np.uint16)

    def job(self, valid=None, threads=1, seed=0):
        """Return the job of all texels; `valid` (n,) uint16 masks the valid points, default all."""
        valid = self.free if valid is None else valid
        return TraceJob(self.surface, valid, self.table, self.rays.tracer, seed, threads, silent)

    def sampling(self, n_light, n_gather):
        """Return the sampling of emitters with these numbers of light and gather rays per texel."""
        return EmitterSampling(self.emitters, self.shading, n_light, n_gather)

    @property
    def hit_kind(self):
        """Return the argument `hit_kind` (T,) uint8 of `find_inside_geometry`."""
        solids = scene_solids(self.scene, self.geometry, self.shading)
        return hit_kinds(self.geometry, self.shading, solids)


def seen_patches(texels, patch):
    """Return the lookup from hits to patches, if no texel is split (see `baker.radiosity.sides`)."""
    return SeenPatch(texels.hit_image(patch, -1), np.zeros(0, np.int32), no_sides())


def seen_light(texels, exitance):
    """Return the lookup from hits to reflected light, if no texel is split."""
    light = exitance * np.float32([1, 1, 1, 0])
    return SeenLight(texels.hit_image(light), np.zeros((0, 4), np.float32), no_sides())


def grey(albedo=0.5, emission=0.0, double_sided=False):
    return Material(
        base_colour=(albedo, albedo, albedo, 1.0), emission=(emission,) * 3, double_sided=double_sided
    )


def quad_scene(quads):
    meshes, instances = [], []
    square = np.float32([[0, 0], [1, 0], [1, 1], [0, 1]])
    for k, quad in enumerate(quads):
        u, v = np.array(quad.edge_u), np.array(quad.edge_v)
        normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
        zero, row = np.zeros(2, np.int32), np.arange(4, dtype=np.int32)
        meshes.append(
            Mesh(
                f"quad {k}",
                np.float32(np.array(quad.corner) + square[:, :1] * u + square[:, 1:] * v),
                np.float32(np.tile(normal, (4, 1))),
                np.int32([[0, 1, 2], [0, 2, 3]]),
                zero + np.int32(k),
                zero,
                np.zeros(4, np.int32),
                row,
                (square, None),
                None if quad.colour is None else np.float32(quad.colour),
            )
        )
        instances.append(Instance(k, f"quad {k}", k, np.eye(4)))
    return Scene("tiny", None, tuple(meshes), tuple(q.material for q in quads), tuple(instances))


def joined(scene, order=slice(None)):
    """Return the scene with all triangles in one object, in the order `order`."""
    first = np.cumsum([0, *(len(m.position) for m in scene.meshes)])
    names = ("position", "normal", "material", "primitive", "vertex_primitive", "source_vertex")
    column = {name: np.concatenate([getattr(m, name) for m in scene.meshes]) for name in names}
    triangle = np.concatenate([m.triangle + s for m, s in zip(scene.meshes, first, strict=False)])
    # Reorder materials together with triangles.
    for name in ("material", "primitive"):
        column[name] = column[name][order]
    mesh = Mesh("all", triangle=np.int32(triangle[order]), **column)
    return Scene("tiny", None, (mesh,), scene.materials, (Instance(0, "all", 0, np.eye(4)),))


def quad_atlas(scene, size, inset=0.0):
    """Return an atlas in which each quad has one cell of a square grid.

    A quad starts `inset` texels from the lower corner of its cell. Its side is cell - 1 - 2 inset texels.
    """
    side = int(np.ceil(np.sqrt(len(scene.instances))))
    cell = size // side
    layouts = []
    for k, instance in enumerate(scene.instances):
        base = np.array([k % side, k // side]) * cell
        uv = (base + inset + scene.meshes[instance.mesh].texcoord[0] * (cell - 1 - 2 * inset)) / size
        mesh = scene.meshes[instance.mesh]
        row = np.arange(4, dtype=np.int32)
        chart = np.full(2, k, np.int32)
        layouts.append(InstanceLayout(k, 0, row, np.float32(uv), mesh.triangle, chart, True, float(cell)))
    return Atlas(size, 1, tuple(layouts), len(layouts), 1)


def quad_world(quads, size=16, inset=0.0):
    scene = quad_scene(quads)
    return world_of(scene, quad_atlas(scene, size, inset))


def world_of(scene, atlas):
    geometry = world_geometry(scene, atlas)
    shading = resolve_materials(scene, geometry)
    texels, surface = build_texels(geometry, shading, atlas, seed=0, threads=1, progress=silent)
    rays = RayScene(geometry.position, geometry.triangle, threads=1)
    emitters = build_emitters(geometry, shading)
    table = build_triangle_lookup(geometry, texels, emitters)
    return World(scene, atlas, geometry, shading, texels, surface, rays, emitters, table)


def box_quads(low, high, *, inward, material=None):
    """Return the six rectangles of an axis-aligned box, fronts inwards (a room) or outwards (a crate)."""
    low, high = np.array(low, float), np.array(high, float)
    quads = []
    for axis in range(3):
        u, v = np.zeros(3), np.zeros(3)
        u[(axis + 1) % 3] = (high - low)[(axis + 1) % 3]
        v[(axis + 2) % 3] = (high - low)[(axis + 2) % 3]
        for side in (0, 1):
            corner = low.copy()
            corner[axis] = (low, high)[side][axis]
            # u x v is the positive axis, which points outwards at the high side.
            a, b = (u, v) if (side == 1) != inward else (v, u)
            quads.append(Quad(tuple(corner), tuple(a), tuple(b), material or grey()))
    return quads
