"""Estimates the duration of each stage of a bake before the scene is read, for the progress bar."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from baker.channels.channel import Channel, chosen_channels
from baker.checks.bake_rates import Rates, rates_beside
from baker.core.budget import Workload, texels_and_pages
from baker.core.parallel import thread_count
from baker.core.settings import BakeSettings
from baker.core.stage import Stage

# Seconds times threads per ray, where the number of rays is the estimate of `Workload.rays`. These rates are
# used for stages whose speed in an earlier bake is unknown. They were measured on interior.glb with 1024
# texels a side, see docs/PERFORMANCE.md.
_RAY_SECONDS: Mapping[Stage, float] = {
    Stage.INSIDE_GEOMETRY: 3.2e-7,
    Stage.DIRECT_LIGHT: 1.2e-7,
    Stage.FORM_FACTORS: 1.3e-6,
    Stage.FINAL_GATHER: 1.7e-7,
    Stage.AMBIENT_OCCLUSION: 1.7e-7,
}
# Seconds times threads per texel, for three stages, for the stage `FINISH` without the denoiser, and for the
# denoiser.
_TEXEL_SECONDS: Mapping[Stage, float] = {Stage.TEXELS: 1.5e-6, Stage.TEXEL_SIDES: 6e-7, Stage.WRITE: 2e-6}
_FINISH_SECONDS, _DENOISE_SECONDS = 5e-6, 1e-5
# Assumed seconds of stages whose duration depends on the scene, because the scene is not read yet.
_SCENE_SECONDS: Mapping[Stage, float] = {
    Stage.LOAD: 0.1, Stage.UNWRAP: 1.0, Stage.RAY_TREE: 0.05, Stage.SOLVE: 0.2
}  # fmt: skip
# Assumed number of texels on surfaces if `density` is set, divided by the number of texels of a page.
_ASSUMED_PAGES = 1.0


def stage_seconds(settings: BakeSettings, scene: Path) -> dict[str, float]:
    """Estimate the duration of each stage of a bake.

    Parameters
    ----------
    settings : BakeSettings
        Settings of the bake.
    scene : Path
        The scene file. If there is a bake of this file in a folder beside it, the estimate uses the rays per
        second of that bake, and its seconds per texel for the stages `BY_TEXEL` of `checks.bake_rates`.

    Returns
    -------
    dict of str to float
        Seconds by name of the stage, in the order in which the stages run. The ratios between stages are
        more accurate than the seconds.
    """
    channels = chosen_channels(settings.channels)
    threads = thread_count(settings.threads)
    workload = _workload(settings, channels)
    rays = workload.rays(settings, delta_lights=1, emitters=True)
    rates = rates_beside(scene)
    seconds = dict(_SCENE_SECONDS)
    for stage, count in rays.items():
        seconds[stage] = count * _seconds_per_ray(stage, rates, threads)
    for stage, each in _TEXEL_SECONDS.items():
        seconds[stage] = workload.texels * each / threads
    finish = _FINISH_SECONDS + _DENOISE_SECONDS * settings.denoise
    seconds[Stage.FINISH] = workload.texels * finish / threads
    known = {} if rates is None else rates.texel
    seconds |= {stage: workload.texels * each for stage, each in known.items() if stage in seconds}
    return {stage: seconds[stage] for stage in Stage if stage in seconds}


def _seconds_per_ray(stage: Stage, rates: Rates | None, threads: int) -> float:
    """Return the seconds per ray of a stage in the earlier bake `rates`, or the default if it is unknown."""
    default = _RAY_SECONDS[stage] / threads
    return default if rates is None else rates.ray.get(stage, default)


def _workload(settings: BakeSettings, channels: Mapping[str, Channel]) -> Workload:
    """Return the estimated size of a bake whose scene is not read yet."""
    area = 0.0 if settings.density is None else _ASSUMED_PAGES * (settings.resolution / settings.density) ** 2
    texels, pages = texels_and_pages(settings, area)
    return Workload(
        texels=texels,
        pages=pages,
        triangles=0,
        image_bytes=(0, 0),
        light=any(channel.needs_light for channel in channels.values()),
        ambient_occlusion=any(channel.needs_ambient_occlusion for channel in channels.values()),
    )
