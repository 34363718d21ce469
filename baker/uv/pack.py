"""Packs outlines into one square page, and finds the largest density at which they fit.

In this file, texel centres have integer coordinates. The lower corner of an outline is at a texel centre, so
that lookups at straight borders of charts need no interpolation between texels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baker.core.progress import Progress, report
from baker.core.stage import Stage

# Number of items to place times number of texels of the page, after which `progress` is called again.
_CHUNK_WORK = 1 << 29


class BlockSizes(Protocol):
    """The sizes of blocks, which are rectangles of packed charts; see `baker.uv.blocks`.

    The size of a block is not proportional to the density, because the gaps between its charts are constant.
    """

    @property
    def shape(self) -> NDArray[np.int64]:
        """Return the indices (B,) of the shapes that are blocks."""

    def scale(self, density: NDArray[np.float64], page: tuple[int, int]) -> NDArray[np.float64]:
        """Return the scale (B, 2) float64 of each block along u and v, texels per metre.

        density : (B,) float64, texels per metre; page : (resolution, gap), see `pack`
        """


@dataclass(frozen=True)
class Shapes:
    """S outlines to pack, as triangles. Several items may have the same outline.

    Attributes
    ----------
    corner : (T, 3, 2) float64, metres
        Corners of the triangles of all shapes. The lower corner of each shape's bounding box is at 0.
    first_triangle : (S + 1,) int64
        Shape s has the triangles `first_triangle[s]` to `first_triangle[s + 1]` - 1.
    extent : (S, 2) float64, metres
        Width and height of each shape's bounding box.
    area : (S,) float64, square metres
        Area of each shape's triangles.
    rigid : (S,) bool
        Whether the shape is scaled uniformly. Other shapes are stretched so that their width and height are
        whole numbers of texels.
    blocks : BlockSizes or None
        Sizes of the shapes that are blocks; None if there are no blocks.
    """

    corner: NDArray[np.float64]
    first_triangle: NDArray[np.int64]
    extent: NDArray[np.float64]
    area: NDArray[np.float64]
    rigid: NDArray[np.bool_]
    blocks: BlockSizes | None = None

    def scale(self, density: NDArray[np.float64], page: tuple[int, int]) -> NDArray[np.float64]:
        """Return the scale (S, 2) float64 of each shape along u and v, texels per metre.

        density : (S,) float64, texels per metre, target density of each shape
        page : (resolution, gap), see `pack`
        """
        wanted = self.extent * density[:, None]
        whole = np.maximum(np.round(wanted), 1.0)
        snapped = np.divide(whole, self.extent, out=np.ones_like(whole), where=self.extent > 1e-12)
        scale = np.where(self.rigid[:, None] | (self.extent <= 1e-12), density[:, None], snapped)
        if self.blocks is not None:
            scale[self.blocks.shape] = self.blocks.scale(density[self.blocks.shape], page)
        return scale


@dataclass(frozen=True)
class Packing:
    """Positions of I items in a page.

    Attributes
    ----------
    position : (I, 2) int32
        Column and row of each item's lower corner.
    scale : (S, 2) float64, texels per metre
        Scale of each shape along u and v.
    height : int
        Number of rows in use, including the page border.
    placed : int
        Number of items that were placed; I if the packing is complete.
    placed_area : float
        Area of the placed items divided by the area of all items, gaps included.
    gap : int
        Number of empty texels between items.
    """

    position: NDArray[np.int32]
    scale: NDArray[np.float64]
    height: int
    placed: int
    placed_area: float
    gap: int


def border(gap: int) -> int:
    """Return the width of a page's empty border, texels.

    It is half the gap between outlines, so that there is a whole gap if the page is repeated.
    """
    return max(1, (gap + 1) // 2)


def texel_gap(padding: int) -> int:
    """Return the number of empty texels between outlines: `padding`, but at least 2.

    2 is the minimum, because bilinear lookup reads one texel beyond each outline.
    """
    return max(2, padding)


def pack(
    shapes: Shapes,
    item_shape: NDArray[np.int64],
    density: NDArray[np.float64],
    page: tuple[int, int],
    progress: Progress,
    fraction: float,
) -> Packing:
    """Pack items at given densities.

    Parameters
    ----------
    shapes : Shapes
        The S outlines.
    item_shape : (I,) int64
        Shape of each item.
    density : (S,) float64, texels per metre
        Density of each shape.
    page : (resolution, gap)
        Width and height of the page, and number of empty texels between items.
    progress : Progress
        Called with `fraction`.
    fraction : float
        Fraction of the stage.

    Returns
    -------
    Packing
        Positions of the items. The packing is incomplete if not all items fit.
    """
    resolution, gap = page
    margin = border(gap)
    scale = shapes.scale(density, page)
    n_columns, n_rows = texel_size(shapes, scale)
    used = np.unique(item_shape)
    if (np.maximum(n_rows, n_columns)[used] > resolution - 2 * margin).any():
        return Packing(np.zeros((len(item_shape), 2), np.int32), scale, resolution, 0, 0.0, gap)
    canvas = (resolution, resolution, margin)
    return place_on_canvas(shapes, item_shape, scale, canvas, gap, progress, fraction)


def texel_size(shapes: Shapes, scale: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of columns and of rows (S,) int64 of texels that each shape touches.

    scale : (S, 2) float64, texels per metre
    """
    size = np.floor(shapes.extent * scale + 0.5 + 1e-9).astype(np.int64) + 1
    return size[:, 0], size[:, 1]


def place_on_canvas(
    shapes: Shapes,
    item_shape: NDArray[np.int64],
    scale: NDArray[np.float64],
    canvas: tuple[int, int, int],
    gap: int,
    progress: Progress,
    fraction: float,
) -> Packing:
    """Place items of given scales on a canvas, from the lowest row up.

    Parameters
    ----------
    shapes : Shapes
        The S outlines.
    item_shape : (I,) int64
        Shape of each item.
    scale : (S, 2) float64, texels per metre
        Scale of each shape along u and v.
    canvas : (width, height, margin)
        Columns and rows of the canvas, and number of empty texels along its border.
    gap : int
        Number of empty texels between items.
    progress : Progress
        Called with `fraction`.
    fraction : float
        Fraction of the stage.

    Returns
    -------
    Packing
        Positions of the items. The packing is incomplete if not all items fit.
    """
    from baker.uv.kernels.uv_pack import place_items

    width, height, margin = canvas
    n_columns, n_rows = texel_size(shapes, scale)
    position = np.zeros((len(item_shape), 2), np.int32)
    first_row, low, high = _spans(shapes, scale, n_rows, np.unique(item_shape))
    free = np.arange(width + 1, dtype=np.int16)
    next_free = np.tile(free, (height, 1))
    next_used = np.full((height, width + 1), width, np.int16)
    order = np.lexsort((np.arange(len(item_shape)), item_shape, -n_columns[item_shape], -n_rows[item_shape]))
    lowest = np.full(len(n_rows), margin, np.int64)
    placed = 0
    step = max(16, _CHUNK_WORK // (width * height))
    for start in range(0, len(order), step):
        report(progress, Stage.UNWRAP, fraction)
        chunk = order[start : start + step]
        count = place_items(
            next_used, next_free, chunk, item_shape, first_row, low, high, gap, margin, lowest, position
        )
        placed += count
        if count < len(chunk):
            break
    done = order[:placed]
    top = position[done, 1] + n_rows[item_shape[done]]
    weight = (n_rows + gap) * (n_columns + gap)
    share = weight[item_shape[done]].sum() / max(1, weight[item_shape].sum())
    return Packing(position, scale, int(top.max(initial=0)) + margin, placed, float(share), gap)


def _spans(
    shapes: Shapes, scale: NDArray[np.float64], n_rows: NDArray[np.int64], used: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.int32]]:
    """Return the first and the last column of each row of the shapes `used`.

    scale : (S, 2), texels per metre; n_rows : (S,), number of rows of each shape; used : indices of shapes
    Returns `first_row` (S + 1,), `low` (R,) and `high` (R,), see `outline_spans`.
    """
    from baker.uv.kernels.uv_pack import outline_spans

    rows = np.zeros(len(n_rows), np.int64)
    rows[used] = n_rows[used]
    first_row = np.concatenate([[0], np.cumsum(rows)])
    low = np.full(int(first_row[-1]), 1 << 28, np.int32)
    high = np.full(int(first_row[-1]), -1, np.int32)
    outline_spans(shapes.corner, shapes.first_triangle, used, scale, first_row, low, high)
    return first_row, low, high


def fit_page(
    shapes: Shapes,
    item_shape: NDArray[np.int64],
    page: tuple[int, int],
    progress: Progress,
    span: tuple[float, float],
    most: float = np.inf,
) -> tuple[float, Packing] | None:
    """Search the largest density at which all items fit into one page.

    The search ends after 12 attempts, or if the density is known to 0.4 %. With 3000 or more items, it ends
    after 7 attempts, or if the density is known to 1.5 %.

    Parameters
    ----------
    shapes : Shapes
        The outlines.
    item_shape : (I,) int64
        Shape of each item.
    page : (resolution, gap)
        Width and height of the page, and number of empty texels between items.
    progress : Progress
        Called with fractions of the stage.
    span : (float, float)
        First and last fraction of the stage to report.
    most : float
        Upper limit of the density, texels per metre.

    Returns
    -------
    (density, Packing) or None
        The density, texels per metre, and the packing. None if no tested density fits.
    """
    resolution, gap = page
    inner = resolution - 2 * border(gap)
    n = len(shapes.extent)
    widest = float(shapes.extent[item_shape].max())
    ceiling = min(most, (inner - 1) / max(widest, 1e-12))
    guess = min(ceiling, _estimate(shapes, item_shape, inner, gap))
    tolerance, n_tries = (0.004, 12) if len(item_shape) < 3000 else (0.015, 7)
    low, high = 0.0, ceiling * (1 + 1e-9)
    best: Packing | None = None
    for k in range(n_tries):
        fraction = span[0] + (span[1] - span[0]) * k / n_tries
        result = pack(shapes, item_shape, np.full(n, guess), page, progress, fraction)
        if result.placed == len(item_shape):
            low, best = guess, result
            # Estimate the next density from the unused height: the area grows with the square of the density.
            step = guess * float(np.sqrt(resolution / max(1, result.height))) * 1.003
        else:
            high = guess
            step = guess * float(np.sqrt(max(result.placed_area, 0.1))) * 0.997
        if best is not None and (low >= ceiling or high <= low * (1 + tolerance)):
            break
        if best is None and k >= n_tries - 3:
            # Reduce the density in large steps. Outlines are at least one texel in size, so their area
            # shrinks slowly.
            step = guess / 30.0
        margin = 0.25 * (high - low)
        guess = min(max(step, low + margin), high - margin) if best is not None and high < ceiling else step
        guess = min(guess, ceiling)
    return None if best is None else (low, best)


def _estimate(shapes: Shapes, item_shape: NDArray[np.int64], inner: int, gap: int) -> float:
    """Return the density d, texels per metre, at which outlines and gaps fill 85 % of the page.

    d solves sum (w d + 1 + g) (h d + 1 + g) = 0.85 inner^2. The sum is over all items. w and h are width and
    height of an item, metres. g is the gap, texels. The area of the item replaces the product w h.
    If the gaps alone fill 85 % of the page, d is the density at which the largest side of an item is
    0.5 inner / sqrt(number of items) texels.
    """
    area = float(shapes.area[item_shape].sum())
    half = float(shapes.extent[item_shape].sum()) * (1 + gap)
    rest = len(item_shape) * (1 + gap) ** 2 - 0.85 * inner * inner
    if rest >= 0:
        return (
            0.5 * inner / max(float(shapes.extent[item_shape].max()), 1e-12) / float(np.sqrt(len(item_shape)))
        )
    root = float(np.sqrt(half * half - 4 * area * rest))
    return float(2 * -rest / max(half + root, 1e-12))
