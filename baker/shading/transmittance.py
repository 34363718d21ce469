"""Which triangles let a share of light through, and which of them colour it."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.kernels.alpha import ALPHA, CUTOFF
from baker.kernels.shading import Shading
from baker.kernels.textures import TexturePack
from baker.kernels.transmittance import COLOUR, ROW_LENGTH, TransmittanceTable
from baker.trace.embree import HitFilter


def build_transmittance_table(shading: Shading) -> TransmittanceTable | None:
    """Find the BLEND triangles, but for those without alpha anywhere; None if there are none.

    Parameters
    ----------
    shading : Shading
        Materials as kernels see them.
    """
    alpha = shading.alpha
    # Rows lie in the order of triangles.
    triangle = np.flatnonzero(alpha.slot >= 0)
    if not len(triangle):
        return None
    material = shading.material[triangle]
    base = np.broadcast_to(shading.base[material][:, None], (len(triangle), 3, 3))
    colour = base if len(shading.colour) == 1 else base * shading.colour[shading.triangle[triangle]]
    limits = [_limits(shading.pack, int(k)) for k in shading.base_texture]
    darkest = np.array([least for least, _ in limits], np.float32)[material]
    corner_alpha = alpha.row[:, [ALPHA]] + np.pad(alpha.row[:, ALPHA + 1 : ALPHA + 3], ((0, 0), (1, 0)))
    most = corner_alpha.max(axis=1) * np.array([most for _, most in limits], np.float32)[material]
    white = (colour.min(axis=1) * darkest >= 1.0).all(axis=1)
    # What has no alpha anywhere is not there, whatever its colour.
    there = (alpha.row[:, CUTOFF] < 0) & (most > 0)
    chosen = np.flatnonzero(there)
    if not len(chosen):
        return None
    slot = np.full(len(alpha.slot), -1, np.int32)
    slot[triangle[chosen]] = np.arange(len(chosen), dtype=np.int32)
    row = np.zeros((len(chosen), ROW_LENGTH), np.float32)
    row[:, :COLOUR] = alpha.row[chosen, :COLOUR]
    corner = colour[chosen]
    row[:, COLOUR : COLOUR + 3] = corner[:, 0]
    row[:, COLOUR + 3 : COLOUR + 6] = corner[:, 1] - corner[:, 0]
    row[:, COLOUR + 6 : COLOUR + 9] = corner[:, 2] - corner[:, 0]
    return TransmittanceTable(slot, row, bool((there & ~white).any()))


def transmittance_filter(shading: Shading, table: TransmittanceTable | None) -> HitFilter | None:
    """Return what the ray tree has to know of triangles that let a share of light through, None without any.

    Parameters
    ----------
    shading : Shading
        Materials as kernels see them.
    table : TransmittanceTable or None
        `build_transmittance_table` of the same.
    """
    if table is None:
        return None
    # Loading the compiled function takes time that other scenes need not spend.
    from baker.shading.kernels.transmittance_filter import filter_of

    return filter_of(table, shading.pack)


def _limits(pack: TexturePack, k: int) -> tuple[np.ndarray[Any, Any], float]:
    """Return the smallest value of each colour in texture k (3,) and its largest alpha; ones for none."""
    if k < 0:
        return np.ones(3, np.float32), 1.0
    offset, width, height = (int(x) for x in pack.level[k, 0])
    pixels = pack.pixels[offset : offset + width * height]
    return pixels[:, :3].min(axis=0, initial=1.0), float(pixels[:, 3].max(initial=0.0))
