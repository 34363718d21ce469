"""Computes the light transport of all texels: direct light, radiosity, final gather, ambient occlusion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.channels.channel import Channel, Transport
from baker.core.budget import patch_rays
from baker.core.executor import LocalTileExecutor, TileExecutor
from baker.core.parallel import TileRunner
from baker.core.stage import Stage
from baker.pipeline.prepare import PreparedScene
from baker.pipeline.record import Record
from baker.radiosity.direct import DirectLight, direct_light
from baker.radiosity.final_gather import Gathered, ambient_occlusion, final_gather
from baker.radiosity.form_factors import build_form_factors
from baker.radiosity.kernels.side_table import SeenLight
from baker.radiosity.narrow_gaps import gap_level
from baker.radiosity.patches import NARROW, build_patches
from baker.radiosity.sample_parts import SamplePart
from baker.radiosity.solve import energy_audit, solve_radiosity
from baker.radiosity.trapped_light import light_warnings

# Returns the runner of the tiles of a part of the entries.
PartRunner = Callable[[SamplePart], TileRunner]


def trace_transport(
    prepared: PreparedScene,
    channels: Mapping[str, Channel],
    record: Record,
    executor: TileExecutor | None = None,
) -> Transport:
    """Run all ray stages that the channels need.

    Parameters
    ----------
    prepared : PreparedScene
        The scene and the settings of the bake.
    channels : mapping of str to Channel
        Channels to bake, by name.
    record : Record
        Receives timings, ray counts, statistics of the solve, and warnings.
    executor : TileExecutor, optional
        Runs the tiles; by default, they run in this process.

    Returns
    -------
    Transport
        Values of the front texels. Quantities that no channel needs are None.
    """
    executor = executor or LocalTileExecutor()
    transport = Transport()
    n_samples = prepared.settings.hemisphere_samples
    ao_samples = prepared.settings.ao_samples or n_samples
    if any(channel.needs_light for channel in channels.values()):
        transport = _light(prepared, record, executor)
    if any(channel.needs_ambient_occlusion for channel in channels.values()):
        gathered = transport.gathered
        rays = _ao_rays(prepared, ao_samples)
        if gathered is not None and ao_samples == n_samples and prepared.occluders is None:
            return replace(transport, ambient_occlusion=gathered.open, ao_samples=rays)
        with record.stage(Stage.AMBIENT_OCCLUSION):
            runs = _runs(executor, Stage.AMBIENT_OCCLUSION, {"outside": prepared.outside})
            opened = trace_ambient_occlusion(prepared, runs)
            record.rays[Stage.AMBIENT_OCCLUSION] = int(rays.sum())
        transport = replace(transport, ambient_occlusion=opened, ao_samples=rays)
    return transport


def _runs(executor: TileExecutor, stage: Stage, arrays: Mapping[str, NDArray[Any]]) -> PartRunner:
    """Return the runner of each part of a stage. Only workers of a cluster read the number of the part."""

    def runner(part: SamplePart) -> TileRunner:
        number = {"part": np.array(part.number)} if part.entry is not None else {}
        return executor.runner(stage, {**arrays, **number})

    return runner


def _ao_rays(prepared: PreparedScene, ao_samples: int) -> NDArray[np.int32]:
    """Return (n_front,) int32: the number of AO rays of each front texel."""
    rays = np.zeros(prepared.texels.n_front, np.int32)
    for part in prepared.parts:
        rays[part.front_rows] = part.rays(ao_samples)
    return rays


def _light(prepared: PreparedScene, record: Record, executor: TileExecutor) -> Transport:
    """Return the result of direct light, radiosity and final gather."""
    texels = prepared.texels
    with record.stage(Stage.DIRECT_LIGHT):
        direct = trace_direct_light(
            prepared, _runs(executor, Stage.DIRECT_LIGHT, {"outside": prepared.outside})
        )
        record.rays[Stage.DIRECT_LIGHT] = direct.rays
    with record.stage(Stage.FORM_FACTORS):
        level, cast = gap_level(texels, prepared.job)
        record.rays[Stage.FORM_FACTORS] = cast
    exitance = np.zeros((texels.n, 4), np.float32)
    if prepared.settings.bounces != 0:
        exitance[:, :3] = _reflected(prepared, direct.complete, level, record, executor)
    # Free the direct light of all entries, because the code below does not use it.
    direct = replace(direct, complete=np.zeros((0, 3), np.float32))
    with record.stage(Stage.FINAL_GATHER):
        runs = _runs(
            executor,
            Stage.FINAL_GATHER,
            {"outside": prepared.outside, "exitance": exitance, "analytic": direct.analytic},
        )
        seen = prepared.sides.seen_light(exitance)
        del exitance
        gathered = trace_final_gather(prepared, seen, direct.analytic, runs)
        record.rays[Stage.FINAL_GATHER] = gathered.rays
    return Transport(direct=direct, gathered=gathered, gap=level[: texels.n_front] >= NARROW)


def trace_direct_light(prepared: PreparedScene, runs: PartRunner) -> DirectLight:
    """Return the direct light of all texels.

    Parameters
    ----------
    prepared : PreparedScene
        The scene and the settings of the bake.
    runs : PartRunner
        Returns the runner of the tiles of a part. Results of tiles that it skips stay 0.

    Returns
    -------
    DirectLight
        Direct light of all n entries.
    """
    found = [
        direct_light(
            part.job(prepared.job).on(runs(part)),
            prepared.scene.local_lights,
            part.sampling(prepared.sampling),
        )
        for part in prepared.parts
    ]
    if len(found) == 1:
        return found[0]
    whole = DirectLight.zeros(prepared.texels.n, sum(one.rays for one in found))
    for part, one in zip(prepared.parts, found, strict=True):
        for name in ("weighted", "complete", "variance", "analytic"):
            getattr(whole, name)[part.rows] = getattr(one, name)
    return whole


def trace_final_gather(
    prepared: PreparedScene, seen: SeenLight, analytic: NDArray[np.uint8], runs: PartRunner
) -> Gathered:
    """Return the gathered light and ambient occlusion of the front texels.

    Parameters
    ----------
    prepared : PreparedScene
        The scene and the settings of the bake.
    seen : SeenLight
        Light that entries reflect, in a table that gather rays look up.
    analytic : (n,) uint8
        1 for entries whose light from emitters is complete, so that the gather must not add it.
    runs : PartRunner
        Returns the runner of the tiles of a part. Results of tiles that it skips stay 0.

    Returns
    -------
    Gathered
        Light and ambient occlusion of all front texels.
    """
    settings = prepared.settings
    found = [
        final_gather(
            part.job(prepared.job).on(runs(part)),
            part.n_front,
            seen,
            analytic[part.rows],
            part.sampling(prepared.sampling),
            sky=settings.sky_radiance,
            ao_distance=settings.ao_reach(prepared.geometry.diagonal),
        )
        for part in prepared.parts
    ]
    if len(found) == 1:
        return found[0]
    whole = replace(Gathered.zeros(prepared.texels.n_front), rays=sum(one.rays for one in found))
    for part, one in zip(prepared.parts, found, strict=True):
        for name in ("indirect", "direct", "open", "variance"):
            getattr(whole, name)[part.front_rows] = getattr(one, name)
    return whole


def trace_ambient_occlusion(prepared: PreparedScene, runs: PartRunner) -> NDArray[np.float32]:
    """Return the ambient occlusion of the front texels, computed with separate rays.

    Parameters
    ----------
    prepared : PreparedScene
        The scene and the settings of the bake.
    runs : PartRunner
        Returns the runner of the tiles of a part. Results of tiles that it skips stay 0.

    Returns
    -------
    (n_front,) float32
        Ambient occlusion from 0, fully occluded, to 1, unoccluded.
    """
    settings, job = prepared.settings, prepared.job
    if prepared.occluders is not None:
        job = replace(job, tracer=prepared.occluders.tracer)
    whole = np.zeros(prepared.texels.n_front, np.float32)
    for part in prepared.parts:
        whole[part.front_rows] = ambient_occlusion(
            part.job(job).on(runs(part)),
            part.n_front,
            n_samples=part.rays(settings.ao_samples or settings.hemisphere_samples),
            distance=settings.ao_reach(prepared.geometry.diagonal),
        )
    return whole


def _reflected(
    prepared: PreparedScene,
    complete: NDArray[np.float32],
    level: NDArray[np.uint8],
    record: Record,
    executor: TileExecutor,
) -> NDArray[np.float32]:
    """Return (n, 3) float32, lx: the reflected radiosity of each entry, which the final gather then reads.

    complete : (n, 3) float32, lx, direct light of each entry
    level : (n,) uint8, how narrow the gap at each entry is, see `baker.radiosity.narrow_gaps.gap_level`
    """
    texels, settings = prepared.texels, prepared.settings
    sky: NDArray[np.float64] = np.array(settings.sky_radiance, np.float64)
    with record.stage(Stage.FORM_FACTORS):
        patches = build_patches(texels, level, link=prepared.sides.link)
        seen = prepared.sides.seen_patches(patches.patch)
        run = executor.runner(Stage.FORM_FACTORS, {"outside": prepared.outside, "level": level})
        matrix = build_form_factors(patches, seen, prepared.job.on(run), n_rays=patch_rays(settings))
        record.rays[Stage.FORM_FACTORS] += matrix.rays
    with record.stage(Stage.SOLVE):
        weight = np.maximum(texels.area, 1e-12)
        albedo = patches.mean(texels.albedo, weight)
        from_sky = np.pi * matrix.open * sky
        direct = patches.mean(complete, weight) + from_sky
        # Multiply direct light by the albedo of each texel. Multiply light of the sky by the mean albedo of
        # the patch, because it is known per patch only.
        source = patches.mean(texels.albedo * complete, weight) + albedo * from_sky
        solution = solve_radiosity(
            matrix,
            source,
            albedo,
            patches.area,
            bounces=settings.bounces,
            progress=record.progress,
            threads=prepared.job.threads,
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
