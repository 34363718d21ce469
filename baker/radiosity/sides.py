"""Splits texels that lie on both sides of a surface passing through them, and groups texels into regions.

A floor that continues under a wall, a ceiling above walls, a beam through a wall: a texel there has points on
both sides of the other surface. A single value would be the mean of the light on both sides and would be
visible on both. Its points are grouped by mutual visibility (`radiosity.kernels.sides`), and each group
becomes an entry. The texel's own entry is the side with most points, and is stored in the page; the entries
of the other sides come after fronts and backs, take part in light transport, and are stored in no page.

Neighbouring texels are linked if some of their points are mutually visible. The connected parts of a chart
are its regions: finishing mixes no values across their borders. Texels of a block that are not linked within
it
belong to different patches.
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

_TILE = 4096
_SUSPECTS, _PAIRS = 1024, 2048
# Pairs of neighbours are tested with one point of each, then with all.
_ONE = np.zeros((1, 1), np.uint8)
# A side is outside of one-sided geometry if more than the share _MANY_BACKS of its rays hit backs; its points
# then have the weight _OUTSIDE.
_MANY_BACKS, _OUTSIDE = 0.25, 0.25
_EVERY = np.arange(N_POINTS, dtype=np.uint8)[None]
_BITS = np.uint32(1) << np.arange(N_POINTS, dtype=np.uint32)


@dataclass(frozen=True)
class Sides:
    """Texel entries after the split; see the module.

    Attributes
    ----------
    texels : TexelBuffer
        All n entries; `region` of each front texel.
    surface : Surface
        The same entries.
    valid_points : (n,) uint16
        Bit k is set where point k of an entry is outside geometry and on the entry's side.
    owner : (S,) int32
        Entries of fronts and backs that were split, rising.
    member : (K,) int32
        Entries of all sides of these, in the order that `SideTable.member` counts.
    table : SideTable
        Points of split texels, which choose the side of a hit.
    link : (m, 2) int32
        Neighbouring entries that see each other, in all charts with a border between regions.
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
        """Return the light that gather rays find.

        Parameters
        ----------
        exitance : (n, 4) float32, lx
            Light that entries reflect; SIDE_ROW is set in place: the number of a split texel from 1, else 0.
        """
        exitance[:, SIDE_ROW] = 0
        exitance[self.owner, SIDE_ROW] = np.arange(1, len(self.owner) + 1)
        return SeenLight(self.texels.hit_image(exitance), exitance[self.member], self.table)

    def seen_patches(self, patch: NDArray[np.int32]) -> SeenPatch:
        """Return the patches that form-factor rays find; `patch` (n,) int32 is that of each entry."""
        marked = np.array(patch)
        marked[self.owner] = SPLIT - np.arange(len(self.owner), dtype=np.int32)
        return SeenPatch(self.texels.hit_image(marked, fill=-1), patch[self.member], self.table)


class _Entries(NamedTuple):
    """All entries after the split; side (n,) float32, metres, of the whole texel."""

    texels: TexelBuffer
    surface: Surface
    valid_points: NDArray[np.uint16]
    side: NDArray[np.float32]


@dataclass(frozen=True)
class _Groups:
    """Entries whose points form several groups, or do not see all corners of their surface.

    Attributes
    ----------
    owner : (S,) int32, the entries, rising
    label : (S, 16) int8, group of each point, from 0; -1 inside geometry
    point, normal : (S, 16, 3) float32; height : (S, 16) float32, see `SideTable`
    n : int, entries before the split
    """

    owner: NDArray[np.int32]
    label: NDArray[np.int8]
    point: NDArray[np.float32]
    normal: NDArray[np.float32]
    height: NDArray[np.float32]
    n: int

    @property
    def count(self) -> NDArray[np.int64]:
        """Return the number of groups of each entry (S,)."""
        count: NDArray[np.int64] = self.label.max(axis=1, initial=0).astype(np.int64) + 1
        return count

    def entry(self, row: NDArray[np.int64], group: NDArray[np.int64] | np.int64) -> NDArray[np.int64]:
        """Return the entry of each group of the texel in a row: group 0 keeps the texel's own entry."""
        before = np.concatenate([[0], np.cumsum(self.count - 1)])[:-1]
        entry = np.where(group == 0, self.owner[row], self.n + before[row] + group - 1)
        return np.asarray(entry, np.int64)


def split_texels(texels: TexelBuffer, job: TraceJob) -> Sides:
    """Split the texels that some surface passes through.

    Parameters
    ----------
    texels : TexelBuffer
        Fronts and backs, the entries of the job.
    job : TraceJob
        Its `valid_points` are those outside geometry.

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

    job.run_here(Stage.TEXEL_SIDES, n, _TILE, find_crossed, rays_per_item=4)
    suspect = np.flatnonzero(crossed)
    groups, rays = _group(job, suspect[valid[suspect] != 0], side)
    rays += int(cast.sum())
    entries = _cut(texels, surface, valid, side, groups)
    pair = _of_sides(neighbours(texels, crossed != 0), groups)
    # A surface between two whole texels crosses both.
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
    """Group the points of the chosen entries (m,); return those to split, and the number of rays cast.

    side : (n,) float32, metres, of each entry's texel
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
    """Return points and normals (m * w, 3), from (m, w, 3), and the heights (m * w,) of their segments."""
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
    """Give each group of points an entry: group 0 that of its texel, the others new ones at the end."""
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
    """Return pairs of neighbouring entries of one chart and side.

    Parameters
    ----------
    texels : TexelBuffer
        Fronts and backs.
    chosen : (n,) bool
        Entries of which a pair holds at least one.
    both : bool
        Whether it must hold two.

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
    """Return pairs (q, 2) after the split: each side of one texel with each side of the other."""
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
    """Return (m,) bool, mutual visibility of points of a pair of entries, and the number of rays cast."""
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
    """Give the own entry of each split texel its largest side, and number the regions.

    link : (m, 2) int32, neighbouring entries that see each other, in the charts `cut`
    backs : (S, groups) float64, see `_back_share`
    """
    root = np.arange(len(entries.valid_points), dtype=np.int32)
    join_linked(link, root)
    member, table, order = _order_sides(entries, groups, root, backs)
    # Entry k was entry order[k] before.
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
    """Return the share (S, groups) of rays of each side that hit black backs, and the number of rays."""
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
    """Choose the side that is stored in a split texel's own entry: the one with most points.

    Points of a side whose rays hit backs of one-sided surfaces have a smaller weight: it is the outside of a
    room whose walls have no outside, or the underside of a floor that has none. A side whose region contains
    no whole texel is not chosen: for example the strip of a wall below the floor that is narrower than a
    texel.

    Returns
    -------
    member : (K,) int32, entries of all sides in their new order
    table : SideTable
    order : (n,) int32, old number of each entry
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
    # Swapping two entries of one texel is its own inverse.
    member = np.full(groups.label.shape, -1, np.int32)
    member[row, k] = np.searchsorted(number, order[entry])
    table = SideTable(groups.point, groups.normal, groups.height, member, entries.side[groups.owner])
    return number, table, order


def _measure(
    texels: TexelBuffer, surface: Surface, valid_points: NDArray[np.uint16], member: NDArray[np.int32]
) -> TexelBuffer:
    """Return the texels with area, position, normal and centroid of each side of split texels."""
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
