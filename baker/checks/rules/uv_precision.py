"""Reports lightmap uv whose numbers are stored too coarsely for the resolution of the page."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.rule import check
from baker.checks.rules.uv_layout import laid_out
from baker.core.readable import number

# Smallest number of different uv values from which rounding is recognised.
_FEWEST_VALUES = 16
# Numbers of bits that are tried, and the largest distance of a value from a multiple of the rounding step, as
# a share of the step.
_BITS, _SLACK = range(6, 15), 0.02
# Spacing of half floats between 0.5 and 1.
_HALF_SPACING = 2.0**-11


@check(
    "uv.precision",
    group="uv",
    severity="warning",
    fix="export TEXCOORD_1 as float or with 16 bits (an option of Draco and gltfpack), or lower `resolution`",
)
def uv_precision(context: CheckContext) -> Iterator[RawFinding]:
    """A lightmap uv whose numbers are rounded more coarsely than the size of a texel.

    Compression rounds uv to few bits: Draco and gltfpack to 12 bits by default, half floats to 11. Charts
    then shift against the light by up to half a step, and seams become visible. The rule recognises half
    floats, and 6 to 14 bits over 0..1 or over the range of the layout.
    """
    size = context.settings.resolution
    for m, uv in laid_out(context):
        found = _rounding(uv.uv.reshape(-1, 2))
        if found is not None and found[0] * size > 1.0:
            step, what = found
            coarse = f"steps of {number(step * size)} texels of a page of {size}"
            text = f"its TEXCOORD_1 is rounded to {what}: {coarse}"
            yield RawFinding(text, context.location(m), len(uv.rows), more={"step": step})


def _rounding(uv: NDArray[np.float64]) -> tuple[float, str] | None:
    """Return the largest step of rounded uv (n, 2) and a description, or None if no rounding is found."""
    values = np.unique(uv)
    if len(values) < _FEWEST_VALUES:
        return None
    if _is_half(values):
        return float(np.spacing(np.float16(0.999 * values[-1]))), "half floats"
    low, high = uv.min(axis=0), uv.max(axis=0)
    wide = float((high - low).max())
    for bits in _BITS:
        steps = 2**bits - 1
        for start, width in ((np.zeros(2), 1.0), (low, wide)):
            level = (uv - start) / max(width, 1e-30) * steps
            whole = np.rint(level)
            if np.abs(level - whole).max() > _SLACK:
                continue
            # Ignore a coarser regular grid, whose values use only every k-th of these levels.
            used = np.unique(whole.astype(np.int64))
            if len(used) >= _FEWEST_VALUES and np.gcd.reduce(used) == 1:
                return width / steps, f"{bits} bits"
    return None


def _is_half(values: NDArray[np.float64]) -> bool:
    """Return whether all values are half floats, and some are not multiples of `_HALF_SPACING`."""
    if not (values == values.astype(np.float16)).all():
        return False
    # If all values are multiples of `_HALF_SPACING`, they may be a regular grid instead of half floats.
    return bool((np.abs(values / _HALF_SPACING - np.rint(values / _HALF_SPACING)) > 0).any())
