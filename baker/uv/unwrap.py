"""Lays out all instances in lightmap pages: keeps or cuts their uv, packs them, and checks the result."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.core.atlas import Atlas, InstanceLayout
from baker.core.errors import InputError
from baker.core.progress import Progress, report, silent
from baker.core.scene import Instance, Mesh, Scene, SceneWarning
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.uv.blocks import with_blocks
from baker.uv.charts import MeshCharts, chart_meshes
from baker.uv.check import PAGE_TOLERANCE, page_overlap, uv_area
from baker.uv.density_share import object_shares
from baker.uv.keep import KeptUv, choose_kept, close_charts, kept_charts, lightmap_uv
from baker.uv.outlines import BlockInstance, CutInstance, Placement, RigidInstance, make_outlines
from baker.uv.page_groups import (
    hidden_density,
    join_atlases,
    page_groups,
    part_of_progress,
    settings_of_group,
)
from baker.uv.page_packer import DensityLimits
from baker.uv.pages import fill_pages
from baker.uv.place import PackedScene, place_instances
from baker.uv.shared import repeated_meshes, shared_sizes
from baker.uv.stretch import world_stretch

# Fraction of the stage "unwrap" at which cutting ends and packing starts.
_CUT_UNTIL = 0.7
_NONE = np.zeros(0, np.int32)


@dataclass(frozen=True)
class _Cut:
    """A mesh to cut. First, its positions are multiplied by `stretch`, a symmetric (3, 3) matrix.

    All instances with the same mesh and stretch share their charts.
    """

    mesh: int
    stretch: NDArray[np.float64]


def unwrap_scene(scene: Scene, settings: BakeSettings, progress: Progress = silent) -> Atlas:
    """Lay out all instances in lightmap pages of exactly `settings.resolution` texels.

    Parameters
    ----------
    scene : Scene
        The scene. `settings.uv` determines whether its TEXCOORD_1 are kept.
    settings : BakeSettings
        `resolution`, `density`, `max_pages`, `padding`, `uv` and `threads` are read.
    progress : Progress
        Called with the stage "unwrap"; a truthy return value stops the work and the worker processes.

    Returns
    -------
    Atlas
        The layout of all instances. It does not depend on the number of threads.

    Raises
    ------
    InputError
        If the scene has no triangles, if `uv` is "keep" and an object's TEXCOORD_1 cannot be kept, or if the
        charts do not fit the pages at any density.
    Cancelled
        If `progress` returned a truthy value.
    """
    file = str(scene.path) if scene.path else None
    if scene.n_triangles == 0:
        raise InputError("the scene has no triangles to bake", file=file)
    groups = page_groups(scene)
    if groups[0].hidden:
        raise InputError("no object is left that gets texels: all have receive=false", file=file)
    atlases: list[Atlas] = []
    for number, group in enumerate(groups):
        part = replace(scene, instances=tuple(scene.instances[k] for k in group.members))
        part_progress = part_of_progress(progress, number, len(groups))
        if group.hidden:
            hidden = settings.changed(density=None, budget=None, max_pages=max(settings.max_pages, 16))
            atlases.append(_unwrap_group(part, hidden, part_progress, most=hidden_density(atlases)))
            continue
        n_later = sum(not later.hidden for later in groups[number + 1 :])
        own = settings_of_group(settings, sum(atlas.n_pages for atlas in atlases), n_later)
        reserved = settings.max_pages - own.max_pages
        atlases.append(_unwrap_group(part, own, part_progress, reserved=reserved))
    return join_atlases(scene, groups, atlases)


def _unwrap_group(
    scene: Scene, settings: BakeSettings, progress: Progress, *, most: float = np.inf, reserved: int = 0
) -> Atlas:
    """Lay out the instances of one group in pages of their own.

    most : upper limit of the density, texels per metre; reserved : see `DensityLimits`
    """
    report(progress, Stage.UNWRAP, 0.0)
    kept = choose_kept(scene, settings.resolution, settings.uv)
    if kept.together and most == np.inf:
        atlas = _keep_all(scene, settings, kept.warnings)
    else:
        try:
            atlas = _lay_out(scene, settings, progress, kept, (most, reserved))
        except InputError as error:
            # Add the path of the scene, which the packer cannot name.
            raise InputError(
                error.message,
                file=error.file or (str(scene.path) if scene.path else None),
                object=error.object,
            ) from None
    report(progress, Stage.UNWRAP, 1.0, f"{atlas.n_charts} charts, {atlas.n_pages} pages")
    return atlas


def _keep_all(scene: Scene, settings: BakeSettings, warnings: tuple[SceneWarning, ...]) -> Atlas:
    """Return an atlas of one page in which every instance keeps its TEXCOORD_1 unchanged."""
    layouts: list[InstanceLayout] = []
    n_charts = 0
    for k, instance in enumerate(scene.instances):
        mesh = scene.meshes[instance.mesh]
        uv = lightmap_uv(mesh)
        assert uv is not None
        chart = kept_charts(mesh) + n_charts
        n_charts = int(chart.max(initial=n_charts - 1)) + 1
        density = settings.resolution * _per_metre(mesh, instance, uv)
        vertex = np.arange(len(uv), dtype=np.int32)
        layouts.append(InstanceLayout(k, 0, vertex, uv, mesh.triangle, chart.astype(np.int32), True, density))
    found = list(warnings)
    close = close_charts(
        [layout.uv[layout.triangle] for layout in layouts],
        [layout.chart for layout in layouts],
        settings.resolution,
        min(settings.padding, 8),
    )
    if close:
        message = f"{close} texels of the kept uv have another chart within the padding of {settings.padding}"
        found.append(SceneWarning("uv.close", message))
    if settings.density is not None:
        message = "the kept uv fills one page as it is; `density` is not used"
        found.append(SceneWarning("uv.density_unused", message))
    return Atlas(settings.resolution, 1, tuple(layouts), n_charts, settings.padding, tuple(found))


def _lay_out(
    scene: Scene,
    settings: BakeSettings,
    progress: Progress,
    kept: KeptUv,
    bounds: tuple[float, int],
) -> Atlas:
    """Cut the instances whose TEXCOORD_1 is not usable, and pack all instances.

    bounds : `most` and `reserved` of `DensityLimits`
    """
    # Leave out instances without triangles.
    filled = [k for k, i in enumerate(scene.instances) if len(scene.meshes[i.mesh].triangle)]
    shares, fixed = object_shares(scene, [scene.instances[k] for k in filled], settings.density)
    repeated = repeated_meshes(scene, filled, settings)
    placements, cuts = _placements(scene, filled, (shares, fixed), kept.usable, repeated)
    found = list(kept.warnings)
    charts = _cut(scene, cuts, settings, progress, found)
    outlines = with_blocks(make_outlines(placements, charts), placements, charts, progress)
    names = [scene.instances[k].name or scene.meshes[scene.instances[k].mesh].name for k in filled]
    limits = DensityLimits(fixed, *bounds)
    pages, packing_warnings = fill_pages(outlines, names, settings, progress, limits)
    found += packing_warnings
    layouts: list[InstanceLayout] = [
        InstanceLayout(
            k, 0, _NONE, np.zeros((0, 2), np.float32), scene.meshes[i.mesh].triangle, _NONE, False, 1.0
        )
        for k, i in enumerate(scene.instances)
    ]
    packed = PackedScene(scene, filled, placements, charts, outlines, pages, repeated, settings.resolution)
    for layout in place_instances(packed, shares.tolist()):
        layouts[layout.instance] = layout
    # Number the charts over all instances, in the order of instances.
    n_charts = 0
    for k in filled:
        layouts[k] = replace(layouts[k], chart=layouts[k].chart + n_charts)
        n_charts = int(layouts[k].chart.max()) + 1
    found += _verify(layouts, len(pages), settings.resolution, scene, progress)
    return Atlas(settings.resolution, len(pages), tuple(layouts), n_charts, settings.padding, tuple(found))


def _placements(
    scene: Scene,
    filled: list[int],
    density: tuple[NDArray[np.float64], NDArray[np.bool_]],
    usable: NDArray[np.bool_],
    repeated: set[int],
) -> tuple[list[Placement], list[_Cut]]:
    """Return the placement of each instance in `filled`, and the distinct pairs of mesh and stretch to cut.

    filled : indices of n instances; density : result of `object_shares`; usable : (I,) bool, see `KeptUv`
    repeated : meshes whose instances share TEXCOORD_1
    """
    placements: list[Placement] = []
    cuts: list[_Cut] = []
    index: dict[tuple[int, bytes], int] = {}
    sizes = {
        k: (float(share), bool(fixed))
        for k, share, fixed in zip(filled, *density, strict=True)
        if not usable[k] and scene.instances[k].mesh in repeated
    }
    shared = shared_sizes(scene, sizes)
    for k, share in zip(filled, density[0].tolist(), strict=True):
        instance = scene.instances[k]
        if usable[k]:
            placements.append(_rigid(scene.meshes[instance.mesh], instance, share))
            continue
        if k in shared:
            factor, stretch = shared[k].factor, shared[k].stretch
        else:
            factor, stretch = world_stretch(instance.world_from_object)
        key = (instance.mesh, stretch.tobytes())
        if key not in index:
            index[key] = len(cuts)
            cuts.append(_Cut(instance.mesh, stretch))
        if k in shared:
            placements.append(BlockInstance(index[key], factor * share, shared[k].layout))
        else:
            placements.append(CutInstance(index[key], factor * share))
    return placements, cuts


def _cut(
    scene: Scene, cuts: list[_Cut], settings: BakeSettings, progress: Progress, found: list[SceneWarning]
) -> list[MeshCharts]:
    """Return the charts of each mesh in `cuts`; append warnings to `found`."""
    if not cuts:
        return []
    inputs = [
        (scene.meshes[c.mesh].position.astype(np.float64) @ c.stretch, scene.meshes[c.mesh].triangle)
        for c in cuts
    ]
    charts = chart_meshes(inputs, settings.threads or os.cpu_count() or 1, progress, _CUT_UNTIL)
    for cut, one in zip(cuts, charts, strict=True):
        if one.n_repaired:
            name = scene.meshes[cut.mesh].name
            message = f"{one.n_repaired} triangles of '{name}' were cut into flat charts of their own"
            found.append(SceneWarning("uv.repaired", message, name))
    return charts


def _verify(
    layouts: list[InstanceLayout], n_pages: int, resolution: int, scene: Scene, progress: Progress
) -> list[SceneWarning]:
    """Return warnings about instances whose uv overlap in a page, or leave the page."""
    found: list[SceneWarning] = []
    for page in range(n_pages):
        report(progress, Stage.UNWRAP, 0.95 + 0.05 * page / n_pages)
        here = [layout for layout in layouts if layout.page == page and len(layout.triangle)]
        uv = np.concatenate([layout.uv[layout.triangle] for layout in here])
        group = np.concatenate([np.full(len(layout.triangle), k) for k, layout in enumerate(here)])
        overlap = page_overlap(uv, group, resolution)
        bad = overlap.overlaps(PAGE_TOLERANCE)
        for k, layout in enumerate(here):
            name = scene.instances[layout.instance].name
            if bad[k]:
                share = 100.0 * overlap.doubled[k] / overlap.covered[k]
                found.append(
                    SceneWarning("uv.overlap", f"{share:.3g}% of '{name}' overlaps in the lightmap", name)
                )
            used = layout.uv[layout.triangle]
            if not (used.min() >= 0.0 and used.max() <= 1.0):
                found.append(
                    SceneWarning("uv.out_of_range", f"the lightmap uv of '{name}' leaves its page", name)
                )
    return found


def _rigid(mesh: Mesh, instance: Instance, share: float) -> RigidInstance:
    """Return the placement of an instance that keeps its TEXCOORD_1. Packing moves and scales it as a whole.

    share : factor on the density of the instance
    """
    uv = lightmap_uv(mesh)
    assert uv is not None
    wide = uv.astype(np.float64)
    used = wide[mesh.triangle].reshape(-1, 2)
    # Clamp the uv of unused vertices, which may have any value, to the bounds of the uv of used vertices.
    wide = np.clip(np.nan_to_num(wide), used.min(axis=0), used.max(axis=0))
    factor = share / max(_per_metre(mesh, instance, uv), 1e-30)
    return RigidInstance(wide, used.min(axis=0), used.max(axis=0), factor)


def _per_metre(mesh: Mesh, instance: Instance, uv: NDArray[np.float32]) -> float:
    """Return the uv units per metre of an instance: sqrt(area in uv / area in the world); 1 without area."""
    corner = (mesh.position.astype(np.float64) @ instance.world_from_object[:3, :3].T)[mesh.triangle]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    area = 0.5 * float(np.linalg.norm(cross, axis=1).sum())
    return float(np.sqrt(uv_area(uv[mesh.triangle]).sum() / area)) if area > 0 else 1.0
