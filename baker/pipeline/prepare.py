"""Prepares a scene for the ray stages: texels, their valid points and sides, ray tree, lookup tables."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas
from baker.core.geometry import Geometry, world_geometry
from baker.core.parallel import thread_count
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.core.texels import TexelBuffer
from baker.kernels.emitters import Emitters
from baker.kernels.shading import Shading
from baker.lights.emissive import build_emitters
from baker.pipeline.record import Record
from baker.radiosity.emitter_choice import EmitterSampling
from baker.radiosity.inside_geometry import find_inside_geometry
from baker.radiosity.object_reflection import without_reflection
from baker.radiosity.point_cache import new_point_cache
from baker.radiosity.sample_parts import SamplePart, sample_parts
from baker.radiosity.sides import Sides, split_texels
from baker.radiosity.texels import build_texels
from baker.radiosity.trace_job import TraceJob
from baker.radiosity.triangle_lookup import build_triangle_lookup
from baker.shading.materials import resolve_materials
from baker.shading.ray_tree import build_ray_tree
from baker.shading.scene_solids import hide_backs
from baker.trace.embree import RayScene


@dataclass(frozen=True)
class PreparedScene:
    """The input of the ray stages.

    Attributes
    ----------
    scene : Scene
    settings : BakeSettings
    geometry : Geometry
        Triangles in world space.
    shading : Shading
        Materials of all triangles.
    texels : TexelBuffer
        The n texel entries: fronts, backs, and further sides of split texels.
    rays : RayScene
        Ray tree.
    occluders : RayScene or None
        Ray tree of the objects that AO rays hit; None if these are the objects of `rays`.
    emitters : Emitters
        Emissive triangles and parts of triangles, grouped in clusters.
    hit_kind : (T,) uint8
        Meaning of a first hit on each triangle, see `baker.kernels.probe`.
    outside : (n_uncut,) uint16
        For each of the n_uncut entries before texels were split into sides, a mask of its 16 points: bit k is
        set if point k is outside geometry.
    sides : Sides
        Result of splitting texels into sides.
    job : TraceJob
        Data of the n entries that all ray stages share.
    parts : list of SamplePart
        Parts of the entries with equal numbers of rays.
    """

    scene: Scene
    settings: BakeSettings
    geometry: Geometry
    shading: Shading
    texels: TexelBuffer
    rays: RayScene
    occluders: RayScene | None
    emitters: Emitters
    hit_kind: NDArray[np.uint8]
    outside: NDArray[np.uint16]
    sides: Sides
    job: TraceJob
    parts: list[SamplePart]

    def close(self) -> None:
        """Release the ray trees."""
        self.rays.close()
        if self.occluders is not None:
            self.occluders.close()

    @property
    def sampling(self) -> EmitterSampling:
        """Return the emitters with the numbers of light and hemisphere rays per texel."""
        settings = self.settings
        n_light = settings.light_samples or settings.hemisphere_samples
        return EmitterSampling(self.emitters, self.shading, n_light, settings.hemisphere_samples)


def prepare_scene(
    scene: Scene,
    atlas: Atlas,
    settings: BakeSettings,
    record: Record,
    outside: NDArray[np.uint16] | None = None,
) -> PreparedScene:
    """Build texels, ray tree and tables, and find the valid points and sides of texels.

    Parameters
    ----------
    scene : Scene
        The scene to bake.
    atlas : Atlas
        The lightmap uv of the scene.
    settings : BakeSettings
        Settings of the bake.
    record : Record
        Receives timings and ray counts.
    outside : (n_uncut,) uint16, optional
        Points outside geometry, see `PreparedScene`; computed here by default.

    Returns
    -------
    PreparedScene
        The caller closes it with `close`.
    """
    threads = thread_count(settings.threads)
    with record.stage(Stage.TEXELS):
        geometry = world_geometry(scene, atlas)
        shading = resolve_materials(scene, geometry)
        geometry, hit_kind = hide_backs(scene, geometry, shading)
        texels, surface = build_texels(
            geometry, shading, atlas, seed=settings.seed, threads=threads, progress=record.progress
        )
        texels = without_reflection(scene, texels)
    with record.stage(Stage.RAY_TREE):
        seen, occludes = scene.object_flags("cast"), scene.object_flags("blocks_ao")
        rays = build_ray_tree(geometry, shading, threads=threads, unseen=~seen)
        occluders = None
        if (seen != occludes).any():
            occluders = build_ray_tree(geometry, shading, threads=threads, unseen=~occludes)
        emitters = build_emitters(geometry, shading)
        lookup = build_triangle_lookup(geometry, texels, emitters)
    every = np.full(texels.n, 0xFFFF, np.uint16)
    job = TraceJob(surface, every, lookup, rays.tracer, settings.seed, threads, record.progress)
    if outside is None:
        with record.stage(Stage.INSIDE_GEOMETRY):
            outside, cast = find_inside_geometry(texels, job, hit_kind)
            record.rays[Stage.INSIDE_GEOMETRY] = cast
    with record.stage(Stage.TEXEL_SIDES):
        sides = split_texels(texels, replace(job, valid_points=outside))
        record.rays[Stage.TEXEL_SIDES] = sides.rays
    texels = sides.texels
    job = replace(
        job,
        surface=sides.surface,
        valid_points=sides.valid_points,
        chart=texels.chart,
        point_cache=new_point_cache(texels.n),
    )
    return PreparedScene(
        scene=scene,
        settings=settings,
        geometry=geometry,
        shading=shading,
        texels=texels,
        rays=rays,
        occluders=occluders,
        emitters=emitters,
        hit_kind=hit_kind,
        outside=outside,
        sides=sides,
        job=job,
        parts=sample_parts(scene, texels),
    )
