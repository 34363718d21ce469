"""Builds the table of BLEND triangles: the data from which their transmittance is computed."""

from __future__ import annotations

from typing import Any

import numpy as np

from baker.kernels.alpha import ALPHA, ALPHA_EDGE_1, ALPHA_EDGE_2, CUTOFF
from baker.kernels.shading import Shading
from baker.kernels.textures import TexturePack, value_limits
from baker.kernels.transmittance import COLOUR, COLOUR_EDGE_1, COLOUR_EDGE_2, ROW_LENGTH, TransmittanceTable
from baker.trace.embree import HitFilter


def build_transmittance_table(shading: Shading) -> TransmittanceTable | None:
    """Find the BLEND triangles, except those whose alpha is 0 everywhere.

    Parameters
    ----------
    shading : Shading
        Materials.

    Returns
    -------
    TransmittanceTable or None
        None without any.
    """
    alpha = shading.alpha
    # Rows are in the order of triangles.
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
    # Triangles whose alpha is 0 everywhere do nothing, whatever their colour.
    has_alpha = (alpha.row[:, CUTOFF] < 0) & (highest > 0)
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
    return TransmittanceTable(slot, row, bool((has_alpha & ~white).any()))


def transmittance_filter(shading: Shading, table: TransmittanceTable | None) -> HitFilter | None:
    """Return the filter that multiplies colours in the tree of BLEND triangles, None without any.

    Parameters
    ----------
    shading : Shading
        Materials.
    table : TransmittanceTable or None
        `build_transmittance_table` of the same.

    Returns
    -------
    HitFilter or None
        For `RayScene`.
    """
    if table is None:
        return None
    # Loading the compiled function takes time: only scenes that need it do so.
    from baker.shading.kernels.transmittance_filter import filter_of

    return filter_of(table, shading.pack)


def _limits(pack: TexturePack, k: int) -> tuple[np.ndarray[Any, Any], float]:
    """Return the smallest RGB (3,) in texture k, and its largest alpha; ones for no texture."""
    if k < 0:
        return np.ones(3, np.float32), 1.0
    (red, green, blue, _), (_, _, _, alpha) = value_limits(pack, k)
    return np.array([red, green, blue]), float(alpha)
