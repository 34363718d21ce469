"""Light transport of all texels: direct light, radiosity, final gather, ambient occlusion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.channels.channel import Channel, Transport
from baker.core.executor import LocalTileExecutor, TileExecutor
from baker.core.parallel import TileRunner, thread_count
from baker.core.progress import Progress
from baker.core.scene import Scene, SceneWarning
from baker.core.settings import BakeSettings
from baker.pipeline.record import Record
from baker.pipeline.world import World
from baker.radiosity.direct import DirectLight, direct_light
from baker.radiosity.final_gather import Gathered, ambient_occlusion, final_gather
from baker.radiosity.form_factors import build_form_factors
from baker.radiosity.kernels.side_table import SeenLight
from baker.radiosity.narrow_gaps import gap_depth
from baker.radiosity.patches import NARROW, build_patches
from baker.radiosity.solve import energy_audit, solve_radiosity
from baker.radiosity.trapped_light import light_warnings

# Rays from each patch for its form factors, by hemisphere samples per texel.
MIN_PATCH_RAYS, MAX_PATCH_RAYS = 128, 512


def trace_transport(
    scene: Scene,
    world: World,
    channels: dict[str, Channel],
    settings: BakeSettings,
    record: Record,
    executor: TileExecutor | None = None,
) -> Transport:
    """Cast the rays of all stages that the channels need."""
    executor = executor or LocalTileExecutor()
    transport = Transport()
    n_samples = settings.hemisphere_samples
    ao_samples = settings.ao_samples or n_samples
    if any(channel.needs_light for channel in channels.values()):
        transport = _light(scene, world, settings, record, executor)
    if any(channel.needs_open for channel in channels.values()):
        share = transport.gathered
        if share is not None and ao_samples == n_samples:
            return replace(transport, open=share.open, ao_samples=ao_samples)
        with record.stage("ambient occlusion"):
            run = executor.runner("ambient occlusion", {"inside": world.inside})
            opened = open_sky(world, settings, record.progress, run)
            record.rays["ambient occlusion"] = world.texels.n_front * ao_samples
        transport = replace(transport, open=opened, ao_samples=ao_samples)
    return transport


def _light(
    scene: Scene, world: World, settings: BakeSettings, record: Record, executor: TileExecutor
) -> Transport:
    """Direct light, radiosity and final gather."""
    texels, sky = world.texels, np.array(settings.sky_radiance)
    if not scene.lights and not len(world.emitters.power) and not sky.any():
        record.warnings.append(
            SceneWarning("no-light", "nothing emits light: the irradiance is black; add a light or use `sky`")
        )
    with record.stage("direct light"):
        run = executor.runner("direct light", {"inside": world.inside})
        direct = light_directly(scene, world, settings, record.progress, run)
        record.rays["direct light"] = direct.rays
    with record.stage("form factors"):
        depth, cast = gap_depth(
            texels,
            world.surface,
            world.mask,
            world.rays.tracer,
            seed=settings.seed,
            threads=thread_count(settings.threads),
            progress=record.progress,
            kept=world.kept,
        )
        record.rays["form factors"] = cast
    exitance = np.zeros((texels.n, 4), np.float32)
    if settings.bounces != 0:
        exitance[:, :3] = _reflected(world, direct.complete, depth, settings, record, executor)
    # It has done its part.
    direct = replace(direct, complete=np.zeros((0, 3), np.float32))
    with record.stage("final gather"):
        run = executor.runner(
            "final gather", {"inside": world.inside, "exitance": exitance, "exact": direct.exact}
        )
        seen = world.sides.seen_light(exitance)
        del exitance
        gathered = gather_light(world, (seen, direct.exact), settings, record.progress, run)
        record.rays["final gather"] = gathered.rays
    return Transport(direct=direct, gathered=gathered, gap=depth[: texels.n_front] >= NARROW)


def light_directly(
    scene: Scene, world: World, settings: BakeSettings, progress: Progress, run: TileRunner
) -> DirectLight:
    """Direct light of all texels, or of the tiles that `run` works on."""
    return direct_light(
        world.surface,
        world.mask,
        world.table,
        scene.local_lights,
        world.emitters,
        world.shading,
        world.rays.tracer,
        n_light=settings.light_samples or settings.hemisphere_samples,
        n_gather=settings.hemisphere_samples,
        seed=settings.seed,
        threads=thread_count(settings.threads),
        progress=progress,
        chart=world.texels.chart,
        kept=world.kept,
        run=run,
    )


def gather_light(
    world: World,
    found: tuple[SeenLight, NDArray[np.uint8]],
    settings: BakeSettings,
    progress: Progress,
    run: TileRunner,
) -> Gathered:
    """Final gather of all texels, or of the tiles that `run` works on.

    `found` is what hits send back, and which entries have all light of emitters.
    """
    return final_gather(
        world.texels.n_front,
        world.surface,
        world.mask,
        world.table,
        *found,
        world.emitters,
        world.shading,
        world.rays.tracer,
        n_samples=settings.hemisphere_samples,
        n_light=settings.light_samples or settings.hemisphere_samples,
        sky=settings.sky_radiance,
        ao_distance=settings.ao_reach(world.geometry.diagonal),
        seed=settings.seed,
        threads=thread_count(settings.threads),
        progress=progress,
        chart=world.texels.chart,
        kept=world.kept,
        run=run,
    )


def open_sky(
    world: World, settings: BakeSettings, progress: Progress, run: TileRunner
) -> NDArray[np.float32]:
    """Ambient occlusion of all texels, or of the tiles that `run` works on."""
    return ambient_occlusion(
        world.texels.n_front,
        world.surface,
        world.mask,
        world.rays.tracer,
        n_samples=settings.ao_samples or settings.hemisphere_samples,
        distance=settings.ao_reach(world.geometry.diagonal),
        seed=settings.seed,
        threads=thread_count(settings.threads),
        progress=progress,
        kept=world.kept,
        run=run,
    )


def patch_rays(settings: BakeSettings) -> int:
    """Count the rays from each patch for its form factors."""
    return min(max(settings.hemisphere_samples, MIN_PATCH_RAYS), MAX_PATCH_RAYS)


def _reflected(
    world: World,
    complete: NDArray[np.float32],
    depth: NDArray[np.uint8],
    settings: BakeSettings,
    record: Record,
    executor: TileExecutor,
) -> NDArray[np.float32]:
    """Return (n, 3) float32, lx: light that each texel reflects, after all bounces but the gather's own.

    depth : (n,) uint8, of each entry in gaps, see `gap_depth`
    """
    texels = world.texels
    sky: NDArray[np.float64] = np.array(settings.sky_radiance, np.float64)
    with record.stage("form factors"):
        patches = build_patches(texels, depth, link=world.sides.link)
        matrix = build_form_factors(
            patches,
            world.sides.seen_patches(patches.patch),
            world.surface,
            world.mask,
            world.table,
            world.rays.tracer,
            n_rays=patch_rays(settings),
            seed=settings.seed,
            threads=thread_count(settings.threads),
            progress=record.progress,
            kept=world.kept,
            run=executor.runner("form factors", {"inside": world.inside, "depth": depth}),
        )
        record.rays["form factors"] += matrix.rays
    with record.stage("solve"):
        weight = np.maximum(texels.area, 1e-12)
        albedo = patches.mean(texels.albedo, weight)
        from_sky = np.pi * matrix.open * sky
        direct = patches.mean(complete, weight) + from_sky
        # Direct light meets the albedo of its own texel; the sky's share is known per patch.
        source = patches.mean(texels.albedo * complete, weight) + albedo * from_sky
        solution = solve_radiosity(
            matrix,
            source,
            albedo,
            patches.area,
            bounces=settings.bounces,
            progress=record.progress,
            threads=thread_count(settings.threads),
        )
        record.solve.update(
            patches=patches.n,
            nonzeros=len(matrix.value),
            **solution.figures(),
            energy=energy_audit(matrix, patches.area, direct, source, solution.irradiance, albedo),
            row_error=matrix.row_error,
            reciprocity_error=matrix.reciprocity_error,
        )
        record.warnings.extend(light_warnings(solution, matrix, albedo, patches.area, settings.bounces))
        indirect = (solution.irradiance + from_sky).astype(np.float32)
    return texels.albedo * (complete + indirect[patches.patch])
