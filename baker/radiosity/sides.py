"""Splits texels that another surface passes through, and groups texels into regions.

For example, a floor continues under a wall, or a beam passes through a floor. A texel where the two surfaces
meet has points on both sides of the other surface. A single value per texel would mix the light of both
sides.

Therefore the points of such a texel are grouped by mutual visibility (`radiosity.kernels.sides`). Each group,
called a side, becomes a texel entry (a row of `TexelBuffer`). In general, the side with the most points keeps
the texel's original entry. If this entry is a front, its values are stored in the page. The other sides get
new entries after all backs. The new entries take part in light transport but are not stored in the page.

Neighbouring texels are linked if some of their points are mutually visible. Two unsplit texels are linked
without this test, unless another surface crosses both. The connected parts of a chart are its regions.
Filters of the finished page do not mix values of different regions. If links do not connect all texels of a
block, the block becomes several patches (`radiosity.patches`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.stage import Stage
from baker.core.texels import TexelBuffer
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.kernels.surface import N_POINTS, Surface, place_points
from baker.radiosity.kernels.form_factor import SPLIT
from baker.radiosity.kernels.regions import join_linked, neighbour_pairs
from baker.radiosity.kernels.side_table import SIDE_ROW, SeenLight, SeenPatch, SideTable, no_sides
from baker.radiosity.kernels.sides import (
    count_backs,
    crossed_texels,
    free_segments,
    group_points,
    hidden_corners,
    point_heights,
)
from baker.radiosity.lent_regions import lend_regions
from baker.radiosity.point_cache import points_of
from baker.radiosity.trace_job import TraceJob
from baker.trace.packets import PacketBuffers

# Items per tile: texels that are tested (_TILE), texels whose points are grouped (_SUSPECTS), pairs of
# neighbouring entries (_PAIRS).
_TILE = 4096
# Number of rays that `crossed_texels` casts from a texel that no other surface crosses. Most texels are of
# this kind.
_MOST_RAYS = 8
_SUSPECTS, _PAIRS = 1024, 2048
# The first visibility test of two neighbouring entries uses only point 0 of each entry. The second test uses
# all points.
_ONE = np.zeros((1, 1), np.uint8)
# _MANY_BACKS: limit of the share of a side's rays that hit black backs, the backs of one-sided surfaces.
# Above this limit, the side is treated as outside the model. _OUTSIDE: weight of the points of a side outside
# the model; other points have weight 1.
_MANY_BACKS, _OUTSIDE = 0.25, 0.25
_EVERY = np.arange(N_POINTS, dtype=np.uint8)[None]
_BITS = np.uint32(1) << np.arange(N_POINTS, dtype=np.uint32)


@dataclass(frozen=True)
class Sides:
    """Texel entries after the split of texels that another surface passes through.

    Attributes
    ----------
    texels : TexelBuffer
        All n entries, with the new regions.
    surface : Surface
        The same entries as arrays for kernels.
    valid_points : (n,) uint16
        Bit k is set where point k of an entry is not inside geometry and lies on the entry's side.
    owner : (S,) int32
        Entries of fronts and backs, ascending, whose points form several groups, or that have a corner
        visible from none of their points. These texels are called split.
    member : (K,) int32
        Entries of all sides of the split texels; `SideTable.member` contains indices of this array.
    table : SideTable
        Points of the split texels, from which kernels find the side that a ray hit.
    link : (m, 2) int32
        Linked pairs of neighbouring entries, in charts that another surface cuts.
    rays : int
        Number of rays cast.
    """

    texels: TexelBuffer
    surface: Surface
    valid_points: NDArray[np.uint16]
    owner: NDArray[np.int32]
    member: NDArray[np.int32]
    table: SideTable
    link: NDArray[np.int32]
    rays: int

    def seen_light(self, exitance: NDArray[np.float32]) -> SeenLight:
        """Return the table from which gather rays read the light that a hit texel reflects.

        Parameters
        ----------
        exitance : (n, 4) float32, lx
            RGB that each entry reflects. Column SIDE_ROW is set in place: 1 + row of the split texel in
            `owner`, or 0.
        """
        exitance[:, SIDE_ROW] = 0
        exitance[self.owner, SIDE_ROW] = np.arange(1, len(self.owner) + 1)
        return SeenLight(self.texels.hit_image(exitance), exitance[self.member], self.table)

    def seen_patches(self, patch: NDArray[np.int32]) -> SeenPatch:
        """Return the table from which form-factor rays read the patch of a hit texel.

        patch : (n,) int32, patch of each entry
        """
        marked = np.array(patch)
        marked[self.owner] = SPLIT - np.arange(len(self.owner), dtype=np.int32)
        return SeenPatch(self.texels.hit_image(marked, fill=-1), patch[self.member], self.table)


class _Entries(NamedTuple):
    """All entries after the split; see `Sides`.

    side : (n,) float32, metres, side length of each entry's whole texel
    """

    texels: TexelBuffer
    surface: Surface
    valid_points: NDArray[np.uint16]
    side: NDArray[np.float32]


@dataclass(frozen=True)
class _Groups:
    """The S entries whose points form several groups, or that have a corner visible from none of the points.

    Attributes
    ----------
    owner : (S,) int32, the entries, ascending
    label : (S, 16) int8, group of each point, from 0; -1 for points inside geometry
    point, normal : (S, 16, 3) float32, see `SideTable`
    height : (S, 16) float32, see `SideTable`
    n : int, number of entries before the split
    """

    owner: NDArray[np.int32]
    label: NDArray[np.int8]
    point: NDArray[np.float32]
    normal: NDArray[np.float32]
    height: NDArray[np.float32]
    n: int

    @property
    def count(self) -> NDArray[np.int64]:
        """Return (S,) int64: the number of groups of each entry in `owner`."""
        count: NDArray[np.int64] = self.label.max(axis=1, initial=0).astype(np.int64) + 1
        return count

    def entry(self, row: NDArray[np.int64], group: NDArray[np.int64] | np.int64) -> NDArray[np.int64]:
        """Return the entry of a group of the texel owner[row]; group 0 keeps the texel's old entry."""
        before = np.concatenate([[0], np.cumsum(self.count - 1)])[:-1]
        entry = np.where(group == 0, self.owner[row], self.n + before[row] + group - 1)
        return np.asarray(entry, np.int64)


def split_texels(texels: TexelBuffer, job: TraceJob) -> Sides:
    """Split the texels that another surface passes through.

    Parameters
    ----------
    texels : TexelBuffer
        Fronts and backs, the entries of the job.
    job : TraceJob
        Ray origins and scene. Its `valid_points` exclude points inside geometry.

    Returns
    -------
    Sides
        The entries after the split.
    """
    surface, valid = job.surface, job.valid_points
    n = texels.n
    crossed, side = np.zeros(n, np.uint8), np.zeros(n, np.float32)
    cast = np.zeros(-(-n // _TILE), np.int64)

    def find_crossed(begin: int, end: int) -> None:
        buffers = job.occlusion_buffers(solid=True)
        cast[begin // _TILE] = crossed_texels(surface, begin, end, buffers, crossed, side)

    job.run_here(Stage.TEXEL_SIDES, n, _TILE, find_crossed, rays_per_item=_MOST_RAYS)
    suspect = np.flatnonzero(crossed)
    groups, rays = _group(job, suspect[valid[suspect] != 0], side)
    rays += int(cast.sum())
    entries = _cut(texels, surface, valid, side, groups)
    pair = _of_sides(neighbours(texels, crossed != 0), groups)
    # Test the pairs with a split texel. Also test the pairs of two crossed texels, because a surface exactly
    # between two texels crosses both without splitting them.
    doubtful: NDArray[np.bool_] = np.all(crossed[np.minimum(pair, n - 1)], axis=1)
    doubtful |= (np.isin(pair, groups.owner) | (pair >= n)).any(axis=1)
    connected: NDArray[np.bool_] = np.logical_not(doubtful)
    connected[doubtful], more = _see(job, entries, pair[doubtful])
    rays += more
    if connected.all() and not len(groups.owner):
        return Sides(*entries[:3], groups.owner, groups.owner, no_sides(), pair[:0], rays)
    cut = np.unique(entries.texels.chart[np.concatenate([pair[~connected].reshape(-1), groups.owner])])
    quiet = np.isin(texels.chart, cut) & (crossed == 0)
    seen = pair[connected & np.isin(entries.texels.chart[pair[:, 0]], cut)]
    link = np.concatenate([seen, neighbours(texels, quiet, both=True)])
    backs, more = _back_share(job, entries, groups)
    return _keep_largest(entries, groups, link, cut, backs, rays + more)


def _group(job: TraceJob, chosen: NDArray[np.int64], side: NDArray[np.float32]) -> tuple[_Groups, int]:
    """Group the points of the chosen entries; return the entries to split, and the number of rays cast.

    chosen : (m,) int64, entries; side : (n,) float32, metres, side length of each entry's texel
    """
    surface, valid, n = job.surface, job.valid_points, job.n
    parts: dict[int, tuple[_Groups, int]] = {}

    def work(begin: int, end: int) -> None:
        own = chosen[begin:end]
        point, normal = points_of(surface, valid, own)
        buffers, label = job.occlusion_buffers(solid=True), np.zeros(point.shape[:2], np.int8)
        height = _with_heights(point, normal, side[own], buffers)[2].reshape(label.shape)
        cast = group_points(point, normal, height, valid[own], buffers, label)
        several = label.max(axis=1, initial=0) > 0
        whole = np.flatnonzero(~several)
        one, hidden = own[whole], np.zeros(len(whole), np.uint8)
        cast += hidden_corners(
            surface, one, point[whole], normal[whole], height[whole], valid[one], side[one], buffers, hidden
        )
        several[whole] = hidden != 0
        found = _Groups(
            own[several].astype(np.int32), label[several], point[several], normal[several], height[several], n
        )
        parts[begin] = found, cast + N_POINTS * len(own)

    job.run_here(Stage.TEXEL_SIDES, len(chosen), _SUSPECTS, work)
    ordered = [parts[begin] for begin in sorted(parts)]
    table = no_sides()
    none = _Groups(
        np.zeros(0, np.int32), table.member.astype(np.int8), table.point, table.normal, table.height, n
    )
    found = [none, *(part for part, _ in ordered)]
    return _Groups(
        np.concatenate([part.owner for part in found]),
        np.concatenate([part.label for part in found]),
        np.concatenate([part.point for part in found]),
        np.concatenate([part.normal for part in found]),
        np.concatenate([part.height for part in found]),
        n,
    ), sum(rays for _, rays in ordered)


def _with_heights(
    point: NDArray[np.float32], normal: NDArray[np.float32], side: NDArray[np.float32], buffers: PacketBuffers
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return points and normals, flattened to (m * w, 3), and the heights (m * w,) from `point_heights`.

    point, normal : (m, w, 3) float32; side : (m,) float32, metres, side length of each texel
    """
    height = np.zeros(point.shape[0] * point.shape[1], np.float32)
    flat, up = point.reshape(-1, 3), normal.reshape(-1, 3)
    point_heights(flat, up, np.repeat(side, point.shape[1]), buffers, height)
    return flat, up, height


def _cut(
    texels: TexelBuffer,
    surface: Surface,
    valid_points: NDArray[np.uint16],
    side: NDArray[np.float32],
    groups: _Groups,
) -> _Entries:
    """Return the entries after the split: group 0 keeps its texel's entry, other groups get new entries.

    side : (n,) float32, metres, side length of each entry's texel
    """
    extra = np.repeat(groups.owner, groups.count - 1)
    row, label = np.nonzero(groups.label >= 0)
    entry = groups.entry(row, groups.label[row, label].astype(np.int64))
    bits = np.bincount(entry, _BITS[label], texels.n + len(extra)).astype(np.uint16)
    valid_points = np.concatenate([valid_points, np.zeros(len(extra), np.uint16)])
    valid_points[entry] = bits[entry]
    texels = texels.with_copies(extra)
    front = np.concatenate([surface.front, surface.front[extra]])
    surface = surface._replace(pixel=texels.pixel, back=texels.back, front=front)
    return _Entries(texels, surface, valid_points, np.concatenate([side, side[extra]]))


def neighbours(texels: TexelBuffer, chosen: NDArray[np.bool_], *, both: bool = False) -> NDArray[np.int32]:
    """Return pairs of entries of one chart whose texels share an edge, both fronts or both backs.

    Parameters
    ----------
    texels : TexelBuffer
        Fronts and backs.
    chosen : (n,) bool
        Chosen entries. At least one entry of each pair is chosen.
    both : bool
        If true, both entries of each pair are chosen.

    Returns
    -------
    pair : (p, 2) int32
        Each pair once.
    """
    pair = np.zeros((2 * texels.n, 2), np.int32)
    n = neighbour_pairs(
        texels.pixel, texels.back, texels.chart, texels.lookup, texels.back_entry, texels.resolution,
        chosen, both, pair,
    )  # fmt: skip
    return pair[:n].copy()


def _of_sides(pair: NDArray[np.int32], groups: _Groups) -> NDArray[np.int32]:
    """Replace each pair of texels by all pairs of a side of one texel and a side of the other.

    pair : (p, 2) int32, entries before the split
    Returns (q, 2) int32, entries after the split.
    """
    if not len(groups.owner):
        return pair
    row = np.searchsorted(groups.owner, pair)
    row = np.minimum(row, len(groups.owner) - 1)
    split = groups.owner[row] == pair
    count = np.where(split, groups.count[row], 1)
    found = []
    for a in range(int(count[:, 0].max(initial=1))):
        for b in range(int(count[:, 1].max(initial=1))):
            use = (count[:, 0] > a) & (count[:, 1] > b)
            ends = [
                np.where(split[use, k], groups.entry(row[use, k], np.int64(g)), pair[use, k])
                for k, g in enumerate((a, b))
            ]
            found.append(np.stack(ends, axis=1))
    return np.concatenate(found).astype(np.int32)


def _see(job: TraceJob, entries: _Entries, pair: NDArray[np.int32]) -> tuple[NDArray[np.bool_], int]:
    """Return (m,) bool, whether a point of one entry is visible from a point of the other, and the ray count.

    pair : (m, 2) int32, entries
    """
    connected = np.zeros(len(pair), np.uint8)

    def examine(chosen: NDArray[np.int64], wanted: NDArray[np.uint8]) -> None:
        def work(begin: int, end: int) -> None:
            own, buffers = chosen[begin:end], job.occlusion_buffers(solid=True)
            ends: list[NDArray[np.float32]] = []
            for k in range(2):
                entry = pair[own, k].astype(np.int64)
                points = points_of(entries.surface, entries.valid_points, entry, wanted)
                ends += _with_heights(*points, entries.side[entry], buffers)
            free = np.zeros(len(own) * wanted.size, np.uint8)
            free_segments(*ends, buffers, free)
            connected[own] = free.reshape(len(own), -1).max(axis=1)

        job.run_here(Stage.TEXEL_SIDES, len(chosen), _PAIRS, work)

    examine(np.arange(len(pair)), _ONE)
    left = np.flatnonzero(connected == 0)
    examine(left, _EVERY)
    return connected != 0, 3 * (_ONE.size * len(pair) + _EVERY.size * len(left))


def _keep_largest(
    entries: _Entries,
    groups: _Groups,
    link: NDArray[np.int32],
    cut: NDArray[np.int32],
    backs: NDArray[np.float64],
    rays: int,
) -> Sides:
    """Give the side that `_order_sides` chooses the texel's original entry, and number the regions.

    link : (m, 2) int32, linked pairs of neighbouring entries, in the charts `cut`
    cut : (c,) int32, charts with split texels, or with neighbouring texels that are not linked
    backs : (S, groups) float64, from `_back_share`
    """
    root = np.arange(len(entries.valid_points), dtype=np.int32)
    join_linked(link, root)
    member, table, order = _order_sides(entries, groups, root, backs)
    # Renumber: new entry k is old entry order[k].
    texels, surface, valid_points, _ = entries
    rank = np.zeros_like(order)
    rank[order] = np.arange(len(order), dtype=np.int32)
    link, root = rank[link], root[order]
    valid_points = valid_points[order]
    texels = _measure(texels, surface, valid_points, member)
    n_front = texels.n_front
    region = np.array(texels.region)
    own = np.isin(region, cut)
    region[own] = int(region.max(initial=0)) + 1 + np.unique(root[:n_front][own], return_inverse=True)[1]
    lend_regions(texels, surface, region, valid_points[:n_front])
    return Sides(
        replace(texels, region=region), surface, valid_points, groups.owner, member, table, link, rays
    )


def _back_share(job: TraceJob, entries: _Entries, groups: _Groups) -> tuple[NDArray[np.float64], int]:
    """Return (S, groups) float64, the share of each side's rays that hit black backs, and the ray count."""
    share = np.zeros((len(groups.owner), int(groups.count.max(initial=1))))
    sobol_points = sobol_reversed(N_POINTS, job.seed, 9)
    cast = 0
    for group in range(share.shape[1]):
        row = np.flatnonzero(groups.count > group)
        chosen = groups.entry(row, np.int64(group))
        for begin in range(0, len(chosen), _SUSPECTS):
            own = chosen[begin : begin + _SUSPECTS]
            points = points_of(entries.surface, entries.valid_points, own)
            count = np.zeros(len(own), np.int32)
            count_backs(
                *points, job.lookup, job.occlusion_buffers(), sobol_points, shared_bits_mask(N_POINTS), count
            )
            cast += N_POINTS * len(own)
            share[row[begin : begin + _SUSPECTS], group] = count / N_POINTS
    return share, cast


def _order_sides(
    entries: _Entries, groups: _Groups, root: NDArray[np.int32], backs: NDArray[np.float64]
) -> tuple[NDArray[np.int32], SideTable, NDArray[np.int32]]:
    """Choose the side that gets a split texel's original entry: the side with the largest weight of points.

    If many rays of a side hit backs of one-sided surfaces, the points of the side have a smaller weight. Such
    a side lies, for example, outside a room with one-sided walls, or under a one-sided floor. A side whose
    region contains no unsplit texel is chosen only if this is true of all sides of the texel. An example of
    such a region is the strip of a wall below the floor, if this strip is narrower than a texel.

    root : (n,) int32, from `join_linked`: entries have the same root if links connect them
    backs : (S, groups) float64, from `_back_share`

    Returns
    -------
    member : (K,) int32, entries of all sides in the new numbering
    table : SideTable
    order : (n,) int32, old number of each new entry
    """
    order = np.arange(len(root), dtype=np.int32)
    if not len(groups.owner):
        return groups.owner, no_sides(), order
    row, k = np.nonzero(groups.label >= 0)
    group = groups.label[row, k].astype(np.int64)
    entry = groups.entry(row, group)
    score = np.zeros(backs.shape)
    np.add.at(score, (row, group), 1.0)
    score[backs > _MANY_BACKS] *= _OUTSIDE
    whole = entries.valid_points != 0
    whole[entry] = groups.count[row] == 1
    settled = np.zeros(len(root), bool)
    settled[root[whole]] = True
    score[row, group] += (N_POINTS + 1) * settled[root[entry]]
    best = groups.entry(np.arange(len(groups.owner)), score.argmax(axis=1))
    order[groups.owner], order[best] = best, groups.owner
    number = np.unique(entry).astype(np.int32)
    # `order` only swaps pairs of entries, so it also maps old numbers to new numbers.
    member = np.full(groups.label.shape, -1, np.int32)
    member[row, k] = np.searchsorted(number, order[entry])
    table = SideTable(groups.point, groups.normal, groups.height, member, entries.side[groups.owner])
    return number, table, order


def _measure(
    texels: TexelBuffer, surface: Surface, valid_points: NDArray[np.uint16], member: NDArray[np.int32]
) -> TexelBuffer:
    """Return the texels, with area, position, normal and centroid of sides computed from their valid points.

    member : (K,) int32, entries of all sides of split texels
    """
    area, position, normal = (np.array(v) for v in (texels.area, texels.position, texels.normal))
    centroid = np.array(texels.centroid)
    shape = (len(member), N_POINTS)
    point, shading = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    triangle, bary = np.zeros(shape, np.int32), np.zeros((*shape, 2), np.float32)
    every = np.full(len(valid_points), 0xFFFF, np.uint16)
    place_points(surface, every, member.astype(np.int64), _EVERY, point, shading, triangle, bary)
    share = (valid_points[member, None] >> np.arange(N_POINTS, dtype=np.uint16) & 1).astype(np.float64)
    area[member] *= share.mean(axis=1).astype(np.float32)
    share /= share.sum(axis=1, keepdims=True)
    position[member] = (share[..., None] * point).sum(axis=1)
    mean = (share[..., None] * shading).sum(axis=1)
    normal[member] = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-9)
    uv = surface.uv[surface.triangle[triangle]].astype(np.float64)
    weight = np.stack([1.0 - bary.sum(axis=2), bary[..., 0], bary[..., 1]], axis=2)
    texel_uv = (weight[..., None] * uv).sum(axis=2) * texels.resolution
    row, column = np.divmod(texels.pixel[member] % texels.resolution**2, texels.resolution)
    offset = (share[..., None] * texel_uv).sum(axis=1) - np.stack([column, row], axis=1) - 0.5
    front = member < texels.n_front
    centroid[member[front]] = offset[front]
    return replace(texels, area=area, position=position, normal=normal, centroid=centroid)
