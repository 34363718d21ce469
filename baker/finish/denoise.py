"""Denoises a lightmap page without darkening chart borders and without inventing light.

1. Empty texels are filled by reflection at the borders of charts, since the filter would mix the black of
   empty texels into the borders.
2. Open Image Denoise's lightmap filter runs over the part of the page that has charts.
3. The change of each texel is limited by the error of the samples: see `baker.finish.kernels.page_guard`.

Call it separately for direct and indirect light and add the results, after `recentre` and before `dilate`.
*Measured* on a sharp shadow edge over noisy indirect light, RMS error of the sum denoised at once and of the
separate parts: 1.5 and 0.9 % with exact direct light and 5 % noise, 4.0 and 3.0 % with 10 and 20 % noise; at
the edge itself 2.5 and 0.6 %, 7.7 and 4.8 %. *Measured* with 20 % noise and contact shadows, outermost ring
of charts: 16 % too dark with black gaps; RMS error 11.6 % with the nearest texel's value in the gaps, 8.7 %
(bias +2.7 %) with reflection only, 6.1 % (bias +0.2 %) with reflection along the fitted plane. *Measured* on
AO with 256 rays, with the binomial error and with that error lowered to the noise estimated from the page:
RMS error relative to the mean 0.0095 and 0.0067 in the hall (not denoised 0.0080; worst texel 0.21 and 0.09),
0.0061 and 0.0056 in the interior, 0.0022 and 0.0029 in Cornell. An error that is too large blurs contact
shadows.

Based on: Afra, Intel Open Image Denoise, 2019-2026 (filter RTLightmap); the filling of empty texels is a
consequence of the filter's behaviour at gaps.
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

# Radius of the filter, texels (its tile overlap); reflections need no larger distance.
REACH = 96
# Smallest number of mirrored texels around the image, and the multiple that its sides are extended to: the
# filter shifts the colour of the outermost texels, more where it has to fill up its blocks of 16 itself. Grey
# with 5 % noise, pages of 225 to 240: RMS error of the outermost 8 texels 0.37 to 0.38 % with it, 0.36 to
# 0.41 % with a margin of 16.
MARGIN, BLOCK = 8, 16
# Half window of the slopes at chart borders, texels.
SLOPE_RADIUS = 4
# Texels whose slopes are fitted at a time.
_BORDER_TEXELS = 4096
# An upper bound of the error is lowered to this multiple of the noise estimated from the page: the error of
# AO is 0.95 to 1.2 times that noise (Cornell, interior, hall; 16 to 256 rays).
FITTED = 1.2
# Charts brighter or darker than the page's median by more than this factor are scaled to it for the filter.
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
        Linear light, C = 3, or C = 1 (filtered as grey). Invalid texels are filled before this.
    covered : (H, W) bool
    chart : (H, W) int32
    standard_error : (H, W) float32, optional
        Standard error of each texel's mean luminance (of the value itself if C = 1), in its unit. It limits
        the change of a texel; without it the noise is estimated from the page.
    bound : bool
        Whether that is an upper bound: it is lowered to `FITTED` times the noise estimated from the page.
    signed : bool
        Whether values may be negative; C is 1 then.
    denoiser : LightmapDenoiser, optional
        Filter whose memory is kept for further pages; its threads also run the kernels. By default one of a
        single thread is made and released here.
    progress : Progress

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
    result = np.array(value)
    if not covered.any():
        return result
    window = _window(covered)
    # Contiguous: the kernels would be compiled a second time for slices.
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
    result[window][inside] = held[inside][:, : value.shape[2]]
    return result


def _check_input(
    value: NDArray[np.float32],
    covered: NDArray[np.bool_],
    chart: NDArray[np.int32],
    standard_error: NDArray[np.float32] | None,
    signed: bool,
) -> None:
    """Raise ValueError for arguments that `denoise_page` does not take."""
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
    """Return the filtered picture (h, w, 3) of a window of noisy values (h, w, 3), gaps filled."""
    # Charts are scaled to one level: the filter treats a room of a millionth of the page's light as black,
    # and its error was larger than unfiltered.
    level = _levels(np.abs(noisy) if signed else noisy, charts, inside)
    picture = surround_charts(noisy / level, inside, charts, threads=denoiser.threads)
    rows, columns = (_margins(side) for side in inside.shape)
    wide = np.pad(picture, (rows, columns, (0, 0)), mode="symmetric")
    wide = denoiser.filter(wide, progress, signed=signed)
    return np.ascontiguousarray(wide[rows[0] : -rows[1], columns[0] : -columns[1]] * level)


def _margins(side: int) -> tuple[int, int]:
    """Return the mirrored texels before and after a side of the picture."""
    total = 2 * MARGIN + -(side + 2 * MARGIN) % BLOCK
    return total // 2, total - total // 2


def _levels(
    value: NDArray[np.float32], chart: NDArray[np.int32], covered: NDArray[np.bool_]
) -> NDArray[np.float32]:
    """Return (H, W, 1) the divisor of each chart; 1 for charts about as bright as the page's median."""
    n = int(chart.max(initial=-1)) + 1
    total, count = np.zeros(n), np.zeros(n, np.int64)
    chart_sums(value, LUMINANCE, chart, covered, total, count)
    mean = total / np.maximum(count, 1)
    level = np.ones((*chart.shape, 1), np.float32)
    lit = np.flatnonzero(mean > 0.0)
    if len(lit):
        # Of the texels, not of the charts.
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
    """Return the standard error (h, w) of the texels of a window; see `denoise_page`."""
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

    Values resampled from the neighbouring chart across a seam would be better than the reflection; they would
    be inserted here.

    Parameters
    ----------
    value : (H, W, C) float32
    covered : (H, W) bool
        At least one texel set.
    chart : (H, W) int32
    threads : int

    Returns
    -------
    picture : (H, W, C) float32
        Covered texels as they are, no texel empty.
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
    # Smallest rectangle with all charts: the last page of an atlas is often nearly empty.
    rows = np.flatnonzero(covered.any(axis=1))
    columns = np.flatnonzero(covered.any(axis=0))
    return slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1)
