"""Turns texel values into finished pages, and computes the status of texels and the statistics of maps."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.channels.channel import Channel, Layer, make_lightmap
from baker.core.atlas import Atlas
from baker.core.lightmap import BakeResult, TexelStatus
from baker.core.parallel import thread_count
from baker.core.progress import Progress, report
from baker.core.readable import number
from baker.core.scene import Scene, SceneWarning
from baker.core.settings import BakeSettings
from baker.core.stage import Stage
from baker.core.texels import TexelBuffer
from baker.finish.finish import (
    ComponentRules,
    PageLayer,
    PagePlan,
    finish_page,
    open_finisher,
)
from baker.finish.oidn import denoiser_name
from baker.pipeline.exposure import suggested_exposure
from baker.pipeline.record import Record

# Relative standard error before denoising above which a texel gets the status UNCONVERGED.
UNCONVERGED = 0.25
# Share of the texels with that status above which there is a warning.
UNCONVERGED_SHARE = 0.01


class TracedTexels(NamedTuple):
    """Result of the ray stages.

    texels : TexelBuffer
    valid : (n_front,) bool, whether a front texel has a valid point
    albedo : (n_front, 3) float16, linear Rec.709
    layers : mapping of str to tuple of Layer, the layers of each channel for the front texels
    """

    texels: TexelBuffer
    valid: NDArray[np.bool_]
    albedo: NDArray[np.float16]
    layers: Mapping[str, tuple[Layer, ...]]


def finish_pages(
    scene: Scene,
    atlas: Atlas,
    traced: TracedTexels,
    channels: Mapping[str, Channel],
    settings: BakeSettings,
    record: Record,
) -> BakeResult:
    """Turn texel values into finished pages, with status and statistics.

    Parameters
    ----------
    scene : Scene
        The baked scene.
    atlas : Atlas
        The lightmap uv of the scene.
    traced : TracedTexels
        Texels and their values.
    channels : mapping of str to Channel
        Channels to bake, by name.
    settings : BakeSettings
        Settings of the bake.
    record : Record
        Timings, ray counts and warnings, which are copied to the result.

    Returns
    -------
    BakeResult
        The result in memory; no file is written.
    """
    texels, valid = traced.texels, traced.valid
    n_front = texels.n_front
    chart = texels.page_image(texels.chart[:n_front], fill=-1)
    status = np.where(chart >= 0, np.uint8(TexelStatus.COVERED), np.uint8(TexelStatus.EMPTY))
    layers = traced.layers
    with record.stage(Stage.FINISH):
        value = _finished(traced, channels, settings, record.progress, status)
        noisy = np.zeros(n_front, bool)
        for name, channel in channels.items():
            noisy |= _unconverged(layers[name], texels.chart[:n_front], channel.signed)
        invalid = int((~valid).sum())
        statistics = {name: _statistics(value[name][chart >= 0], invalid) for name in channels}
    flat = status.reshape(-1)
    flat[texels.pixel[:n_front][noisy & valid]] = TexelStatus.UNCONVERGED
    flat[texels.pixel[:n_front][~valid]] = TexelStatus.INVALID
    record.warnings.extend(convergence_warnings(status))
    return BakeResult(
        scene=scene,
        atlas=atlas,
        settings=settings,
        lightmaps={name: make_lightmap(name, value[name]) for name in channels},
        status=status,
        texel_count=np.bincount(texels.instance[:n_front], minlength=len(scene.instances)).astype(np.int64),
        statistics=statistics,
        suggested_exposure=_exposure(traced, value),
        timings=record.timings,
        rays=record.rays,
        solve=record.solve,
        denoise=denoiser_name() if settings.denoise else {},
        warnings=tuple(record.warnings),
    )


def _exposure(traced: TracedTexels, value: Mapping[str, NDArray[np.float32]]) -> float | None:
    """Return the suggested exposure, or None if irradiance is not baked."""
    if "irradiance" not in value:
        return None
    pixel = traced.texels.pixel[: traced.texels.n_front]
    return suggested_exposure(value["irradiance"], pixel[traced.valid], traced.albedo[traced.valid])


def convergence_warnings(status: NDArray[np.uint8]) -> list[SceneWarning]:
    """Return a warning if many texels did not converge.

    Parameters
    ----------
    status : (n_pages, H, W) uint8
        `TexelStatus` of each texel.

    Returns
    -------
    list of SceneWarning
        Empty if at most `UNCONVERGED_SHARE` of the texels on charts have the status UNCONVERGED.
    """
    count = np.bincount(status.ravel(), minlength=len(TexelStatus))
    noisy = int(count[TexelStatus.UNCONVERGED])
    surface = noisy + int(count[TexelStatus.COVERED]) + int(count[TexelStatus.INVALID])
    if noisy <= UNCONVERGED_SHARE * surface:
        return []
    message = (
        f"{number(100 * noisy / surface)} % of the texels did not converge: their standard error before"
        f" denoising is above {100 * UNCONVERGED:.0f} % of their value; look for blotches there (key 5 in the"
        " viewer shows these texels), and raise `quality` if you see any"
    )
    return [SceneWarning("not-converged", message)]


def _finished(
    traced: TracedTexels,
    channels: Mapping[str, Channel],
    settings: BakeSettings,
    progress: Progress,
    status: NDArray[np.uint8],
) -> dict[str, NDArray[np.float32]]:
    """Return the pages (n_pages, H, W, C) float32 of each channel.

    status : (n_pages, H, W) uint8, set to DILATED at dilated texels
    """
    texels = traced.texels
    region = texels.page_image(texels.region, fill=-1)
    valid = texels.page_image(traced.valid, fill=False)
    centroid = texels.page_image(texels.centroid)
    value = {
        name: np.zeros((*status.shape, len(channel.components)), np.float32)
        for name, channel in channels.items()
    }
    with open_finisher(
        threads=thread_count(settings.threads),
        dilation=max(2 * settings.padding, 8),
        denoise=settings.denoise,
        progress=progress,
    ) as finisher:
        done, steps = 0, len(status) * len(channels)
        for page in range(len(status)):
            plan = PagePlan(region[page], valid[page], centroid[page])
            for name, channel in channels.items():
                images = [_page_layer(texels, layer, page) for layer in traced.layers[name]]
                rules = ComponentRules(channel.lower, channel.upper, channel.groups)
                value[name][page], grown = finish_page(plan, images, rules, finisher)
                status[page][grown] = TexelStatus.DILATED
                done += 1
                report(progress, Stage.FINISH, done / steps)
    return value


def _page_layer(texels: TexelBuffer, layer: Layer, page: int) -> PageLayer:
    """Return a layer's values, errors and mask on one page, as images."""
    return PageLayer(
        texels.page_image(layer.value, page=page),
        texels.page_image(layer.error, page=page),
        layer.bound,
        None if layer.kept is None else texels.page_image(layer.kept, fill=False, page=page),
    )


def _unconverged(layers: tuple[Layer, ...], chart: NDArray[np.int32], signed: bool) -> NDArray[np.bool_]:
    """Return (n_front,) bool: lit texels whose relative standard error exceeds `UNCONVERGED`.

    The relative standard error is the error of the sum of all layers, divided by a value. The value is the
    mean of the components, or of their absolute values if they are signed. It is at least a twentieth of the
    geometric mean over lit texels of the chart.

    chart : (n_front,) int32, chart of each texel
    """
    value = sum((np.abs(layer.value) if signed else layer.value).mean(axis=1) for layer in layers)
    error = np.sqrt(sum(_mean_square(layer.error) for layer in layers))
    lit = value > 0
    count = np.maximum(np.bincount(chart[lit], minlength=1), 1)
    middle = np.exp(np.bincount(chart[lit], np.log(value[lit]), len(count)) / count)
    floor = 0.05 * np.append(middle, 0.0)[np.minimum(chart, len(middle))]
    noisy: NDArray[np.bool_] = error > UNCONVERGED * np.maximum(value, floor)
    noisy &= lit
    return noisy


def _mean_square(error: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (n,) float32: the square of errors (n,), or the mean square over groups of errors (n, G)."""
    square = np.square(error)
    mean: NDArray[np.float32] = square if square.ndim == 1 else square.mean(axis=1)
    return mean


def _statistics(value: NDArray[np.float32], invalid: int) -> dict[str, Any]:
    """Return the statistics of one channel over the values (n, C) of all texels on charts."""
    if not value.size:
        return {"min": 0.0, "max": 0.0, "mean": 0.0, "clipped": 0, "invalid": invalid}
    return {
        "min": float(value.min()),
        "max": float(value.max()),
        "mean": float(value.mean(dtype=np.float64)),
        "clipped": int((np.abs(value) > 65504.0).any(axis=-1).sum()),
        "invalid": invalid,
    }
