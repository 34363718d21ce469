"""Packs instances into pages of a given size: one page, or as many as are needed at given densities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.progress import Progress
from baker.uv.fit_advice import LARGEST_PAGE, PagesAt
from baker.uv.outlines import Outlines
from baker.uv.pack import Packing, border, fit_page, pack

# _FIRST_FILL: in the first attempt at a page, instances are taken until their areas, which `PagePacker.need`
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


@dataclass(frozen=True)
class DensityLimits:
    """Limits of the density of N instances in pages whose density is searched.

    Attributes
    ----------
    fixed : (N,) bool
        Instances whose outlines already have their final size in texels, so that their density is 1.
    most : float
        Upper limit of the density of the other instances, texels per metre.
    reserved : int
        Number of pages of other groups of objects. Messages add it to numbers of pages.
    """

    fixed: NDArray[np.bool_]
    most: float = np.inf
    reserved: int = 0


class PagePacker:
    """Packs sets of instances into pages of a given resolution and gap."""

    def __init__(
        self, outlines: Outlines, resolution: int, gap: int, progress: Progress, reserved: int = 0
    ) -> None:
        self.reserved = reserved
        self.outlines = outlines
        self.page = (resolution, gap)
        self.progress = progress
        self.fraction = 0.7

    def items(self, instance: NDArray[np.int64]) -> NDArray[np.int64]:
        """Return the items of instances, in order."""
        first = self.outlines.first_item
        return np.concatenate([np.arange(first[i], first[i + 1]) for i in instance])

    def per_shape(self, density: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the density (S,) of each shape; `density` (I,) is that of each instance."""
        result = np.ones(len(self.outlines.shapes.extent))
        result[self.outlines.item_shape] = np.repeat(density, np.diff(self.outlines.first_item))
        return result

    def finish(self, instance: NDArray[np.int64], density: NDArray[np.float64], packing: Packing) -> Page:
        """Return a page of packed instances; `density` (I,) is that of all instances."""
        first = self.outlines.first_item
        cut = np.cumsum(first[instance + 1] - first[instance])[:-1]
        return Page(instance, tuple(np.split(packing.position, cut)), density[instance], packing)

    def fit(self, instance: NDArray[np.int64], most: float = np.inf) -> tuple[float, Packing] | None:
        """Return the largest density at which instances fit one page, see `fit_page`."""
        shape = self.outlines.item_shape[self.items(instance)]
        return fit_page(self.outlines.shapes, shape, self.page, self.progress, (self.fraction, 0.95), most)

    def try_page(self, instance: NDArray[np.int64], density: NDArray[np.float64]) -> Packing | None:
        """Return a page of instances at densities (I,) of all instances; None if they do not fit."""
        items = self.items(instance)
        shape = self.outlines.item_shape[items]
        # Set the densities of all shapes: the layout of a block depends on all instances that share it.
        wanted = self.per_shape(density)
        packing = pack(self.outlines.shapes, shape, wanted, self.page, self.progress, self.fraction)
        return packing if packing.placed == len(items) else None

    def need(self, density: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return (I,) float64: an estimate of the share of a page's area that each instance needs."""
        gap = self.page[1]
        shapes, item = self.outlines.shapes, self.outlines.item_shape
        per_item = np.repeat(density, np.diff(self.outlines.first_item))
        area, edges = shapes.area[item] * per_item**2, shapes.extent[item] * per_item[:, None]
        if shapes.blocks is not None:
            size = shapes.extent * shapes.scale(self.per_shape(density), self.page)
            block = np.isin(item, shapes.blocks.shape)
            edges[block] = size[item[block]]
            area[block] = edges[block].prod(axis=1)
        texels = area + edges.sum(axis=1) * (1 + gap) + (1 + gap) ** 2
        inner = self.page[0] - 2 * border(gap)
        return np.add.reduceat(texels, self.outlines.first_item[:-1]) / max(1, inner) ** 2


def alone(
    packer: PagePacker, target: NDArray[np.float64], names: list[str]
) -> tuple[NDArray[np.float64], list[int]]:
    """Return the density (I,), up to `target` (I,), at which each instance fits an empty page.

    Also return the indices of the instances whose density is below `target`.
    """
    outlines = packer.outlines
    density = target.copy()
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
            found = packer.fit(np.array([k]), target[k])
            if found is None:
                raise too_many_charts(packer, names, np.array([k]))
            known[shape.tobytes()] = found[0]
        if known[shape.tobytes()] < target[k] * 0.999:
            density[k] = known[shape.tobytes()]
            lowered.append(int(k))
    return density, lowered


def distribute(packer: PagePacker, density: NDArray[np.float64], max_pages: int) -> list[Page] | None:
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


def page_counter(packer: PagePacker, names: list[str]) -> PagesAt:
    """Return the function that counts the pages which all instances need, see `PagesAt`."""
    everything = np.arange(len(packer.outlines.first_item) - 1)

    def pages_at(resolution: int, density: float, max_pages: int) -> int | None:
        other = PagePacker(packer.outlines, resolution, packer.page[1], packer.progress)
        try:
            if max_pages == 1:
                found = other.fit(everything, density)
                return 1 if found is not None and found[0] >= 0.999 * density else None
            each, lowered = alone(other, np.full(len(everything), density), names)
            pages = None if lowered else distribute(other, each, max_pages)
        except InputError:
            return None
        return None if pages is None else len(pages)

    return pages_at


def too_many_charts(packer: PagePacker, names: list[str], instance: NDArray[np.int64]) -> InputError:
    """Return the error for charts that fit no page at any density; it names a resolution that fits them."""
    first = packer.outlines.first_item
    count = first[instance + 1] - first[instance]
    width, fits = packer.page[0], False
    while not fits and width < LARGEST_PAGE:
        width = min(2 * width, LARGEST_PAGE)
        other = PagePacker(packer.outlines, width, packer.page[1], packer.progress)
        fits = other.fit(instance) is not None
    hint = f"raise `resolution` to {width}" if fits else "bake fewer objects at once"
    if len(instance) > 1:
        return InputError(f"{int(count.sum())} charts do not fit pages of {packer.page[0]} texels; {hint}")
    name = names[int(instance[0])]
    message = f"its {int(count.max())} charts do not fit pages of {packer.page[0]} texels; {hint}"
    return InputError(message, object=name)
