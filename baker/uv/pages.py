"""Distributes instances over pages: one page at the largest density, or several at a given density."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.progress import Progress
from baker.core.scene import SceneWarning
from baker.core.settings import BakeSettings
from baker.uv.outlines import Outlines
from baker.uv.pack import Packing, border, fit_page, pack, texel_gap

# _FIRST_FILL: in the first attempt at a page, instances are taken until their areas, which `_Packer.need`
# estimates, add up to at most this share of the page.
# _PAGE_TRIES: largest number of attempts to fill a page.
_FIRST_FILL = 0.92
_PAGE_TRIES = 8


@dataclass(frozen=True)
class Page:
    """A page: its N instances, and the positions of their items (see `Outlines`).

    Attributes
    ----------
    instance : (N,) int64
        Indices of the instances.
    position : tuple of (n, 2) int32
        For each instance and each of its n items, the smallest column and the smallest row of the item.
    density : (N,) float64, texels per metre
        Density of each instance.
    packing : Packing
        Packing of all items of the page.
    """

    instance: NDArray[np.int64]
    position: tuple[NDArray[np.int32], ...]
    density: NDArray[np.float64]
    packing: Packing


class _Packer:
    """Packs sets of instances into pages of a given resolution and gap."""

    def __init__(self, outlines: Outlines, resolution: int, gap: int, progress: Progress) -> None:
        self.outlines = outlines
        self.page = (resolution, gap)
        self.progress = progress
        self.fraction = 0.7

    def items(self, instance: NDArray[np.int64]) -> NDArray[np.int64]:
        first = self.outlines.first_item
        return np.concatenate([np.arange(first[i], first[i + 1]) for i in instance])

    def finish(self, instance: NDArray[np.int64], density: NDArray[np.float64], packing: Packing) -> Page:
        first = self.outlines.first_item
        cut = np.cumsum(first[instance + 1] - first[instance])[:-1]
        return Page(instance, tuple(np.split(packing.position, cut)), density[instance], packing)

    def fit(self, instance: NDArray[np.int64], most: float = np.inf) -> tuple[float, Packing] | None:
        shape = self.outlines.item_shape[self.items(instance)]
        return fit_page(self.outlines.shapes, shape, self.page, self.progress, (self.fraction, 0.95), most)

    def try_page(self, instance: NDArray[np.int64], density: NDArray[np.float64]) -> Packing | None:
        items = self.items(instance)
        shape = self.outlines.item_shape[items]
        wanted = np.ones(len(self.outlines.shapes.extent))
        first = self.outlines.first_item
        wanted[shape] = np.repeat(density[instance], first[instance + 1] - first[instance])
        packing = pack(self.outlines.shapes, shape, wanted, self.page, self.progress, self.fraction)
        return packing if packing.placed == len(items) else None

    def need(self, density: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (I,) float64: an estimate of the share of a page's area that each instance needs."""
        gap = self.page[1]
        shapes, item = self.outlines.shapes, self.outlines.item_shape
        per_item = np.repeat(density, np.diff(self.outlines.first_item))
        area = shapes.area[item] * per_item**2
        texels = area + shapes.extent[item].sum(axis=1) * per_item * (1 + gap) + (1 + gap) ** 2
        inner = self.page[0] - 2 * border(gap)
        return np.add.reduceat(texels, self.outlines.first_item[:-1]) / max(1, inner) ** 2


def fill_pages(
    outlines: Outlines, names: list[str], settings: BakeSettings, progress: Progress
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
    gaps = sorted({texel_gap(settings.padding), texel_gap(0)}, reverse=True)
    for gap in gaps:
        packer = _Packer(outlines, settings.resolution, gap, progress)
        try:
            if settings.density is None:
                found = packer.fit(everything)
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
    # The charts do not fit one page at any density, so distribute them over several pages. Start with the
    # density at which the area of the charts is a quarter of the area of all pages.
    packer = _Packer(outlines, settings.resolution, gaps[-1], progress)
    area = float(outlines.shapes.area[outlines.item_shape].sum())
    start = settings.resolution * float(np.sqrt(0.25 * settings.max_pages / max(area, 1e-12)))
    pages = _fill_at(packer, start, names, settings.max_pages, [])
    message = f"the charts do not fit one page, {len(pages)} are used; raise `resolution`"
    warnings.append(SceneWarning("uv.more_pages", message))
    return pages, warnings


def _fill_at(
    packer: _Packer, wanted: float, names: list[str], max_pages: int, warnings: list[SceneWarning]
) -> list[Page]:
    """Pack all instances at the density `wanted`, texels per metre, into up to `max_pages` pages.

    An instance that does not fit an empty page gets a lower density. If the pages are not enough, all
    instances get a lower density. Warnings are appended to `warnings`.
    """
    n = len(packer.outlines.first_item) - 1
    everything = np.arange(n)
    if max_pages == 1:
        found = packer.fit(everything, wanted)
        if found is None:
            raise _too_many_charts(packer, names, everything)
        if found[0] < wanted * 0.999:
            warnings.append(_lowered(f"all {n} objects fit one page at", wanted, found[0], ""))
        return [packer.finish(everything, np.full(n, found[0]), found[1])]
    target = wanted
    for _ in range(24):
        density, own = _alone(packer, target, names)
        pages = _distribute(packer, density, max_pages)
        if pages is not None:
            if target < wanted * 0.999:
                warnings.append(_lowered(f"{max_pages} pages hold all objects at", wanted, target, ""))
            for k in own:
                warnings.append(
                    _lowered(f"'{names[k]}' fits one page at", wanted, float(density[k]), names[k])
                )
            return pages
        needed = float(packer.need(density).sum()) / 0.85
        target *= min(0.93, float(np.sqrt(max_pages / max(needed, 1e-12))) * 0.98)
    raise _too_many_charts(packer, names, everything)


def _alone(packer: _Packer, target: float, names: list[str]) -> tuple[NDArray[np.float64], list[int]]:
    """Return the density (I,), up to `target`, at which each instance fits an empty page.

    Also return the indices of the instances whose density is below `target`.
    """
    outlines = packer.outlines
    n = len(outlines.first_item) - 1
    density = np.full(n, target)
    longest = np.maximum.reduceat(
        outlines.shapes.extent[outlines.item_shape].max(axis=1), outlines.first_item[:-1]
    )
    need = packer.need(density)
    suspects = np.flatnonzero((need > 0.5) | (longest * target > 0.9 * packer.page[0]))
    lowered: list[int] = []
    known: dict[bytes, float] = {}
    for k in suspects:
        shape = outlines.item_shape[outlines.first_item[k] : outlines.first_item[k + 1]]
        if shape.tobytes() not in known:
            found = packer.fit(np.array([k]), target)
            if found is None:
                raise _too_many_charts(packer, names, np.array([k]))
            known[shape.tobytes()] = found[0]
        if known[shape.tobytes()] < target * 0.999:
            density[k] = known[shape.tobytes()]
            lowered.append(int(k))
    return density, lowered


def _distribute(packer: _Packer, density: NDArray[np.float64], max_pages: int) -> list[Page] | None:
    """Fill one page after the other, largest instances first; return None if the pages are not enough.

    density : (I,) float64, texels per metre
    """
    need = packer.need(density)
    if need.sum() > 1.3 * max_pages:
        return None
    remaining = np.lexsort((np.arange(len(need)), -need))
    pages: list[Page] = []
    while len(remaining):
        if len(pages) == max_pages:
            return None
        best: tuple[NDArray[np.bool_], Packing] | None = None
        fill, step = _FIRST_FILL, 0.08
        for attempt in range(_PAGE_TRIES):
            taken = _take(need[remaining], fill)
            packing = packer.try_page(remaining[taken], density)
            if packing is not None:
                if best is None or taken.sum() > best[0].sum():
                    best = (taken, packing)
                if taken.all() or attempt >= 3 or packing.height > 0.95 * packer.page[0]:
                    break
                fill += 0.5 * step
            elif best is not None:
                break
            elif taken.sum() == 1:
                return None
            else:
                fill *= 1.0 - step
                step *= 1.6
        if best is None:
            alone = np.arange(len(remaining)) == 0
            packing = packer.try_page(remaining[alone], density)
            if packing is None:
                return None
            best = (alone, packing)
        pages.append(packer.finish(remaining[best[0]], density, best[1]))
        remaining = remaining[~best[0]]
    return pages


def _take(need: NDArray[np.float64], fill: float) -> NDArray[np.bool_]:
    """Return (N,) bool: the instances to put on a page, up to the share `fill` of its area.

    The first instance is always taken. Each of the other instances is taken, in order, if the sum of the
    needs then does not exceed `fill`.

    need : (N,) float64, share of a page's area that each instance needs
    """
    taken = np.zeros(len(need), bool)
    total = 0.0
    for k, value in enumerate(need):
        if k == 0 or total + value <= fill:
            taken[k] = True
            total += float(value)
    return taken


def _lowered(what: str, wanted: float, got: float, name: str) -> SceneWarning:
    message = f"{what} {got:.4g} texels per metre, not at the {wanted:.4g} asked for"
    return SceneWarning("uv.density_lowered", message, name)


def _too_many_charts(packer: _Packer, names: list[str], instance: NDArray[np.int64]) -> InputError:
    first = packer.outlines.first_item
    count = first[instance + 1] - first[instance]
    if len(instance) > 1:
        return InputError(
            f"{int(count.sum())} charts do not fit pages of {packer.page[0]} texels; raise `resolution`"
        )
    name = names[int(instance[0])]
    return InputError(
        f"its {int(count.max())} charts do not fit pages of {packer.page[0]} texels; raise `resolution`",
        object=name,
    )
