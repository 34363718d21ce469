"""The stages of a bake, in order; the only place that wires them together.

scene -> atlas -> texels -> buried points -> direct light -> patches -> form factors -> solve
-> final gather -> finished pages -> output folder
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker import warm
from baker.channels.channel import CHANNELS, Channel, Transport
from baker.core.atlas import Atlas
from baker.core.errors import ResourceError, SettingsError
from baker.core.export import check_exports
from baker.core.farm import Farm, LocalFarm
from baker.core.lightmap import BakeResult, Lightmap, TexelStatus
from baker.core.parallel import TileRunner, thread_count
from baker.core.precision import coarse_warnings
from baker.core.progress import Progress, silent
from baker.core.scene import Scene, SceneWarning, check_brightness
from baker.core.settings import BakeSettings
from baker.core.texels import TexelBuffer
from baker.finish.finish import PageLayer, PagePlan, finish_page
from baker.finish.oidn import LightmapDenoiser
from baker.io.load import load_for_bake
from baker.kernels.side_table import SeenLight
from baker.lint.in_bake import bake_warnings
from baker.radiosity.crevices import gap_depth
from baker.radiosity.direct import DirectLight, direct_light
from baker.radiosity.final_gather import Gathered, ambient_occlusion, final_gather
from baker.radiosity.form_factors import build_form_factors
from baker.radiosity.patches import NARROW, build_patches
from baker.radiosity.solve import energy_audit, solve_radiosity
from baker.radiosity.trapped import light_warnings
from baker.unwrap.unwrap import unwrap_scene
from baker.world import Record, World, prepare

# Rays from each patch for its form factors, by hemisphere samples per texel.
MIN_PATCH_RAYS, MAX_PATCH_RAYS = 128, 512
# A texel counts as not converged if its standard error before denoising exceeds this share of its value.
UNCONVERGED = 0.25


def bake(
    scene: Scene | str | Path,
    *,
    settings: BakeSettings,
    out: Path | str | None = None,
    progress: Progress = silent,
    force: bool = False,
    farm: Farm | None = None,
) -> BakeResult:
    """Bake a scene: lightmap uv, light transport, finished maps, and the output folder if asked for.

    Parameters
    ----------
    scene : Scene or path
    settings : BakeSettings
    out : path, optional
        Folder to write; None keeps everything in memory.
    progress : Progress
    force : bool
        Replace an `out` that baker did not write.
    farm : Farm, optional
        Works on the tiles of the ray stages; None is this process.

    Raises
    ------
    InputError, SettingsError, ResourceError, Cancelled
    """
    channels = _channels(settings)
    folder = None if out is None else Path(out)
    if folder is not None:
        from baker.io.output import check_encodings, check_out

        check_encodings(settings.encode, {name: c.components for name, c in channels.items()})
        check_exports(settings.export, settings.channels)
        check_out(folder, force=force, scene_path=scene.path if isinstance(scene, Scene) else Path(scene))
    record, farm = Record(progress), farm or LocalFarm()
    compiling = warm.start()
    try:
        with record.stage("load"):
            if isinstance(scene, Scene):
                check_brightness(scene)
            else:
                scene = load_for_bake(scene, settings)
        compiling = warm.suit(compiling, scene)
        record.warnings.extend([*scene.warnings, *bake_warnings(scene, settings), *warm.cache_warnings()])
        with record.stage("unwrap"):
            atlas = unwrap_scene(scene, settings, progress)
        record.warnings.extend([*atlas.warnings, *coarse_warnings(scene, atlas)])
        farm.open(scene, atlas, settings)
        world = prepare(scene, atlas, settings, record)
        if any(channel.needs_light for channel in channels.values()):
            warm.wait_for_rays(compiling, progress)
        transport = trace_transport(scene, world, channels, settings, record, farm)
        world.rays.close()
        farm.close()
        # Finishing needs where texels are, not what they are made of: a gigabyte at 4096 texels a side.
        texels, good = world.texels.without_surface(), world.mask[: world.texels.n_front] != 0
        del world
        warm.finish(compiling, progress)
        result = _finish(scene, atlas, texels, good, transport, channels, settings, record)
        if folder is not None:
            from baker.io.output import write_bake

            with record.stage("write"):
                manifest = write_bake(result, folder, force=force, progress=progress)
            result = replace(result, out=folder, manifest=manifest)
    except MemoryError:
        raise ResourceError(
            "memory ran out; lower --resolution or --samples, or bake fewer objects"
        ) from None
    return result


def _channels(settings: BakeSettings) -> dict[str, Channel]:
    """Look up the channels asked for, in the order asked."""
    found: dict[str, Channel] = {}
    for name in settings.channels:
        channel = CHANNELS.get(name)
        if channel is None:
            raise SettingsError(f"there is no channel '{name}'; known are {', '.join(CHANNELS.names())}")
        found[name] = channel
    return found


def trace_transport(
    scene: Scene,
    world: World,
    channels: dict[str, Channel],
    settings: BakeSettings,
    record: Record,
    farm: Farm | None = None,
) -> Transport:
    """Cast the rays of all stages that the channels need."""
    farm = farm or LocalFarm()
    transport = Transport()
    n_samples = settings.hemisphere_samples
    ao_samples = settings.ao_samples or n_samples
    if any(channel.needs_light for channel in channels.values()):
        transport = _light(scene, world, settings, record, farm)
    if any(channel.needs_open for channel in channels.values()):
        share = transport.gathered
        if share is not None and ao_samples == n_samples:
            return replace(transport, open=share.open, ao_samples=ao_samples)
        with record.stage("ambient occlusion"):
            run = farm.runner("ambient occlusion", {"inside": world.inside})
            opened = open_sky(world, settings, record.progress, run)
            record.rays["ambient occlusion"] = world.texels.n_front * ao_samples
        transport = replace(transport, open=opened, ao_samples=ao_samples)
    return transport


def _light(scene: Scene, world: World, settings: BakeSettings, record: Record, farm: Farm) -> Transport:
    """Direct light, radiosity and final gather."""
    texels, sky = world.texels, np.array(settings.sky_radiance)
    if not scene.lights and not len(world.emitters.power) and not sky.any():
        record.warnings.append(
            SceneWarning("no-light", "nothing emits light: the irradiance is black; add a light or use --sky")
        )
    with record.stage("direct light"):
        run = farm.runner("direct light", {"inside": world.inside})
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
        exitance[:, :3] = _reflected(world, direct.complete, depth, settings, record, farm)
    # It has done its part.
    direct = replace(direct, complete=np.zeros((0, 3), np.float32))
    with record.stage("final gather"):
        run = farm.runner(
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
    farm: Farm,
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
            run=farm.runner("form factors", {"inside": world.inside, "depth": depth}),
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


def _finish(
    scene: Scene,
    atlas: Atlas,
    texels: TexelBuffer,
    good: NDArray[np.bool_],
    transport: Transport,
    channels: dict[str, Channel],
    settings: BakeSettings,
    record: Record,
) -> BakeResult:
    """Turn texel values into finished pages and gather what is to be told about them.

    good : (n_front,) bool, texels that are not buried
    """
    n_front = texels.n_front
    chart = texels.page_image(texels.chart[:n_front], fill=-1)
    region = texels.page_image(texels.region, fill=-1)
    valid = texels.page_image(good, fill=False)
    centroid = texels.page_image(texels.centroid)
    status = np.where(chart >= 0, np.uint8(TexelStatus.COVERED), np.uint8(TexelStatus.EMPTY))
    noisy = np.zeros(n_front, bool)
    lightmaps: dict[str, Lightmap] = {}
    statistics: dict[str, dict[str, Any]] = {}
    shape = (atlas.n_pages, atlas.resolution, atlas.resolution)
    layers = {name: channel.layers(transport) for name, channel in channels.items()}
    value = {name: np.zeros((*shape, channel.components), np.float32) for name, channel in channels.items()}
    threads = thread_count(settings.threads)
    with record.stage("finish"), LightmapDenoiser(threads) as lightmap_denoiser:
        for page in range(atlas.n_pages):
            plan = PagePlan(region[page], valid[page], centroid[page])
            for name, channel in channels.items():
                images = [
                    PageLayer(
                        texels.page_image(part.value, page=page),
                        texels.page_image(part.error, page=page),
                        part.bound,
                        None if part.kept is None else texels.page_image(part.kept, fill=False, page=page),
                    )
                    for part in layers[name]
                ]
                value[name][page], grown = finish_page(
                    plan,
                    images,
                    upper=channel.upper,
                    denoiser=lightmap_denoiser if settings.denoise else None,
                    dilation=max(2 * settings.padding, 8),
                    threads=threads,
                    progress=record.progress,
                )
                status[page][grown] = TexelStatus.DILATED
        for name, channel in channels.items():
            noisy |= _unconverged(layers[name], texels.chart[:n_front])
            lightmaps[name] = Lightmap(name, channel.unit, value[name])
            statistics[name] = _statistics(value[name][chart >= 0], int((~good).sum()))
    flat = status.reshape(-1)
    flat[texels.pixel[:n_front][noisy & good]] = TexelStatus.UNCONVERGED
    flat[texels.pixel[:n_front][~good]] = TexelStatus.INVALID
    denoiser: dict[str, Any] = {}
    if settings.denoise:
        from baker.finish.denoise import denoiser_name

        denoiser = denoiser_name()
    return BakeResult(
        scene=scene,
        atlas=atlas,
        settings=settings,
        lightmaps=lightmaps,
        status=status,
        texel_count=np.bincount(texels.instance[:n_front], minlength=len(scene.instances)).astype(np.int64),
        statistics=statistics,
        timings=record.timings,
        rays=record.rays,
        solve=record.solve,
        denoise=denoiser,
        warnings=tuple(record.warnings),
    )


def _unconverged(layers: tuple[Any, ...], chart: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return the texels whose summed standard error exceeds a share of their value.

    Dark ones count as a twentieth of the geometric mean of their `chart`, (n_front,) int32.
    """
    value = sum(layer.value.mean(axis=1) for layer in layers)
    error = np.sqrt(sum(np.square(layer.error) for layer in layers))
    lit = value > 0
    count = np.maximum(np.bincount(chart[lit], minlength=1), 1)
    middle = np.exp(np.bincount(chart[lit], np.log(value[lit]), len(count)) / count)
    floor = 0.05 * np.append(middle, 0.0)[np.minimum(chart, len(middle))]
    noisy: NDArray[np.bool_] = error > UNCONVERGED * np.maximum(value, floor)
    noisy &= lit
    return noisy


def _statistics(value: NDArray[np.float32], invalid: int) -> dict[str, Any]:
    """Return the figures of one channel over its covered texels (n, C)."""
    if not value.size:
        return {"min": 0.0, "max": 0.0, "mean": 0.0, "clipped": 0, "invalid": invalid}
    return {
        "min": float(value.min()),
        "max": float(value.max()),
        "mean": float(value.mean(dtype=np.float64)),
        "clipped": int((value > 65504.0).any(axis=-1).sum()),
        "invalid": invalid,
    }
