"""Denoises a lightmap page without darkening chart borders and without adding light.

1. Empty texels are filled by reflection at the borders of charts. The filter would otherwise mix the black of
   empty texels into the borders.
2. Open Image Denoise's lightmap filter runs over the smallest rectangle of the page that contains all charts.
3. The change of each texel is limited by the standard error of its samples, see
   `baker.finish.kernels.page_guard`.

Direct and indirect light are denoised separately and then added. *Measured* RMS error of a page with a sharp
shadow edge in direct light, and with noisy indirect light:

    noise of direct and of indirect light | texels        | denoised as a sum | denoised separately
    0 and 5 %                             | all           | 1.5 %             | 0.9 %
    0 and 5 %                             | at the edge   | 2.5 %             | 0.6 %
    10 and 20 %                           | all           | 4.0 %             | 3.0 %
    10 and 20 %                           | at the edge   | 7.7 %             | 4.8 %

*Measured* errors in the outermost ring of texels of charts, with 20 % noise and contact shadows. Each row is
one choice of the values with which empty texels are filled:

    content of empty texels               | RMS error | mean error
    black                                 |           | -16 %
    value of the nearest texel            | 11.6 %    |
    reflection                            | 8.7 %     | +2.7 %
    reflection times the fitted plane     | 6.1 %     | +0.2 %

*Measured* on AO with 256 rays: RMS error divided by the mean, by scene and by the standard error that limits
the change. "Binomial" is the binomial standard error, and "lowered" is this error lowered to the noise
estimated from the page.

    scene                                 | not denoised | binomial | lowered
    hall                                  | 0.0080       | 0.0095   | 0.0067
    hall, worst texel                     |              | 0.21     | 0.09
    interior                              |              | 0.0061   | 0.0056
    Cornell                               |              | 0.0022   | 0.0029

With a standard error that is too large, the filter blurs contact shadows.

Based on: Afra, Intel Open Image Denoise, 2019-2026 (filter RTLightmap).
"""

from __future__ import annotations

import contextlib

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import LUMINANCE_WEIGHTS
from baker.core.progress import Progress, silent
from baker.finish.kernels.page_charts import chart_sums
from baker.finish.kernels.page_fill import nearest_texel, reflect_outwards
from baker.finish.kernels.page_guard import hold_to_samples
from baker.finish.kernels.page_slope import NO_OFFSET, noisy_planes
from baker.finish.noise import estimate_error
from baker.finish.oidn import LightmapDenoiser, denoiser_name
from baker.finish.page import check_page
from baker.finish.tiles import over_rows

__all__ = ["denoise_page", "denoiser_name", "surround_charts"]

# Largest distance between an empty texel's nearest covered texel and its mirror texel, texels. This distance
# is the radius of the filter (its tile overlap).
REACH = 96
# MARGIN: smallest number of mirrored texels at each side of the image. BLOCK: the sides of the extended image
# are multiples of BLOCK. The filter shifts the colour of the outermost texels. The shift is larger if the
# filter itself pads the image to blocks of 16. On grey pages of 225 to 240 texels a side with 5 % noise, the
# RMS error of the outermost 8 texels was 0.37 to 0.38 % with these values, and 0.36 to 0.41 % with a fixed
# margin of 16.
MARGIN, BLOCK = 8, 16
# Half side of the window to which planes are fitted at chart borders, texels.
SLOPE_RADIUS = 4
# Number of border texels for which one call of the kernel fits planes.
_BORDER_TEXELS = 4096
# Largest ratio of an upper bound of the standard error to the noise estimated from the page, both RMS over
# the page. Larger bounds are scaled down to this ratio. The true error of AO is 0.95 to 1.2 times the
# estimated noise (scenes Cornell, interior and hall; 16 to 256 rays).
FITTED = 1.2
# Limit of the ratio of a chart's mean luminance to the median that `_levels` computes, and of the inverse of
# this ratio. Above this limit, the chart is divided by the ratio before filtering.
LEVEL = 8.0
LUMINANCE = np.array(LUMINANCE_WEIGHTS, np.float32)


def denoise_page(
    value: NDArray[np.float32],
    covered: NDArray[np.bool_],
    chart: NDArray[np.int32],
    *,
    standard_error: NDArray[np.float32] | None = None,
    bound: bool = False,
    signed: bool = False,
    denoiser: LightmapDenoiser | None = None,
    progress: Progress = silent,
) -> NDArray[np.float32]:
    """Remove Monte Carlo noise from the covered texels of a page.

    Parameters
    ----------
    value : (H, W, C) float32
        Linear light; C = 3, or C = 1, which is filtered as grey. Invalid texels must have been filled.
    covered : (H, W) bool
        Texels to denoise.
    chart : (H, W) int32
        Index of the chart of each covered texel.
    standard_error : (H, W) float32, optional
        Standard error of each texel's mean luminance (if C = 1, of its value), in the unit of `value`. The
        standard error limits the change of a texel. None means that the standard error is estimated from the
        page.
    bound : bool
        Whether `standard_error` is an upper bound. If so, it is lowered to at most `FITTED` times the noise
        estimated from the page.
    signed : bool
        Whether values may be negative; requires C = 1.
    denoiser : LightmapDenoiser, optional
        Filter that keeps its memory for further pages. The kernels run on as many threads as the filter. By
        default, a filter with one thread is created for this call.
    progress : Progress
        Called with the fraction that the filter has done; a truthy return value cancels.

    Returns
    -------
    value : (H, W, C) float32
        A new page; texels that are not covered are unchanged.

    Raises
    ------
    ValueError
        If shapes or types of the arrays do not match, C is neither 1 nor 3, or signed values have three
        components.
    ResourceError
        If Open Image Denoise cannot be loaded or runs out of memory.
    Cancelled
        If `progress` returned a truthy value.
    """
    _check_input(value, covered, chart, standard_error, signed)
    if not covered.any():
        return np.array(value)
    window = _window(covered)
    # Copy to contiguous arrays, because Numba compiles a kernel again for strided ones.
    inside = np.ascontiguousarray(covered[window])
    charts = np.ascontiguousarray(chart[window])
    noisy = np.ascontiguousarray(np.broadcast_to(value[window], (*inside.shape, 3)))
    with contextlib.ExitStack() as stack:
        denoiser = denoiser or stack.enter_context(LightmapDenoiser(1))
        filtered = _filter_window(noisy, charts, inside, signed, denoiser, progress)
    threads = denoiser.threads
    error = _error_within(window, noisy, charts, inside, standard_error, bound, threads)
    held = np.array(filtered)
    over_rows(
        lambda first, end: hold_to_samples(noisy, filtered, charts, inside, error, held, first, end),
        len(held),
        threads,
    )
    result = np.array(value)
    result[window][inside] = held[inside][:, : value.shape[2]]
    return result


def _check_input(
    value: NDArray[np.float32],
    covered: NDArray[np.bool_],
    chart: NDArray[np.int32],
    standard_error: NDArray[np.float32] | None,
    signed: bool,
) -> None:
    """Raise ValueError if an argument of `denoise_page` has a wrong shape or type."""
    check_page(value, chart, covered=covered)
    if value.shape[2] not in (1, 3):
        raise ValueError(f"a page to denoise has 1 or 3 channels, this one has {value.shape[2]}")
    if signed and value.shape[2] != 1:
        raise ValueError("signed components are denoised one by one")
    if standard_error is not None:
        check_page(value, chart, standard_error=standard_error)


def _filter_window(
    noisy: NDArray[np.float32],
    charts: NDArray[np.int32],
    inside: NDArray[np.bool_],
    signed: bool,
    denoiser: LightmapDenoiser,
    progress: Progress,
) -> NDArray[np.float32]:
    """Return (h, w, 3) float32: a window of `noisy` (h, w, 3) after filling its empty texels and filtering.

    charts : (h, w) int32; inside : (h, w) bool, covered texels
    """
    # Scale very dark and very bright charts to the median, because the filter treats charts with a millionth
    # of the page's light as black.
    level = _levels(np.abs(noisy) if signed else noisy, charts, inside)
    picture = surround_charts(noisy / level, inside, charts, threads=denoiser.threads)
    rows, columns = (_margins(side) for side in inside.shape)
    wide = np.pad(picture, (rows, columns, (0, 0)), mode="symmetric")
    # Free the picture before the filter allocates its memory.
    del picture
    wide = denoiser.filter(wide, progress, signed=signed)
    return np.ascontiguousarray(wide[rows[0] : -rows[1], columns[0] : -columns[1]] * level)


def _margins(side: int) -> tuple[int, int]:
    """Return the numbers of mirrored texels to add before and after `side` texels; see `MARGIN`."""
    total = 2 * MARGIN + -(side + 2 * MARGIN) % BLOCK
    return total // 2, total - total // 2


def _levels(
    value: NDArray[np.float32], chart: NDArray[np.int32], covered: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return (H, W, 1) float32: the divisor of each texel's value; 1 in charts that are not scaled (`LEVEL`).

    value : (H, W, 3) float32; chart : (H, W) int32; covered : (H, W) bool
    """
    n = int(chart.max(initial=-1)) + 1
    total, count = np.zeros(n), np.zeros(n, np.int64)
    chart_sums(value, LUMINANCE, chart, covered, total, count)
    mean = total / np.maximum(count, 1)
    level = np.ones((*chart.shape, 1), np.float32)
    lit = np.flatnonzero(mean > 0.0)
    if len(lit):
        # Compute the median, over the texels of lit charts, of the mean luminance of the texel's chart.
        order = lit[np.argsort(mean[lit], kind="stable")]
        middle = mean[order[np.searchsorted(np.cumsum(count[order]), 0.5 * count[order].sum())]]
        ratio = np.where(mean > 0.0, mean / middle, 1.0)
        far = np.maximum(ratio, 1.0 / ratio) > LEVEL
        if far.any():
            level[covered, 0] = np.where(far, ratio, 1.0)[chart[covered]]
    return level


def _error_within(
    window: tuple[slice, slice],
    noisy: NDArray[np.float32],
    charts: NDArray[np.int32],
    inside: NDArray[np.bool_],
    standard_error: NDArray[np.float32] | None,
    bound: bool,
    threads: int,
) -> NDArray[np.float32]:
    """Return (h, w) float32: the standard error of the texels of a window; see `denoise_page`.

    standard_error : (H, W) float32 of the whole page, or None; the other arrays are those of the window
    """
    if standard_error is None:
        return estimate_error(noisy @ LUMINANCE, charts, inside, threads=threads)
    error = np.ascontiguousarray(standard_error[window], np.float32)
    if not bound or not error[inside].any():
        return error
    seen = np.minimum(estimate_error(noisy @ LUMINANCE, charts, inside, threads=threads), error)
    share = np.sqrt(np.square(seen[inside]).mean() / np.square(error[inside]).mean())
    return error * np.float32(min(1.0, FITTED * float(share)))


def surround_charts(
    value: NDArray[np.float32], covered: NDArray[np.bool_], chart: NDArray[np.int32], *, threads: int = 1
) -> NDArray[np.float32]:
    """Fill every empty texel of a page with the reflection of the nearest chart.

    Parameters
    ----------
    value : (H, W, C) float32
        The page.
    covered : (H, W) bool
        Texels of charts, at least one.
    chart : (H, W) int32
        Index of the chart of each covered texel.
    threads : int
        Number of threads.

    Returns
    -------
    picture : (H, W, C) float32
        Covered texels have the values of `value`; all other texels have reflected values.
    """
    nearest = np.zeros(covered.shape, np.int32)
    nearest_texel(covered, nearest)
    wanted = np.zeros(covered.size, np.bool_)
    wanted[nearest[~covered]] = True
    border = np.flatnonzero(wanted)
    plane = np.zeros((len(border), 3, value.shape[2]), np.float32)

    def fit(begin: int, end: int) -> None:
        own = border[begin:end]
        noisy_planes(value, chart, covered, NO_OFFSET, own, SLOPE_RADIUS, plane[begin:end])

    over_rows(fit, len(border), threads, _BORDER_TEXELS)
    plane_row = np.zeros(covered.shape, np.int32)
    plane_row.reshape(-1)[border] = np.arange(len(border), dtype=np.int32)
    picture = np.array(value)
    over_rows(
        lambda first, end: reflect_outwards(
            picture, chart, covered, nearest, plane_row, plane, REACH, first, end
        ),
        len(picture),
        threads,
    )
    return picture


def _window(covered: NDArray[np.bool_]) -> tuple[slice, slice]:
    # Return rows and columns of the smallest rectangle that contains all charts. It saves time on the last
    # page of an atlas, which is often nearly empty.
    rows = np.flatnonzero(covered.any(axis=1))
    columns = np.flatnonzero(covered.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
