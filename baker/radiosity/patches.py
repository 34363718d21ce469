"""Groups texels into patches: blocks of texels of one chart with similar normals.

Patches are the surface elements of the radiosity solve. Texels inside narrow gaps and texels outside gaps
belong to different patches. In gaps about a texel wide, light reaches only a few gap widths deep, but a patch
has a single radiosity. Therefore each texel in such a gap is a separate patch, if at most `max_patches`
texels lie in gaps of this width.

Based on: Hanrahan, Salzman and Aupperle, A rapid hierarchical radiosity algorithm, 1991 (distant transport
needs no fine elements); Smits, Arvo and Greenberg, A clustering algorithm for radiosity in complex
environments, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.budget import MAX_PATCHES
from baker.core.texels import TexelBuffer
from baker.radiosity.kernels.regions import join_linked

# Smallest gap level, 0 to 2 (`radiosity.narrow_gaps`), of texels that may get smaller blocks.
NARROW = 2


@dataclass(frozen=True)
class PatchSet:
    """The division of the n texel entries (rows of `TexelBuffer`) into P patches.

    Attributes
    ----------
    patch : (n,) int32
        Patch of each entry.
    first : (P + 1,) int64
        Patch p has the entries `member[first[p] : first[p + 1]]`.
    member : (n,) int32
        Entries of all patches, ascending within a patch.
    cumulative : (n,) float32
        For each entry of `member`: the area of this entry and of the entries before it in the patch, divided
        by the patch's area.
    area : (P,) float64, m2
        Area of each patch.
    block : int
        Side of a block outside narrow gaps, texels.
    """

    patch: NDArray[np.int32]
    first: NDArray[np.int64]
    member: NDArray[np.int32]
    cumulative: NDArray[np.float32]
    area: NDArray[np.float64]
    block: int

    @property
    def n(self) -> int:
        """Return the number of patches."""
        return len(self.area)

    def mean(self, value: NDArray[np.float32], weight: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return (P, C) float64: the weighted mean of the entries' values over each patch.

        value : (n, C) float32; weight : (n,) float32
        """
        total = np.bincount(self.patch, weight, self.n)
        columns = [
            np.bincount(self.patch, weight * value[:, c].astype(np.float64), self.n)
            for c in range(value.shape[1])
        ]
        return np.stack(columns, axis=1) / np.maximum(total, 1e-300)[:, None]


def build_patches(
    texels: TexelBuffer,
    level: NDArray[np.uint8] | None = None,
    *,
    max_patches: int = MAX_PATCHES,
    link: NDArray[np.int32] | None = None,
) -> PatchSet:
    """Group texel entries into patches: square blocks whose side is a power of two.

    The side is the smallest that gives at most `max_patches` blocks, but at most 256 texels. No patch
    contains texels of two charts, so an atlas of very many charts may have more than `max_patches` patches.

    Parameters
    ----------
    texels : TexelBuffer
        The n entries.
    level : (n,) uint8, optional
        Gap level, 0 to 2 (`radiosity.narrow_gaps`); 0 if omitted. Entries of different levels belong to
        different patches. Entries of level 2 may form smaller blocks, which add at most about `max_patches`
        patches.
    max_patches : int
        Intended largest number of patches, without the additional patches in narrow gaps.
    link : (m, 2) int32, optional
        Linked pairs of neighbouring entries (`radiosity.sides.Sides.link`). In charts with such pairs, a
        block is split into the parts that the pairs connect.

    Returns
    -------
    PatchSet
        Patches in the order of their first entries.
    """
    level = np.zeros(len(texels.pixel), np.uint8) if level is None else level
    block = _smallest_block(texels, level, np.arange(len(level)), max_patches)
    narrow = np.flatnonzero(level >= NARROW)
    side = np.full(len(level), block, np.int64)
    side[narrow] = min(_smallest_block(texels, level, narrow, max_patches), block)
    number, n_patches = _blocks(texels, level, side, link)
    order = np.argsort(number, kind="stable").astype(np.int32)
    first = np.zeros(n_patches + 1, np.int64)
    np.cumsum(np.bincount(number, minlength=n_patches), out=first[1:])
    # Give a texel without area (on a sliver) a small area, so that no patch has area 0.
    weight = np.maximum(texels.area, 1e-12).astype(np.float64)
    area = np.bincount(number, weight, n_patches).astype(np.float64)
    running = np.cumsum(weight[order])
    before = np.concatenate([[0.0], running])[first[:-1]]
    owner = np.repeat(np.arange(n_patches), np.diff(first))
    cumulative = (running - before[owner]) / area[owner]
    return PatchSet(number, first, order, cumulative.astype(np.float32), area, block)


def _smallest_block(
    texels: TexelBuffer, level: NDArray[np.uint8], chosen: NDArray[np.int64], max_patches: int
) -> int:
    """Return the smallest block side, texels, that gives at most `max_patches` blocks of chosen entries.

    chosen : (m,) int64, entries
    """
    # With blocks of one texel, each entry is a patch.
    if len(chosen) <= max_patches:
        return 1
    block = 2
    while block < 256:
        key = _keys(texels, level, np.full(len(level), block, np.int64))
        if len(np.unique(key[chosen])) <= max_patches:
            break
        block *= 2
    return block


def _keys(texels: TexelBuffer, level: NDArray[np.uint8], side: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (n,) int64: a key for each entry, equal for the entries of one block.

    level : (n,) uint8, gap level; side : (n,) int64, side of the block at each entry, texels
    """
    size = texels.resolution
    page, rest = np.divmod(texels.pixel, size * size)
    row, column = np.divmod(rest, size)
    # Quantise normals to 26 directions, the axes and diagonals. The factor 1.2 keeps axis-aligned and
    # diagonal normals away from the rounding thresholds, so that their surfaces are not split.
    facing = np.rint(texels.normal.astype(np.float64) * 1.2).astype(np.int64) + 1
    direction = (facing[:, 0] * 3 + facing[:, 1]) * 3 + facing[:, 2]
    key = (page * size + row // side) * size + column // side
    key = (key * (int(texels.chart.max(initial=0)) + 1) + texels.chart) * 162
    return np.asarray(key + (direction * 2 + texels.back) * 3 + level, np.int64)


def _blocks(
    texels: TexelBuffer,
    level: NDArray[np.uint8],
    side: NDArray[np.int64],
    link: NDArray[np.int32] | None,
) -> tuple[NDArray[np.int32], int]:
    """Return the patch number of each entry, (n,) int32, and the number of patches.

    level, side : see `_keys`; link : see `build_patches`
    """
    _, first, inverse = np.unique(_keys(texels, level, side), return_index=True, return_inverse=True)
    block = inverse.reshape(-1)
    if link is not None and len(link):
        within = link[block[link[:, 0]] == block[link[:, 1]]]
        root = np.arange(len(block), dtype=np.int32)
        join_linked(within, root)
        linked = np.zeros(int(texels.chart.max()) + 1, bool)
        linked[texels.chart[link[:, 0]]] = True
        # Do not split blocks of charts without links, because no surface cuts these charts.
        root = np.where(linked[texels.chart], root, first[block].astype(np.int32))
        _, first, inverse = np.unique(root, return_index=True, return_inverse=True)
        block = inverse.reshape(-1)
    rank = np.zeros(len(first), np.int32)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first), dtype=np.int32)
    return rank[block], len(first)
