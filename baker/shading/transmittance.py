"""Builds the table of BLEND triangles, from which kernels compute transmittance at ray hits."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.kernels.alpha import ALPHA, ALPHA_EDGE_1, ALPHA_EDGE_2, CUTOFF
from baker.kernels.shading import Shading
from baker.kernels.textures import TexturePack, value_limits
from baker.kernels.transmittance import COLOUR, COLOUR_EDGE_1, COLOUR_EDGE_2, ROW_LENGTH, TransmittanceTable
from baker.trace.embree import HitFilter


def build_transmittance_table(shading: Shading) -> TransmittanceTable | None:
    """Find the BLEND triangles that let light through, except those whose alpha is 0 everywhere.

    Parameters
    ----------
    shading : Shading
        Materials.

    Returns
    -------
    TransmittanceTable or None
        None if there are no such triangles.
    """
    alpha = shading.alpha
    # The rows of `alpha.row` are in the order of triangles.
    triangle = np.flatnonzero(alpha.slot >= 0)
    if not len(triangle):
        return None
    material = shading.material[triangle]
    base = np.broadcast_to(shading.base[material][:, None], (len(triangle), 3, 3))
    colour = base if len(shading.colour) == 1 else base * shading.colour[shading.triangle[triangle]]
    limits = [_limits(shading.pack, int(k)) for k in shading.base_texture]
    darkest = np.array([lowest for lowest, _ in limits], np.float32)[material]
    corner_alpha = alpha.row[:, [ALPHA]] + np.pad(
        alpha.row[:, ALPHA_EDGE_1 : ALPHA_EDGE_2 + 1], ((0, 0), (1, 0))
    )
    highest = corner_alpha.max(axis=1) * np.array([highest for _, highest in limits], np.float32)[material]
    white = (colour.min(axis=1) * darkest >= 1.0).all(axis=1)
    # Leave out other triangles whose alpha is 0 everywhere: their transmittance is 1 for any colour.
    # A pane has a colour where its alpha is 0, too.
    pane = alpha.row[:, CUTOFF] < -1.0
    has_alpha = (alpha.row[:, CUTOFF] < 0) & ((highest > 0) | pane)
    chosen = np.flatnonzero(has_alpha)
    if not len(chosen):
        return None
    slot = np.full(len(alpha.slot), -1, np.int32)
    slot[triangle[chosen]] = np.arange(len(chosen), dtype=np.int32)
    row = np.zeros((len(chosen), ROW_LENGTH), np.float32)
    row[:, :COLOUR] = alpha.row[chosen, :COLOUR]
    corner = colour[chosen]
    row[:, COLOUR : COLOUR + 3] = corner[:, 0]
    row[:, COLOUR_EDGE_1 : COLOUR_EDGE_1 + 3] = corner[:, 1] - corner[:, 0]
    row[:, COLOUR_EDGE_2 : COLOUR_EDGE_2 + 3] = corner[:, 2] - corner[:, 0]
    return TransmittanceTable(slot, row, bool((has_alpha & (pane | ~white)).any()))


def transmittance_filter(shading: Shading, table: TransmittanceTable | None) -> HitFilter | None:
    """Return the filter that multiplies transmittance at ray hits in the tree of BLEND triangles.

    Parameters
    ----------
    shading : Shading
        Materials.
    table : TransmittanceTable or None
        Result of `build_transmittance_table`.

    Returns
    -------
    HitFilter or None
        Argument `blend_filter` of `RayScene`; None if `table` is None.
    """
    if table is None:
        return None
    # Import the compiled function only if it is needed, because loading it takes time.
    from baker.shading.kernels.transmittance_filter import filter_of

    return filter_of(table, shading.pack)


def _limits(pack: TexturePack, k: int) -> tuple[np.ndarray[Any, Any], float]:
    """Return the smallest R, G and B (3,) and the largest alpha in texture k; ones if k is negative."""
    if k < 0:
        return np.ones(3, np.float32), 1.0
    (red, green, blue, _), (_, _, _, alpha) = value_limits(pack, k)
    return np.array([red, green, blue]), float(alpha)
