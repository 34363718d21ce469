"""Packs the charts of a mesh once, as a block, for all instances that share its TEXCOORD_1.

A block is a rectangle in a page. All blocks of a layout have the same charts at the same places, up to one
factor. The smallest block has charts of whole texels and the gap of the page between them; larger blocks are
enlarged copies of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress
from baker.uv.charts import MeshCharts
from baker.uv.outlines import BlockInstance, CutInstance, Outlines, Placement, make_outlines, place_uv
from baker.uv.pack import Packing, place_on_canvas, texel_size

# Largest relative difference from a whole number at which the factor of a block is rounded to this number.
# Charts of whole texels then stay charts of whole texels.
_WHOLE = 1e-3
# Widths of a layout to try, divided by that of a square of the same area.
_WIDTHS = (1.0, 1.12, 1.3)
# Fraction of the stage "unwrap" that is reported while blocks are packed.
_FRACTION = 0.7


@dataclass(frozen=True)
class BlockLayout:
    """The charts of a layout, packed at a scale.

    Attributes
    ----------
    per_unit : float
        Texels per unit of the charts' uv.
    packing : Packing
        Positions of the charts; the lowest row and column are 0.
    size : (2,) float64
        Distance between the texel centres at the lower and at the upper corner, texels.
    """

    per_unit: float
    packing: Packing
    size: NDArray[np.float64]

    @property
    def side(self) -> float:
        """Return the number of texels along a TEXCOORD_1 from 0 to 1."""
        return max(float(self.size.max()), 1.0)


@dataclass(frozen=True)
class Blocks:
    """The L layouts of all blocks of a scene; implements `pack.BlockSizes`.

    Attributes
    ----------
    outlines : tuple of Outlines
        The charts of each layout, in units of the charts' uv.
    shape : (B,) int64
        Indices of the shapes that are blocks.
    layout : (B,) int64
        Layout of each block.
    factor : (B,) float64
        Metres per unit of the charts' uv, multiplied by the factor on density.
    extent : (B, 2) float64
        Extents of the shapes, metres.
    progress : Progress
        Called while charts are packed.
    """

    outlines: tuple[Outlines, ...]
    shape: NDArray[np.int64]
    layout: NDArray[np.int64]
    factor: NDArray[np.float64]
    extent: NDArray[np.float64]
    progress: Progress
    _known: dict[tuple[int, float, tuple[int, int]], BlockLayout | None] = field(default_factory=dict)

    def scale(self, density: NDArray[np.float64], page: tuple[int, int]) -> NDArray[np.float64]:
        """Return the scale (B, 2) float64 of each block along u and v, texels per metre.

        Parameters
        ----------
        density : (B,) float64, texels per metre
        page : (resolution, gap)
            Width of the page, and number of empty texels between charts.
        """
        layouts = self.layouts(density, page)
        # A layout that is larger than the page gets a size that does not fit.
        size = np.array([np.full(2, 2.0 * page[0]) if one is None else one.size for one in layouts])
        base = np.array([1.0 if one is None else one.per_unit for one in layouts])
        ratio = block_ratio(density * self.factor, base[self.layout])
        result: NDArray[np.float64] = size[self.layout] * ratio[:, None] / np.maximum(self.extent, 1e-300)
        return result

    def layouts(self, density: NDArray[np.float64], page: tuple[int, int]) -> list[BlockLayout | None]:
        """Return each layout, packed at the scale of its smallest block; None if it is larger than a page.

        Parameters
        ----------
        density : (B,) float64, texels per metre
        page : (resolution, gap)
        """
        base = np.full(len(self.outlines), np.inf)
        np.minimum.at(base, self.layout, density * self.factor)
        for k, per_unit in enumerate(base.tolist()):
            if (k, per_unit, page) not in self._known:
                found = _pack_layout(self.outlines[k], per_unit, page, self.progress)
                self._known[k, per_unit, page] = found
        return [self._known[k, per_unit, page] for k, per_unit in enumerate(base.tolist())]


def block_ratio(per_unit: NDArray[np.float64], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the factor of blocks over the smallest block of their layout.

    Parameters
    ----------
    per_unit : (B,) float64
        Texels per unit of the charts' uv of each block.
    base : (B,) float64
        `BlockLayout.per_unit` of each block's layout.

    Returns
    -------
    (B,) float64
        The quotient. Quotients that are almost whole numbers are rounded.
    """
    ratio = per_unit / base
    whole = np.maximum(np.round(ratio), 1.0)
    return np.where(np.abs(ratio - whole) <= _WHOLE * whole, whole, ratio)


def with_blocks(
    outlines: Outlines,
    placements: Sequence[Placement],
    meshes: Sequence[MeshCharts],
    progress: Progress,
) -> Outlines:
    """Return outlines whose blocks have the sizes of packed charts.

    Parameters
    ----------
    outlines : Outlines
        Result of `make_outlines`.
    placements : sequence of Placement
        Placement of each instance.
    meshes : sequence of MeshCharts
        Charts of each mesh.
    progress : Progress
        Called while charts are packed.

    Returns
    -------
    Outlines
        `outlines` itself if no placement is a `BlockInstance`.
    """
    own: dict[int, BlockInstance] = {}
    charts: dict[int, int] = {}
    for k, placement in enumerate(placements):
        if isinstance(placement, BlockInstance):
            own[int(outlines.item_shape[outlines.first_item[k]])] = placement
            charts[placement.block] = placement.charts
    if not own:
        return outlines
    shape = np.array(sorted(own), np.int64)
    number = {block: k for k, block in enumerate(charts)}
    blocks = Blocks(
        tuple(make_outlines([CutInstance(c, 1.0)], meshes) for c in charts.values()),
        shape,
        np.array([number[own[s].block] for s in shape.tolist()], np.int64),
        np.array([own[s].factor for s in shape.tolist()]),
        outlines.shapes.extent[shape],
        progress,
    )
    return replace(outlines, shapes=replace(outlines.shapes, blocks=blocks))


def layout_uv(outlines: Outlines, charts: MeshCharts, layout: BlockLayout) -> NDArray[np.float32]:
    """Return the TEXCOORD_1 (V', 2) float32 of a layout: 0 to 1 along its longer side.

    Parameters
    ----------
    outlines : Outlines
        The charts of the layout, an element of `Blocks.outlines`.
    charts : MeshCharts
        The same charts.
    layout : BlockLayout
        Their positions.
    """
    packing = layout.packing
    texel = place_uv(outlines, 0, CutInstance(0, 1.0), [charts], packing, packing.position, 1)
    # `place_uv` adds half a texel, so that lower corners are at texel centres.
    return np.clip((texel.astype(np.float64) - 0.5) / layout.side, 0.0, 1.0).astype(np.float32)


def _pack_layout(
    outlines: Outlines, per_unit: float, page: tuple[int, int], progress: Progress
) -> BlockLayout | None:
    """Pack the charts of a layout into a small rectangle; return None if it is larger than a page."""
    resolution, gap = page
    shapes, item_shape = outlines.shapes, outlines.item_shape
    scale = shapes.scale(np.full(len(shapes.extent), per_unit), page)
    n_columns, n_rows = texel_size(shapes, scale)
    widest = int(n_columns[item_shape].max())
    area = float(((n_columns + gap) * (n_rows + gap))[item_shape].astype(np.float64).sum())
    if widest > resolution or area > 2.0 * resolution**2:
        return None
    best: tuple[int, Packing, int] | None = None
    for factor in _WIDTHS if len(item_shape) > 1 else (1.0,):
        width = min(max(widest, int(factor * np.sqrt(area))), resolution)
        height = int(area / width) + int(n_rows[item_shape].max()) + gap
        packing = place_on_canvas(shapes, item_shape, scale, (width, height, 0), gap, progress, _FRACTION)
        while packing.placed < len(item_shape):
            height *= 2
            packing = place_on_canvas(shapes, item_shape, scale, (width, height, 0), gap, progress, _FRACTION)
        right = int((packing.position[:, 0] + n_columns[item_shape]).max())
        cost = (right + gap) * (packing.height + gap)
        if best is None or cost < best[0]:
            best = (cost, packing, right)
    assert best is not None
    return BlockLayout(per_unit, best[1], np.array([best[2] - 1.0, best[1].height - 1.0]))
