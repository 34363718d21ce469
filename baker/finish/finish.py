"""From values of texels to a finished page: buried texels, noise, borders, surroundings."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress
from baker.finish.denoise import denoise_page
from baker.finish.dilate import dilate
from baker.finish.invalid import fill_invalid
from baker.finish.keep_light import keep_light
from baker.finish.kernels.page_fill import nearest_texel
from baker.finish.oidn import LightmapDenoiser
from baker.finish.packing import pack_charts
from baker.finish.texel_centre import recentre

# A layer is left as it was sampled if the noise of all texels of about one brightness is below this share of
# their light (RMS): filtering it costs a second pass and gained nothing (Cornell, 64 samples: 0.33 % median
# error with, 0.35 % without).
NOT_WORTH_FILTERING = 0.02
# Charts whose mean light lies within such a factor are of about one brightness. Fewer texels do not count.
BAND = 8.0
FEWEST = 64
# Where a chart's mean light is more than this times its geometric mean, its blocks are judged like charts.
UNEVEN = 2.5
# Light below this share of that of the page's brightest chart counts as black.
BLACK = 1e-10
# Noise below this share is none.
QUIET = 0.002
# The charts to filter are brought together if that takes less than this share of the charts' area.
SMALLER = 0.9
# Side of such a block, texels.
BLOCK = 16


@dataclass(frozen=True)
class PagePlan:
    """What lies where on one page, the same for all channels.

    Attributes
    ----------
    chart : (H, W) int32, -1 = empty
    valid : (H, W) bool, covered and not buried
    centroid : (H, W, 2) float32, covered part's centroid from the texel's centre, texels
    """

    chart: NDArray[np.int32]
    valid: NDArray[np.bool_]
    centroid: NDArray[np.float32]

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Return where charts are, (H, W) bool."""
        covered: NDArray[np.bool_] = self.chart >= 0
        return covered

    @cached_property
    def nearest(self) -> NDArray[np.int32]:
        """Return the number of the covered texel nearest to each texel, (H, W) int32."""
        nearest = np.zeros(self.chart.shape, np.int32)
        nearest_texel(self.covered, nearest)
        return nearest


class PageLayer(NamedTuple):
    """A part of a page that is denoised by itself.

    value (H, W, C) float32; error (H, W) float32, standard error; bound: whether that is an upper bound;
    kept (H, W) bool or None: texels that stay as they were sampled.
    """

    value: NDArray[np.float32]
    error: NDArray[np.float32]
    bound: bool = False
    kept: NDArray[np.bool_] | None = None


def finish_page(
    plan: PagePlan,
    layers: list[PageLayer],
    *,
    upper: float,
    denoiser: LightmapDenoiser | None,
    dilation: int,
    threads: int,
    progress: Progress,
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Repair, denoise and add up the layers of one page, then grow its charts.

    Parameters
    ----------
    layers : list of PageLayer
    upper : float
        Largest possible value of the sum.
    denoiser : LightmapDenoiser or None
        None: layers stay as they were sampled.
    dilation : int
        Texels by which charts grow into the gaps.

    Returns
    -------
    value : (H, W, C) float32, finite, 0 to `upper`
    grown : (H, W) bool, texels filled by the growth
    """
    total = np.zeros_like(layers[0].value)
    light = _light(plan, layers)
    for value, error, bound, kept in layers:
        if not value[plan.valid].any():
            continue
        repaired, _ = fill_invalid(value, plan.chart, plan.valid)
        worth = _worth_filtering(plan, error, light) if denoiser else None
        if denoiser and worth is not None:
            # The noise of texels inside geometry is none of those around them.
            error = np.where(plan.valid, error, np.float32(0.0))
            noisy = PageLayer(repaired, error, bound)
            chosen = plan.covered & worth[plan.chart]
            filtered = _denoise(noisy, plan.chart, chosen, denoiser, threads, progress)
            if kept is not None:
                chosen &= ~kept
                filtered = np.where(kept[..., None], repaired, filtered)
            repaired = keep_light(repaired, filtered, plan.chart, chosen)
        centred = recentre(repaired, plan.chart, plan.centroid, valid=plan.valid, threads=threads)
        total += np.minimum(centred, _brightest(repaired), out=centred)
    np.clip(total, 0.0, upper, out=total)
    grown_value, grown = dilate(
        total, plan.covered, plan.chart, dilation, nearest=plan.nearest, threads=threads
    )
    np.clip(grown_value, 0.0, np.minimum(_brightest(total), upper), out=grown_value)
    return grown_value, grown


def _denoise(
    layer: PageLayer,
    chart: NDArray[np.int32],
    chosen: NDArray[np.bool_],
    denoiser: LightmapDenoiser,
    threads: int,
    progress: Progress,
) -> NDArray[np.float32]:
    """Return the page with the chosen texels, whole charts, denoised; a few are brought together first."""
    value, error = layer.value, layer.error

    def filtered(
        value: NDArray[np.float32],
        chosen: NDArray[np.bool_],
        chart: NDArray[np.int32],
        error: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        return denoise_page(
            value, chosen, chart,
            standard_error=error, bound=layer.bound, threads=threads, denoiser=denoiser, progress=progress,
        )  # fmt: skip

    n_chosen, n_all = np.count_nonzero(chosen), np.count_nonzero(chart >= 0)
    packed = pack_charts(chart, chosen) if n_chosen < n_all else None
    if packed is None or packed.shape[0] * packed.shape[1] > SMALLER * n_all:
        return filtered(value, chosen, chart, error)
    part = filtered(packed.take(value), packed.take(chosen), packed.take(chart, fill=-1), packed.take(error))
    result = np.array(value)
    packed.put(part, result)
    return result


def _brightest(value: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the largest value of each channel (C,): what is moved or continued must not be brighter."""
    brightest: NDArray[np.float32] = value.reshape(-1, value.shape[2]).max(axis=0, initial=0.0)
    return brightest


class _Light(NamedTuple):
    """How bright valid texels are, (n,) float64, and the group of texels that each belongs to, (n,) int64."""

    texel: NDArray[np.float64]
    group: NDArray[np.int64]


def _light(plan: PagePlan, layers: list[PageLayer]) -> _Light:
    """Return the sum of layers; a group is a chart, or a block of an uneven one.

    Dark texels are raised to a tenth of their group's mean.
    """
    total = np.zeros(int(plan.valid.sum()))
    for layer in layers:
        total += layer.value[plan.valid].mean(axis=1)
    group = plan.chart[plan.valid].astype(np.int64)
    mean = _mean_of(group, total)
    uneven = mean > UNEVEN * np.exp(_mean_of(group, np.log(np.maximum(total, 1e-6 * mean[group] + 1e-300))))
    part = np.flatnonzero(uneven[group])
    if len(part):
        row, column = (a[part] // BLOCK for a in np.nonzero(plan.valid))
        key = (group[part] * (plan.chart.shape[0] // BLOCK + 1) + row) * (plan.chart.shape[1] // BLOCK + 1)
        group[part] = len(mean) + np.unique(key + column, return_inverse=True)[1]
        mean = _mean_of(group, total)
    return _Light(np.maximum(total, np.maximum(0.1 * mean[group], 1e-30)), group)


def _worth_filtering(plan: PagePlan, error: NDArray[np.float32], light: _Light) -> NDArray[np.bool_] | None:
    """Return which charts (n_charts,) to filter, None if all are little noisy against their own light.

    The page's mean would say that a dim room beside a sunlit ground has no noise. Charts without any, as that
    ground, stay out: the filter sets its exposure by all that it sees.
    """
    mean = _mean_of(light.group, light.texel)
    mean = np.maximum(mean, max(BLACK * float(mean.max(initial=0.0)), 1e-30))
    share = error[plan.valid] / np.maximum(light.texel, 0.1 * mean[light.group])
    band = np.floor(np.log(mean) / np.log(BAND)).astype(np.int64)
    band = (band - band.min(initial=0))[light.group]
    noise = np.sqrt(_mean_of(band, share * share))
    worth = ((noise > NOT_WORTH_FILTERING) & (np.bincount(band) >= FEWEST))[band]
    if not worth.any():
        return None
    charts = np.zeros(int(plan.chart.max()) + 1, bool)
    owner = plan.chart[plan.valid].astype(np.int64)
    own = _mean_of(owner, share * share)
    charts[: len(own)] = (own > QUIET**2) & (np.bincount(owner, worth) > 0)
    return charts


def _mean_of(group: NDArray[np.int64], value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean of the values (n,) of each group; 0 for those without any."""
    return np.bincount(group, value) / np.maximum(np.bincount(group), 1)
