"""Finished pages from the values of texels, with the status and the statistics of each map."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.channels.channel import Channel, Transport
from baker.core.atlas import Atlas
from baker.core.lightmap import BakeResult, Lightmap, TexelStatus
from baker.core.parallel import thread_count
from baker.core.scene import Scene
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.core.texels import TexelBuffer
from baker.finish.finish import PageLayer, PagePlan, finish_page
from baker.finish.oidn import LightmapDenoiser
from baker.pipeline.record import Record

# A texel counts as not converged if its standard error before denoising exceeds this share of its value.
UNCONVERGED = 0.25


def finish_pages(
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
    with record.stage(Stage.FINISH), LightmapDenoiser(threads) as lightmap_denoiser:
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
