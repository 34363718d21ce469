"""The scene made ready for rays: texels and their points, ray tree, tables; and the record of a bake."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.geometry import Geometry, world_geometry
from baker.core.parallel import thread_count
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.texels import TexelBuffer
from baker.kernels.emitters import Emitters
from baker.kernels.shading import Shading
from baker.kernels.surface import Surface
from baker.kernels.triangle_lookup import TriangleLookup
from baker.lights.emissive import build_emitters
from baker.pipeline.record import Record
from baker.radiosity.inside_geometry import find_buried
from baker.radiosity.point_cache import PointCache, keep_points
from baker.radiosity.sides import Sides, split_texels
from baker.radiosity.texels import build_texels
from baker.radiosity.triangle_lookup import build_triangle_lookup
from baker.shading.materials import resolve_materials
from baker.shading.ray_tree import build_ray_tree
from baker.shading.scene_solids import hide_backs
from baker.trace.embree import RayScene


@dataclass(frozen=True)
class World:
    """Everything that rays of a bake need, ready to be traced.

    inside (n_uncut,) uint16: points outside geometry, of entries before texels were split into sides.
    """

    geometry: Geometry
    shading: Shading
    texels: TexelBuffer
    surface: Surface
    rays: RayScene
    emitters: Emitters
    table: TriangleLookup
    tells: NDArray[np.uint8]
    inside: NDArray[np.uint16]
    sides: Sides
    kept: PointCache | None

    @property
    def mask(self) -> NDArray[np.uint16]:
        """Return the points (n,) uint16 of each entry: outside geometry and on its own side."""
        return self.sides.mask


def prepare(
    scene: Scene,
    atlas: Atlas,
    settings: BakeSettings,
    record: Record,
    inside: NDArray[np.uint16] | None = None,
) -> World:
    """Build texels, ray tree and tables; find points inside geometry unless `inside` has them, and sides."""
    threads = thread_count(settings.threads)
    with record.stage("texels"):
        geometry = world_geometry(scene, atlas)
        shading = resolve_materials(scene, geometry)
        geometry, tells = hide_backs(scene, geometry, shading)
        texels, surface = build_texels(
            geometry, shading, atlas, seed=settings.seed, threads=threads, progress=record.progress
        )
    with record.stage("ray tree"):
        rays = build_ray_tree(geometry, shading, threads=threads)
        emitters = build_emitters(geometry, shading)
        table = build_triangle_lookup(geometry, texels, emitters)
    if inside is None:
        with record.stage("buried texels"):
            inside, cast = find_buried(
                texels, surface, table, tells, rays.tracer,
                seed=settings.seed, threads=threads, progress=record.progress,
            )  # fmt: skip
            record.rays["buried texels"] = cast
    with record.stage("texel sides"):
        sides = split_texels(
            texels,
            surface,
            inside,
            table,
            rays.tracer,
            seed=settings.seed,
            threads=threads,
            progress=record.progress,
        )
        record.rays["texel sides"] = sides.rays
    return World(
        geometry=geometry,
        shading=shading,
        texels=sides.texels,
        surface=sides.surface,
        rays=rays,
        emitters=emitters,
        table=table,
        tells=tells,
        inside=inside,
        sides=sides,
        kept=keep_points(sides.texels.n),
    )
