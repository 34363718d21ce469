"""Distributes instances over pages: one page at the largest density, or several at a given density."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.progress import Progress
from baker.core.scene import SceneWarning
from baker.core.settings import BakeSettings
from baker.uv.fit_advice import fit_advice
from baker.uv.outlines import Outlines
from baker.uv.pack import Packing, texel_gap
from baker.uv.page_budget import fill_budget
from baker.uv.page_packer import (
    DensityLimits,
    Page,
    PagePacker,
    alone,
    distribute,
    page_counter,
    too_many_charts,
)

# Least density of objects beside those with a fixed density, divided by their density without these; and
# number of attempts to find a larger density.
_LEAST_FREE = 1.0 / 16.0
_FACTOR_TRIES = 9


def fill_pages(
    outlines: Outlines,
    names: list[str],
    settings: BakeSettings,
    progress: Progress,
    limits: DensityLimits | None = None,
) -> tuple[list[Page], list[SceneWarning]]:
    """Pack all instances into pages of exactly `settings.resolution` texels.

    If `settings.density` is None, all instances are packed into one page, at the largest density that fits.
    If `settings.density` is a number, instances are packed at this density into up to `max_pages` pages. If
    the pages are not enough, the density is lowered. If nothing fits with the padding of the settings, the
    padding is reduced. If still nothing fits and `settings.density` is None, the instances are packed into up
    to `max_pages` pages.

    Parameters
    ----------
    outlines : Outlines
        Outlines of all instances.
    names : list of str
        Names of the instances, for messages.
    settings : BakeSettings
        `resolution`, `density`, `max_pages` and `padding` are read.
    progress : Progress
        Called with fractions of the stage.
    limits : DensityLimits, optional
        Limits of the density if `settings.density` is None; by default, there are none.

    Returns
    -------
    pages : list of Page
        The pages.
    warnings : list of SceneWarning
        Warnings about lowered density, reduced padding and additional pages.

    Raises
    ------
    InputError
        If the charts do not fit the pages at any density.
    """
    warnings: list[SceneWarning] = []
    everything = np.arange(len(outlines.first_item) - 1)
    limits = limits or DensityLimits(np.zeros(len(everything), bool))
    gaps = sorted({texel_gap(settings.padding), texel_gap(0)}, reverse=True)
    for gap in gaps:
        packer = PagePacker(outlines, settings.resolution, gap, progress, limits.reserved)
        try:
            if settings.budget is not None:
                pages = fill_budget(packer, names, settings, limits, warnings)
            elif settings.density is None and limits.fixed.any():
                pages = _fit_around(packer, limits, warnings)
            elif settings.density is None:
                found = packer.fit(everything, limits.most)
                pages = (
                    None
                    if found is None
                    else [packer.finish(everything, np.full(len(everything), found[0]), found[1])]
                )
            else:
                pages = _fill_at(packer, settings.density, names, settings.max_pages, warnings)
        except InputError:
            if gap == gaps[-1]:
                raise
            pages = None
        if pages is not None:
            if gap < settings.padding:
                message = (
                    f"padding {settings.padding} leaves no room, {gap} texels are kept; raise `resolution`"
                )
                warnings.append(SceneWarning("uv.padding_reduced", message))
            return pages, warnings
    if limits.fixed.any():
        raise too_many_charts(packer, names, everything)
    # The charts do not fit one page at any density, so distribute them over several pages. Start with the
    # density at which the area of the charts is a quarter of the area of all pages.
    packer = PagePacker(outlines, settings.resolution, gaps[-1], progress)
    area = float(outlines.shapes.area[outlines.item_shape].sum())
    start = settings.resolution * float(np.sqrt(0.25 * settings.max_pages / max(area, 1e-12)))
    pages = _fill_at(packer, start, names, settings.max_pages, [])
    message = f"the charts do not fit one page, {len(pages)} are used; raise `resolution`"
    warnings.append(SceneWarning("uv.more_pages", message))
    return pages, warnings


def _fit_around(packer: PagePacker, limits: DensityLimits, warnings: list[SceneWarning]) -> list[Page] | None:
    """Pack all instances into one page: fixed ones at density 1, others at the largest density that fits.

    If the fixed instances leave no room, the density of all instances is lowered. Return None if nothing
    fits.
    """
    fixed, everything = limits.fixed, np.arange(len(limits.fixed))
    others = packer.fit(everything[~fixed], limits.most) if not fixed.all() else None
    top = others[0] if others is not None else 1.0
    # Each attempt: densities of fixed and of other instances. First, find the largest density of the others.
    largest = _largest(
        packer, lambda factor: np.where(fixed, 1.0, top * factor), 1.0 if fixed.all() else _LEAST_FREE
    )
    if largest is not None:
        return [packer.finish(everything, *largest)]
    lowered = _largest(packer, lambda factor: np.where(fixed, 1.0, top * _LEAST_FREE) * factor, _LEAST_FREE)
    if lowered is None:
        return None
    share = float(lowered[0][fixed][0])
    message = f"the objects with a density do not fit the page; they get {share:.3g} of it"
    warnings.append(SceneWarning("uv.density_lowered", f"{message}; raise `resolution`"))
    return [packer.finish(everything, *lowered)]


def _largest(
    packer: PagePacker, densities: Callable[[float], NDArray[np.float64]], smallest: float
) -> tuple[NDArray[np.float64], Packing] | None:
    """Return the densities (I,) of the largest factor from `smallest` to 1 at which all instances fit a page.

    densities : returns the densities (I,) for a factor
    """
    everything = np.arange(len(packer.outlines.first_item) - 1)

    def attempt(factor: float) -> tuple[NDArray[np.float64], Packing] | None:
        density = densities(factor)
        packing = packer.try_page(everything, density)
        return None if packing is None else (density, packing)

    best = attempt(1.0)
    if best is not None or smallest >= 1.0:
        return best
    best = attempt(smallest)
    if best is None:
        return None
    low, high = smallest, 1.0
    for _ in range(_FACTOR_TRIES):
        middle = float(np.sqrt(low * high))
        found = attempt(middle)
        if found is None:
            high = middle
        else:
            best, low = found, middle
    return best


def _fill_at(
    packer: PagePacker, wanted: float, names: list[str], max_pages: int, warnings: list[SceneWarning]
) -> list[Page]:
    """Pack all instances at the density `wanted`, texels per metre, into up to `max_pages` pages.

    An instance that does not fit an empty page gets a lower density. If the pages are not enough, all
    instances get a lower density. Warnings are appended to `warnings`.
    """
    n = len(packer.outlines.first_item) - 1
    everything = np.arange(n)
    pages_at = page_counter(packer, names)

    def advice(got: float) -> str:
        return fit_advice(pages_at, packer.page[0], wanted, max_pages, got, packer.reserved)

    if max_pages == 1:
        found = packer.fit(everything, wanted)
        if found is None:
            raise too_many_charts(packer, names, everything)
        if found[0] < wanted * 0.999:
            warnings.append(
                _lowered(f"all {n} objects fit one page at", wanted, found[0], "", advice(found[0]))
            )
        return [packer.finish(everything, np.full(n, found[0]), found[1])]
    target = wanted
    for _ in range(24):
        density, own = alone(packer, np.full(n, target), names)
        pages = distribute(packer, density, max_pages)
        if pages is not None:
            if target < wanted * 0.999:
                what = f"{max_pages} pages hold all objects at"
                warnings.append(_lowered(what, wanted, target, "", advice(target)))
            lowest = float(density[own].min()) if own and target >= wanted * 0.999 else None
            hint = "" if lowest is None else advice(lowest)
            for k in own:
                what = f"'{names[k]}' fits one page at"
                warnings.append(_lowered(what, wanted, float(density[k]), names[k], hint))
            return pages
        needed = float(packer.need(density).sum()) / 0.85
        target *= min(0.93, float(np.sqrt(max_pages / max(needed, 1e-12))) * 0.98)
    raise too_many_charts(packer, names, everything)


def _lowered(what: str, wanted: float, got: float, name: str, advice: str) -> SceneWarning:
    message = f"{what} {got:.4g} texels per metre, not at the {wanted:.4g} asked for{advice}"
    return SceneWarning("uv.density_lowered", message, name)
