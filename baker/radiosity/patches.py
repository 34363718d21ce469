"""Patches: blocks of texels of one chart with similar normals, the unknowns of the solve.

Texels in narrow gaps and texels outside share no patch. Where a gap is about a texel wide, each texel is a
patch if there are not too many: light enters such a gap by a few times its width only, but a larger patch
would have the same radiosity throughout.

Based on: Hanrahan, Salzman and Aupperle, A rapid hierarchical radiosity algorithm, 1991 (the idea that
far transport needs no fine elements); Smits, Arvo and Greenberg, A clustering algorithm for radiosity
in complex environments, 1994.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.budget import MAX_PATCHES
from baker.core.texels import TexelBuffer
from baker.radiosity.kernels.regions import join_linked

# Gap level (`narrow_gaps`) from which blocks are as small as possible.
NARROW = 2


@dataclass(frozen=True)
class PatchSet:
    """Patches over all texel entries (fronts and backs).

    Attributes
    ----------
    patch : (n,) int32
        Patch of each entry.
    first : (P + 1,) int64
        Patch p has the entries `member[first[p] : first[p + 1]]`.
    member : (n,) int32
        Entries of all patches, in rising order within a patch.
    cumulative : (n,) float32
        Running share of the patch's area along `member`.
    area : (P,) float64, m2
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
        """Return the weighted mean over each patch of per-entry values (n, C), as (P, C) float64."""
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
    """Group texels into blocks: the smallest power of two with at most `max_patches` of them.

    A chart smaller than a block still is a patch, so a page of very many charts may have more.

    Parameters
    ----------
    texels : TexelBuffer
        The n entries.
    level : (n,) uint8, optional
        Gap level 0 to 2 (`narrow_gaps`); entries of different level share no patch. Those of level 2 form
        smaller blocks, again at most `max_patches`.
    max_patches : int
        Largest number of patches outside narrow gaps.
    link : (m, 2) int32, optional
        Neighbouring entries that see each other (`sides.Sides.link`): in the charts of these entries, parts
        of a block that are not linked within it are separate patches.

    Returns
    -------
    PatchSet
        In Morton order of their first entries.
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
    # A texel without area (a sliver) gets a small share, so that its patch has an area.
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
    """Return the side of the smallest blocks that cut the chosen entries into at most `max_patches`."""
    # Entries of one side of a page lie in pixels of their own: blocks of one texel are as many as they.
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
    """Return (n,) int64, equal for entries of one block; `side` (n,) is the side of blocks at each entry."""
    size = texels.resolution
    page, rest = np.divmod(texels.pixel, size * size)
    row, column = np.divmod(rest, size)
    # 26 directions: an axis-aligned or diagonal surface is never split by rounding.
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
    """Return the number (n,) of the block, or linked part of one, of each entry, and their count."""
    _, first, inverse = np.unique(_keys(texels, level, side), return_index=True, return_inverse=True)
    block = inverse.reshape(-1)
    if link is not None and len(link):
        within = link[block[link[:, 0]] == block[link[:, 1]]]
        root = np.arange(len(block), dtype=np.int32)
        join_linked(within, root)
        linked = np.zeros(int(texels.chart.max()) + 1, bool)
        linked[texels.chart[link[:, 0]]] = True
        # Blocks of charts without a cut stay whole.
        root = np.where(linked[texels.chart], root, first[block].astype(np.int32))
        _, first, inverse = np.unique(root, return_index=True, return_inverse=True)
        block = inverse.reshape(-1)
    rank = np.zeros(len(first), np.int32)
    rank[np.argsort(first, kind="stable")] = np.arange(len(first), dtype=np.int32)
    return rank[block], len(first)
