"""Finds values of `resolution`, `max_pages` and `density` with which all objects fit their pages.

Each value is tested by packing, so a bake that changes only this setting to the value succeeds.
"""

from __future__ import annotations

import math
from typing import Protocol

# Largest values of the settings `resolution` and `max_pages`.
LARGEST_PAGE, _MOST_PAGES = 16384, 256
# Suggested page widths are multiples of this number of texels.
_STEP = 64
# Number of values that are tested for a setting, and factors between these values.
_TRIES = 8
_WIDER, _COARSER = 1.12, 0.97


class PagesAt(Protocol):
    """Packs all objects to count the pages that they need."""

    def __call__(self, resolution: int, density: float, max_pages: int) -> int | None:
        """Return the number of pages; None if the objects do not fit `max_pages` pages at this density."""


def fit_advice(
    pages_at: PagesAt, resolution: int, density: float, max_pages: int, found: float, reserved: int = 0
) -> str:
    """Return settings with which all objects fit, as the end of a sentence.

    Parameters
    ----------
    pages_at : PagesAt
        Counts pages.
    resolution : int
        Width of a page that is too small, texels.
    density : float
        Density that does not fit, texels per metre.
    max_pages : int
        Number of pages that does not suffice.
    found : float
        A lower density, at which the objects probably fit, texels per metre.
    reserved : int
        Number of pages of other groups of objects, which count for `max_pages`.

    Returns
    -------
    str
        "; `resolution=1536`, `max_pages=4` or `density=12.3` fits", with the settings for which a value was
        found; empty if there is none.
    """
    values = {
        "resolution": _width(pages_at, resolution, density, max_pages, found),
        "max_pages": _pages(pages_at, resolution, density, max_pages, reserved),
        "density": _density(pages_at, resolution, max_pages, found),
    }
    named = [f"`{name}={value}`" for name, value in values.items() if value is not None]
    if not named:
        return ""
    return f"; {' or '.join(filter(None, (', '.join(named[:-1]), named[-1])))} fits"


def _width(pages_at: PagesAt, resolution: int, density: float, max_pages: int, found: float) -> int | None:
    """Return a width at which the objects fit, None if none of the tested ones does."""
    width = resolution * density / max(found, 1e-12)
    for _ in range(_TRIES):
        rounded = _STEP * math.ceil(width / _STEP)
        if rounded > LARGEST_PAGE:
            return None
        if pages_at(rounded, density, max_pages) is not None:
            return rounded
        width = max(width * _WIDER, rounded + 1)
    return None


def _pages(pages_at: PagesAt, resolution: int, density: float, max_pages: int, reserved: int) -> int | None:
    """Return the number of pages that the objects need, None if it is too large."""
    if max_pages + reserved >= _MOST_PAGES:
        return None
    number = pages_at(resolution, density, _MOST_PAGES - reserved)
    return None if number is None else number + reserved


def _density(pages_at: PagesAt, resolution: int, max_pages: int, found: float) -> str | None:
    """Return a density with three digits at which the objects fit, None if none of the tested ones does."""
    for k in range(_TRIES):
        lower = found * _COARSER**k
        digits = 2 - math.floor(math.log10(lower))
        rounded = math.floor(lower * 10.0**digits) / 10.0**digits
        if rounded > 0.0 and pages_at(resolution, rounded, max_pages) is not None:
            return f"{rounded:.3g}"
    return None
