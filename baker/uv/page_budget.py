"""Finds the largest density at which all instances fit a given number of pages (the setting `budget`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.readable import percent
from baker.core.scene import SceneWarning
from baker.core.settings import BakeSettings
from baker.uv.page_packer import DensityLimits, Page, PagePacker, alone, distribute

# Share of the pages' area that charts fill in the first attempt; factor between the attempts that look for a
# density that fits and one that does not; largest number of these attempts; number of attempts between the
# two densities.
_FIRST_FILL, _FACTOR, _STEPS, _BISECTIONS = 0.8, 1.12, 24, 4


class _Search:
    """Packs all instances at different densities, and keeps the best result."""

    def __init__(self, packer: PagePacker, names: list[str], n_pages: int, limits: DensityLimits) -> None:
        self.packer, self.names, self.n_pages, self.limits = packer, names, n_pages, limits
        self.best: tuple[float, NDArray[np.float64], list[Page]] | None = None

    def fits(self, density: float) -> bool:
        """Return whether all instances fit at a density; an instance larger than a page gets a lower one."""
        wanted = np.where(self.limits.fixed, 1.0, density)
        each, _ = alone(self.packer, wanted, self.names)
        pages = distribute(self.packer, each, self.n_pages)
        if pages is not None and (self.best is None or density > self.best[0]):
            self.best = (density, each, pages)
        return pages is not None

    def first(self) -> float:
        """Return the density at which the estimated area of all charts is `_FIRST_FILL` of the pages."""
        density = 1.0
        for _ in range(8):
            need = float(self.packer.need(np.where(self.limits.fixed, 1.0, density)).sum())
            density *= float(np.sqrt(_FIRST_FILL * self.n_pages / max(need, 1e-12)))
        return density


def fill_budget(
    packer: PagePacker,
    names: list[str],
    settings: BakeSettings,
    limits: DensityLimits,
    warnings: list[SceneWarning],
) -> list[Page] | None:
    """Pack all instances into `settings.max_pages` pages at the largest density that fits.

    Parameters
    ----------
    packer : PagePacker
        The instances and the size of a page.
    names : list of str
        Names of the instances, for messages.
    settings : BakeSettings
        `max_pages`, and `density` as the upper limit, are read.
    limits : DensityLimits
        Instances with a fixed density.
    warnings : list of SceneWarning
        Receives a warning if the density is below `settings.density`.

    Returns
    -------
    list of Page or None
        At most `settings.max_pages` pages; None if nothing fits.
    """
    wanted, search = settings.density, _Search(packer, names, settings.max_pages, limits)
    if wanted is not None and search.fits(wanted):
        assert search.best is not None
        return search.best[2]
    low = high = min(search.first(), np.inf if wanted is None else wanted)
    for _ in range(_STEPS):
        if search.fits(low):
            break
        high, low = low, low / _FACTOR
    for _ in range(_STEPS if high == low else 0):
        before = None if search.best is None else search.best[1]
        high = high * _FACTOR
        if not search.fits(high):
            break
        low = high
        if before is not None and search.best is not None and np.array_equal(search.best[1], before):
            break  # every instance fills a page
    for _ in range(_BISECTIONS if high > low else 0):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if search.fits(middle) else (low, middle)
    if search.best is None:
        return None
    if wanted is not None:
        found = search.best[0]
        message = (
            f"{settings.budget} texels hold all objects at {found:.4g} texels per metre,"
            f" {percent(found / wanted)} of the {wanted:.4g} asked for;"
            " 'instances' in bake.json has the loss of each object"
        )
        warnings.append(SceneWarning("uv.budget", message))
    return search.best[2]
