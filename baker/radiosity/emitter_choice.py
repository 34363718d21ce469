"""Chooses the emitter clusters that the texels of a tile sample, and the numbers of samples.

`kernels.emitters.cluster_chances` estimates the unoccluded irradiance that each cluster of emitters causes.
With these estimates alone, a very bright emitter behind a wall would get nearly all samples. Therefore a few
shadow rays, the probe rays, are cast from the tile to each cluster to find whether it is visible.

- The samples are distributed over the visible clusters.
- Clusters that no probe ray reaches are called hidden. They form a separate stratum with few samples, which
  MIS combines with gather rays that hit these clusters. So a cluster that is visible only through a small
  opening still contributes.
- The weight of a cluster is power / distance^2. In two cases, visible and hidden clusters are found
  separately for each block of up to sixteen consecutive texels. In the first case, a cluster is visible from
  only a part of the tile and has more than `_OUTSHINES` times the weight of another visible cluster. In the
  second case, the weights of any two clusters differ by more than this factor, and the chart or the normal
  changes within the tile.

Based on: Ward, Adaptive shadow testing for ray tracing, 1991; Georgiev et al., Importance caching for complex
illumination, 2012.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.emitters import (
    AREA,
    CLUSTER,
    NO_CLOSED_FORM,
    TEXTURED,
    Emitters,
    TileEmitters,
    needed_shading,
    tile_emitters,
    widest_view,
)
from baker.kernels.shading import Shading
from baker.radiosity.kernels.emitter_probe import probe_clusters
from baker.trace.packets import PACKET_WIDTH, PacketBuffers

# Largest and smallest number of probe rays from a tile to each cluster. From a block, at most 16 rays are
# cast to each cluster.
_MOST_RAYS, _FEWEST_RAYS = 32, 4
# Number of probe rays of a tile to all clusters, as a share of the tile's shadow rays.
_COST = 0.06
# Limit of the number of clusters in the scene. Up to this limit, all hidden clusters are in the separate
# stratum.
_FEW = 32
# Limit of the total weight (power / distance^2) of hidden clusters, as a share of the visible clusters' total
# weight. If the scene has more than _FEW clusters, the dimmest hidden clusters are sampled together with the
# visible clusters, as many as have a total weight within this limit.
_HARMLESS = 0.25
# Limit of the ratio of the weights of two clusters. Above this limit, clusters may be chosen separately for
# each block, see above.
_OUTSHINES = 4.0
# Smallest cosine between the normals of consecutive texels of a block. Below this cosine, a new block begins.
_TURN = 0.5
# Limit of the ratio between the largest and the smallest power per area of all clusters. Up to this limit,
# clusters that form one connected group are treated as one light, and no probe rays are cast.
_ALIKE = 4.0
# Number of shadow rays to hidden clusters, as a share of the number of shadow rays to visible clusters.
_HIDDEN_SHARE = 1.0 / 8.0


@dataclass(frozen=True)
class EmitterSampling:
    """Emitters, and the numbers of shadow rays and hemisphere rays that the balance heuristic combines.

    Attributes
    ----------
    emitters : Emitters
        Emissive triangles, grouped into clusters.
    shading : Shading
        Materials of all triangles: textured emission, alpha.
    n_light : int
        Shadow rays to emitters from each texel.
    n_gather : int
        Hemisphere rays of the final gather from each texel.
    """

    emitters: Emitters
    shading: Shading
    n_light: int
    n_gather: int

    def needed_shading(self) -> Shading | None:
        """Return the materials, or None if kernels need none; see `kernels.emitters.needed_shading`."""
        return needed_shading(self.emitters, self.shading)

    def chooser(self, chart: NDArray[np.int32] | None) -> EmitterChooser:
        """Return a chooser for these emitters; `chart` (n,) int32 is the chart of each texel entry."""
        return EmitterChooser.build(self.emitters, self.n_light, chart)


class Choice(NamedTuple):
    """Emitter clusters to which the texels of a part of a tile cast shadow rays.

    part : slice, the part: consecutive texels, as indices within the tile
    seen : clusters to which `n_light` shadow rays are cast: all clusters except those in `hidden`
    hidden : clusters of the separate stratum, which no probe ray reached, and to which `n_hidden` shadow rays
        are cast. None if there are no such clusters, or if no cluster is visible
    found : all clusters, with the sampling densities that the MIS weights of gather rays need
    view : largest radius / distance of a cluster in `seen`, see `kernels.emitters.widest_view`
    """

    part: slice
    seen: TileEmitters
    hidden: TileEmitters | None
    found: TileEmitters
    view: float


@dataclass(frozen=True)
class EmitterChooser:
    """Chooses emitters for tiles. If two stages pass the same points, they get the same choices.

    Attributes
    ----------
    emitters : Emitters
        All emitters of the scene.
    n_light, n_hidden : int
        Shadow rays of a texel to visible clusters, and to hidden clusters.
    single : bool
        True if all emitters are treated as one light, so that every tile samples all of them.
    chart : (n,) int32 or None
        Chart of each texel entry.
    """

    emitters: Emitters
    n_light: int
    n_hidden: int
    single: bool
    chart: NDArray[np.int32] | None

    @classmethod
    def build(
        cls, emitters: Emitters, n_light: int, chart: NDArray[np.int32] | None = None
    ) -> EmitterChooser:
        """Return the chooser for `n_light` shadow rays per texel.

        chart : (n,) int32, chart of each texel entry, or None
        """
        n_hidden = max(int(n_light * _HIDDEN_SHARE), 1)
        return cls(emitters, n_light, n_hidden, _one_light(emitters), chart)

    def choose(
        self, begin: int, origin: NDArray[np.float32], normal: NDArray[np.float32], buffers: PacketBuffers
    ) -> list[Choice]:
        """Split a tile into parts; return the emitters that each part samples, in the order of the parts.

        Parameters
        ----------
        begin : int, the tile's first texel entry
        origin, normal : (m, 16, 3) float32, metres and unit vectors, world; the 16 points of each texel
        """
        whole = slice(0, len(origin))
        all_emitters = tile_emitters(self.emitters, origin)
        if self.single or np.count_nonzero(all_emitters.chance) < 2:
            return [Choice(whole, all_emitters, None, all_emitters, widest_view(self.emitters, origin))]
        bounds, hidden = self._find_hidden(all_emitters, begin, origin, normal, buffers)
        parts = [slice(*span) for span in pairwise(bounds.tolist())]
        if len(parts) == 1:
            return [self._choice(whole, origin, all_emitters, hidden[0])]
        return [
            self._choice(part, origin[part], tile_emitters(self.emitters, origin[part]), own)
            for part, own in zip(parts, hidden, strict=True)
        ]

    def _find_hidden(
        self,
        all_emitters: TileEmitters,
        begin: int,
        origin: NDArray[np.float32],
        normal: NDArray[np.float32],
        buffers: PacketBuffers,
    ) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Split a tile into P parts, and find the clusters that are hidden from each part.

        Returns bounds (P + 1,) int64 and hidden (P, C) bool. Part p contains the texels bounds[p] to
        bounds[p + 1] - 1 of the tile. hidden[p, c] is True if cluster c is hidden from part p.
        """
        weight = self._weights(all_emitters, origin)
        blocks, broken = self._blocks(begin, origin, normal)
        bounds = np.array([0, len(origin)])
        chosen = weight > 0
        unlike = weight.max() > _OUTSHINES * weight[chosen].min()
        seen = np.zeros((1, len(weight)), np.int32)
        if not (unlike and broken):
            asked, seen = self._probe(origin, normal, buffers, bounds, chosen)
            partly = (seen[0] > 0) & (seen[0] < asked[0])
            dimmest = weight[seen[0] > 0].min(initial=np.inf)
            if not (partly & (weight > _OUTSHINES * dimmest)).any():
                return bounds, self._hidden(weight, seen[0])[None]
            chosen = partly
        by_block = self._probe(origin, normal, buffers, blocks, chosen)[1]
        hidden = np.stack([self._hidden(weight, np.where(chosen, own, seen[0])) for own in by_block])
        new = np.flatnonzero(np.append(True, (hidden[1:] != hidden[:-1]).any(axis=1)))
        return np.append(blocks[new], len(origin)), hidden[new]

    def _blocks(
        self, begin: int, origin: NDArray[np.float32], normal: NDArray[np.float32]
    ) -> tuple[NDArray[np.int64], bool]:
        """Split a tile into blocks of up to sixteen consecutive texels of one chart with similar normals.

        Returns `bounds` (B + 1,) int64 and a bool. Block b contains the texels `bounds[b] : bounds[b + 1]` of
        the tile. The bool is True if the chart or the normal changes within the tile.
        """
        facing = normal[:, 0]
        apart = (facing[1:] * facing[:-1]).sum(axis=1) < _TURN
        if self.chart is not None:
            own = self.chart[begin : begin + len(origin)]
            apart |= own[1:] != own[:-1]
        breaks = np.flatnonzero(apart) + 1
        bounds = np.unique(np.concatenate([np.arange(0, len(origin), PACKET_WIDTH), breaks, [len(origin)]]))
        return bounds, bool(apart.any())

    def _probe(
        self,
        origin: NDArray[np.float32],
        normal: NDArray[np.float32],
        buffers: PacketBuffers,
        bounds: NDArray[np.int64],
        chosen: NDArray[np.bool_],
    ) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Return two (B, C) int32 by block and cluster: numbers of probe rays, and of unblocked probe rays.

        Rays whose cosine at the texel or at the emitter is not positive are not cast and not counted.

        bounds : (B + 1,) int64, see `_blocks`; chosen : (C,) bool, clusters to probe
        """
        shape = (len(bounds) - 1, len(chosen))
        share = _COST * self.n_light * len(origin) / (shape[0] * np.count_nonzero(chosen))
        n_rays = int(np.clip(share, _FEWEST_RAYS, _MOST_RAYS if shape[0] == 1 else PACKET_WIDTH))
        asked, seen = np.zeros(shape, np.int32), np.zeros(shape, np.int32)
        row, first = self.emitters.row, self.emitters.first
        probe_clusters(origin, normal, row, first, buffers, bounds, chosen, n_rays, asked, seen)
        return asked, seen

    def _weights(self, all_emitters: TileEmitters, origin: NDArray[np.float32]) -> NDArray[np.float64]:
        """Return (C,) float64: power / distance^2 of clusters, 0 if the cluster's `chance` is 0.

        origin : (m, w, 3) float32, metres, world. Distances are from the centre of the points' bounding box,
            and at least the sum of the cluster's radius and half the diagonal of that box.
        """
        points = origin.reshape(-1, 3)
        low, high = points.min(axis=0).astype(np.float64), points.max(axis=0).astype(np.float64)
        square = ((self.emitters.centre - 0.5 * (low + high)) ** 2).sum(axis=1)
        touching = self.emitters.radius + 0.5 * np.linalg.norm(high - low)
        weight: NDArray[np.float64] = self.emitters.power / np.maximum(square, touching**2 + 1e-12)
        return np.where(all_emitters.chance > 0, weight, 0.0)

    def _hidden(self, weight: NDArray[np.float64], seen: NDArray[np.int32]) -> NDArray[np.bool_]:
        """Return (C,) bool: the hidden clusters of the separate stratum; all False if no cluster is visible.

        weight : (C,) float64, from `_weights`; seen : (C,) int32, unblocked probe rays to each cluster
        """
        hidden: NDArray[np.bool_] = (seen == 0) & (weight > 0)
        if not (seen > 0).any():
            return np.zeros_like(hidden)
        if len(weight) > _FEW:
            order = np.argsort(np.where(hidden, weight, 0.0), kind="stable")
            harmless = np.cumsum(np.where(hidden, weight, 0.0)[order]) <= _HARMLESS * weight[seen > 0].sum()
            hidden[order[harmless]] = False
        return hidden

    def _choice(
        self, part: slice, origin: NDArray[np.float32], all_emitters: TileEmitters, hidden: NDArray[np.bool_]
    ) -> Choice:
        """Return the choice for one part of a tile.

        origin : (m, w, 3) float32, metres, world; hidden : (C,) bool, clusters of the separate stratum
        """
        hidden = hidden & (all_emitters.chance > 0)
        if not hidden.any() or not (all_emitters.chance[~hidden] > 0).any():
            return Choice(part, all_emitters, None, all_emitters, widest_view(self.emitters, origin))
        visible, others = only(self.emitters, ~hidden), only(self.emitters, hidden)
        # Do not use the closed form for hidden emitters. The closed form requires that no shadow ray is
        # blocked, and too few shadow rays are cast to test that.
        others.row[others.row[:, TEXTURED] == 0.0, TEXTURED] = NO_CLOSED_FORM
        seen, apart = tile_emitters(visible, origin), tile_emitters(others, origin)
        chance = np.zeros_like(all_emitters.chance)
        chance[~hidden] = seen.chance / seen.cumulative[-1]
        chance[hidden] = apart.chance / apart.cumulative[-1] * (self.n_hidden / self.n_light)
        found = all_emitters._replace(
            chance=chance, cumulative=np.ones_like(chance), apart=hidden.astype(np.uint8)
        )
        return Choice(part, seen, apart, found, widest_view(visible, origin))


def only(emitters: Emitters, which: NDArray[np.bool_]) -> Emitters:
    """Return the emitters of the selected clusters, renumbered from 0; `which` : (C,) bool."""
    length = np.diff(emitters.first)
    own = np.repeat(which, length)
    row = np.ascontiguousarray(emitters.row[own])
    first = np.concatenate([[0], np.cumsum(length[which])]).astype(np.int32)
    row[:, CLUSTER] = np.repeat(np.arange(len(first) - 1), length[which])
    return emitters._replace(
        row=row,
        triangle=emitters.triangle[own],
        first=first,
        centre=emitters.centre[which],
        radius=emitters.radius[which],
        power=emitters.power[which],
        axis=emitters.axis[which],
        spread=emitters.spread[which],
    )


def _one_light(emitters: Emitters) -> bool:
    """Return whether all clusters form one connected group of similar power per area.

    Two clusters are connected if their bounding spheres overlap. Walls rarely separate such clusters.
    """
    n = len(emitters.power)
    if n < 2:
        return True
    brightness = emitters.power / np.bincount(emitters.row[:, CLUSTER].astype(int), emitters.row[:, AREA], n)
    if brightness.max() > _ALIKE * brightness.min():
        return False
    between = np.linalg.norm(emitters.centre[:, None] - emitters.centre[None], axis=2)
    touching = between <= emitters.radius[:, None] + emitters.radius[None]
    reached = np.zeros(n, bool)
    reached[0] = True
    while True:
        more = touching[reached].any(axis=0)
        if (more == reached).all():
            return bool(reached.all())
        reached = more
