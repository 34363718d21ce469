"""Finishes pages: fills invalid texels, removes noise, dilates charts.

Before the dilation, the values of partly covered texels are extrapolated to the texel centres.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress, silent
from baker.finish.denoise import denoise_page
from baker.finish.dilate import dilate
from baker.finish.invalid import fill_invalid
from baker.finish.keep_light import keep_light
from baker.finish.kernels.page_fill import nearest_texel
from baker.finish.oidn import LightmapDenoiser
from baker.finish.packing import pack_charts
from baker.finish.texel_centre import recentre

# Limit of the RMS relative noise of a brightness band, see `BAND`. A chart is denoised only if some of its
# texels lie in a band whose noise is above this limit and that has at least `FEWEST` texels. The filter
# hardly reduces smaller errors. In the scene Cornell with 64 samples, the median error was 0.33 % with the
# filter and 0.35 % without.
NOT_WORTH_FILTERING = 0.02
# Largest ratio of the mean brightnesses of two charts or blocks in one brightness band.
BAND = 8.0
# Smallest number of texels of a band whose noise is considered.
FEWEST = 64
# Limit of the ratio of the arithmetic to the geometric mean of a chart's light. Above this limit, the chart
# is split into blocks, and each block is assigned to a brightness band separately.
UNEVEN = 2.5
# Smallest mean light of a chart or block, as a share of the mean light of the brightest chart or block.
# Smaller means are replaced by this value.
BLACK = 1e-10
# Limit of the RMS relative noise of a chart. Up to this limit, the chart is not denoised.
QUIET = 0.002
# Limit of the number of texels of the packed page divided by the number of covered texels of the page. Above
# this limit, charts are not packed for the filter.
SMALLER = 0.9
# Side of a block of an uneven chart, texels.
BLOCK = 16


@dataclass(frozen=True)
class PagePlan:
    """Charts and valid texels of one page, the same for all channels.

    Attributes
    ----------
    chart : (H, W) int32
        Index of the chart of each texel, -1 for empty texels.
    valid : (H, W) bool
        Covered texels with a valid point, which is a point that is not inside geometry.
    centroid : (H, W, 2) float32
        Centroid of the covered part of each texel minus the texel centre (column, row), texels.
    """

    chart: NDArray[np.int32]
    valid: NDArray[np.bool_]
    centroid: NDArray[np.float32]

    @property
    def covered(self) -> NDArray[np.bool_]:
        """Return (H, W) bool: the texels that belong to a chart."""
        covered: NDArray[np.bool_] = self.chart >= 0
        return covered

    @cached_property
    def nearest(self) -> NDArray[np.int32]:
        """Return (H, W) int32: row * W + column of the covered texel nearest to each texel."""
        nearest = np.zeros(self.chart.shape, np.int32)
        nearest_texel(self.covered, nearest)
        return nearest


class PageLayer(NamedTuple):
    """One layer of a page, such as direct light.

    The page is the sum of its layers, which are denoised separately.

    value : (H, W, C) float32
    error : (H, W) float32, standard error of the mean of the components, such as (R + G + B) / 3; or
        (H, W, G) float32, the same for each of the G groups of `ComponentRules.groups`
    bound : bool, whether `error` is an upper bound
    kept : (H, W) bool or None, texels that are not denoised
    """

    value: NDArray[np.float32]
    error: NDArray[np.float32]
    bound: bool = False
    kept: NDArray[np.bool_] | None = None


@dataclass(frozen=True)
class ComponentRules:
    """Bounds of a map's values, and which components are denoised together.

    Attributes
    ----------
    lower, upper : float
        Smallest and largest possible value; `lower` < 0 for signed values.
    groups : tuple of slice
        Components that are denoised together: the three components of a colour, or a single component. Signed
        components are denoised one by one.
    """

    lower: float
    upper: float
    groups: tuple[slice, ...]

    @property
    def signed(self) -> bool:
        """Return whether values may be negative."""
        return self.lower < 0.0

    def clip(self, value: NDArray[np.float32], like: NDArray[np.float32] | None = None) -> None:
        """Clip `value` (H, W, C) in place to the bounds.

        If `like` (H, W, C) is given, each component is also clipped to the range of that component in `like`,
        extended to include 0.
        """
        lower, upper = np.float32(self.lower), np.float32(self.upper)
        if like is None:
            np.clip(value, lower, upper, out=value)
            return
        flat = like.reshape(-1, like.shape[2])
        highest = np.minimum(flat.max(axis=0, initial=0.0), upper)
        lowest = np.maximum(flat.min(axis=0, initial=0.0), lower)
        np.clip(value, lowest, highest, out=value)


@dataclass(frozen=True)
class Finisher:
    """Resources of the finishing stages, the same for all pages of a bake.

    Attributes
    ----------
    threads : int
        Number of threads.
    dilation : int
        Number of texels by which charts are dilated into the padding.
    denoiser : LightmapDenoiser or None
        The denoiser; None if layers are not denoised.
    progress : Progress
        Called with the denoiser's progress; a truthy return value cancels.
    """

    threads: int
    dilation: int
    denoiser: LightmapDenoiser | None
    progress: Progress


@contextmanager
def open_finisher(
    *, threads: int, dilation: int, denoise: bool, progress: Progress = silent
) -> Iterator[Finisher]:
    """Yield a `Finisher` and release the denoiser's memory at the end.

    Parameters
    ----------
    threads : int
        Number of threads of the kernels and of the denoiser.
    dilation : int
        Number of texels by which charts are dilated into the padding.
    denoise : bool
        Whether layers are denoised.
    progress : Progress
        Called with the denoiser's progress; a truthy return value cancels.

    Yields
    ------
    Finisher
        Valid until the context ends.
    """
    with LightmapDenoiser(threads) as denoiser:
        yield Finisher(threads, dilation, denoiser if denoise else None, progress)


def finish_page(
    plan: PagePlan, layers: list[PageLayer], rules: ComponentRules, finisher: Finisher
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Fill, denoise and sum the layers of one page, then dilate its charts.

    Parameters
    ----------
    plan : PagePlan
        Charts and valid texels of the page.
    layers : list of PageLayer
        At least one; the page is their sum.
    rules : ComponentRules
        Bounds and groups of the components of the sum.
    finisher : Finisher
        Threads, denoiser, dilation.

    Returns
    -------
    value : (H, W, C) float32
        The page: finite values within the bounds.
    grown : (H, W) bool
        Texels filled by dilation.

    Raises
    ------
    ResourceError
        If Open Image Denoise cannot be loaded or runs out of memory.
    Cancelled
        If `progress` returned a truthy value.
    """
    total = np.zeros_like(layers[0].value)
    light = _light(plan, layers, rules)
    for layer in layers:
        if not layer.value[plan.valid].any():
            continue
        filled, _ = fill_invalid(layer.value, plan.chart, plan.valid)
        denoised = _denoised(plan, layer._replace(value=filled), light, rules, finisher)
        centred = recentre(denoised, plan.chart, plan.centroid, valid=plan.valid, threads=finisher.threads)
        flat = denoised.reshape(-1, denoised.shape[2])
        np.minimum(centred, flat.max(axis=0, initial=0.0), out=centred)
        if rules.signed:
            np.maximum(centred, flat.min(axis=0, initial=0.0), out=centred)
        total += centred
        # Free these arrays before the next layer is denoised.
        del filled, denoised, centred, flat
    rules.clip(total)
    grown_value, grown = dilate(
        total, plan.covered, plan.chart, finisher.dilation, nearest=plan.nearest, threads=finisher.threads
    )
    rules.clip(grown_value, like=total)
    return grown_value, grown


def _denoised(
    plan: PagePlan, layer: PageLayer, light: _Light, rules: ComponentRules, finisher: Finisher
) -> NDArray[np.float32]:
    """Return (H, W, C) float32: the layer with its noisy charts denoised.

    The invalid texels of the layer must have been filled. `finish.keep_light` restores the light that the
    filter removed. It is not applied to signed components, because relative changes of a sum near 0 are
    meaningless.
    """
    denoiser = finisher.denoiser
    worth = _worth_filtering(plan, _mean_error(layer, rules), light) if denoiser else None
    if denoiser is None or worth is None:
        return layer.value
    # Set the error of invalid texels to 0, because the error belongs to the value that was replaced.
    valid = plan.valid if layer.error.ndim == 2 else plan.valid[..., None]
    noisy = layer._replace(error=np.where(valid, layer.error, np.float32(0.0)))
    chosen = plan.covered & worth[plan.chart]
    filtered = _filter_groups(noisy, plan.chart, chosen, rules, finisher)
    if layer.kept is not None:
        chosen &= ~layer.kept
        filtered = np.where(layer.kept[..., None], layer.value, filtered)
    return filtered if rules.signed else keep_light(layer.value, filtered, plan.chart, chosen)


def _filter_groups(
    layer: PageLayer,
    chart: NDArray[np.int32],
    chosen: NDArray[np.bool_],
    rules: ComponentRules,
    finisher: Finisher,
) -> NDArray[np.float32]:
    """Return (H, W, C) float32: the layer after denoising the chosen charts, one component group at a time.

    If the chosen charts fit on a sufficiently smaller page (see `SMALLER`), they are first packed on that
    page.

    chart : (H, W) int32; chosen : (H, W) bool, all texels of the chosen charts
    """

    def filtered(
        value: NDArray[np.float32],
        chosen: NDArray[np.bool_],
        chart: NDArray[np.int32],
        error: NDArray[np.float32],
    ) -> NDArray[np.float32]:
        parts = [
            denoise_page(
                np.ascontiguousarray(value[..., group]), chosen, chart,
                standard_error=np.ascontiguousarray(error[..., number]) if error.ndim == 3 else error,
                bound=layer.bound, signed=rules.signed,
                denoiser=finisher.denoiser, progress=finisher.progress,
            )
            for number, group in enumerate(rules.groups)
        ]  # fmt: skip
        return parts[0] if len(parts) == 1 else np.concatenate(parts, axis=2)

    n_chosen, n_all = np.count_nonzero(chosen), np.count_nonzero(chart >= 0)
    packed = pack_charts(chart, chosen) if n_chosen < n_all else None
    if packed is None or packed.shape[0] * packed.shape[1] > SMALLER * n_all:
        return filtered(layer.value, chosen, chart, layer.error)
    part = filtered(
        packed.take(layer.value), packed.take(chosen), packed.take(chart, fill=-1), packed.take(layer.error)
    )
    result = np.array(layer.value)
    packed.put(part, result)
    return result


def _mean_error(layer: PageLayer, rules: ComponentRules) -> NDArray[np.float32]:
    """Return (H, W) float32: the standard error of the mean of all components of a layer."""
    if layer.error.ndim == 2:
        return layer.error
    share = np.array(
        [(group.stop - group.start) / layer.value.shape[2] for group in rules.groups], np.float32
    )
    error: NDArray[np.float32] = np.sqrt(np.square(layer.error * share).sum(axis=2))
    return error


class _Light(NamedTuple):
    """Brightness and group of the n valid texels of a page.

    A group is a chart, or a block of a chart of uneven brightness (see `UNEVEN`).

    texel : (n,) float64, brightness; group : (n,) int64, number of the group
    """

    texel: NDArray[np.float64]
    group: NDArray[np.int64]


def _light(plan: PagePlan, layers: list[PageLayer], rules: ComponentRules) -> _Light:
    """Return brightness and group of the valid texels.

    Brightness is the sum, over the layers, of the mean of the components or, if they are signed, of the mean
    of their absolute values. A brightness below a tenth of the mean brightness of the texel's group is raised
    to this tenth.
    """
    total = np.zeros(int(plan.valid.sum()))
    for layer in layers:
        value = layer.value[plan.valid]
        total += (np.abs(value) if rules.signed else value).mean(axis=1)
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
    """Return (n_charts,) bool: the charts to filter, or None if no noisy band has `FEWEST` texels.

    Relative noise is averaged over brightness bands, which are sets of groups with similar brightness. If
    noise were divided by the mean of the whole page instead, the noise of a dim room beside sunlit ground
    would seem negligible. Charts with at most `QUIET` noise are left out, because the filter derives one
    exposure from all texels of its input.

    error : (H, W) float32, standard error of each texel's brightness
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
    """Return (n_groups,) float64: the mean of the values (n,) in each group, 0 for empty groups."""
    return np.bincount(group, value) / np.maximum(np.bincount(group), 1)
