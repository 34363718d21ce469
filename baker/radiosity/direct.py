"""Computes the direct light of every texel, from emissive triangles and from lights without area.

Two estimates of the direct irradiance are computed:

- `weighted` contains all light of lights without area, and the part of the emitters' light that MIS (multiple
  importance sampling) assigns to shadow rays. The final gather adds the remaining part, from its rays that
  hit emitters.
- `complete` is all direct light. Surfaces reflect it in the first bounce.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import kind_of
from baker.core.parallel import Part
from baker.core.scene import PunctualLight
from baker.core.stage import Stage
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.kernels.shading import Shading
from baker.kernels.surface import N_POINTS
from baker.kernels.triangle_lookup import TriangleLookup
from baker.radiosity.emitter_choice import Choice, EmitterChooser, EmitterSampling
from baker.radiosity.kernels.area_light import light_samples
from baker.radiosity.kernels.gather import DIRECT, N_COLUMNS, gather
from baker.radiosity.kernels.shadow import add_visible
from baker.radiosity.kernels.side_table import nothing_seen
from baker.radiosity.trace_job import TraceJob
from baker.trace.packets import PacketBuffers

# Texel entries (rows of `TexelBuffer`) per tile. The final gather uses the same tiles, so that both stages
# sample the same emitters.
TILE = 512
# Columns of `_Tile.light`: RGB of the estimates `weighted` and `complete`.
WEIGHTED, COMPLETE = slice(0, 3), slice(3, 6)
# Number of hemisphere rays per texel that `complete` combines with shadow rays, at texels close to emitters.
N_HEMISPHERE = 4
# Limit of radius / distance of a visible emitter cluster. Above this limit, texels are close to the cluster.
# They cast `N_HEMISPHERE` hemisphere rays, unless their light is computed in closed form.
CLOSE = 0.5


@dataclass(frozen=True)
class DirectLight:
    """Direct irradiance of all n texel entries.

    Attributes
    ----------
    weighted : (n, 3) float32, lx
        RGB, without the light that gather rays add when they hit emitters.
    complete : (n, 3) float32, lx
        RGB of all direct light.
    variance : (n,) float32, lx2
        Variance of (R + G + B) / 3 of `weighted`.
    analytic : (n,) uint8
        1 for entries whose `weighted` contains all light of the visible emitters, computed in closed form.
    rays : int
        Number of shadow rays and hemisphere rays cast for emitters, without the probe rays of
        `radiosity.emitter_choice`, plus 16 for each pair of an entry and a light without area. The number for
        lights without area is an upper bound, because points that the light does not illuminate cast no ray.
    """

    weighted: NDArray[np.float32]
    complete: NDArray[np.float32]
    variance: NDArray[np.float32]
    analytic: NDArray[np.uint8]
    rays: int

    @classmethod
    def zeros(cls, n: int, rays: int) -> DirectLight:
        """Return zeros for n entries."""
        weighted, complete = np.zeros((n, 3), np.float32), np.zeros((n, 3), np.float32)
        return cls(weighted, complete, np.zeros(n, np.float32), np.zeros(n, np.uint8), rays)


def direct_light(job: TraceJob, lights: tuple[PunctualLight, ...], sampling: EmitterSampling) -> DirectLight:
    """Compute the direct irradiance of every texel entry.

    Parameters
    ----------
    job : TraceJob
        Ray origins, scene and tile runner.
    lights : tuple of PunctualLight
        Lights without area.
    sampling : EmitterSampling
        Emitters, and the numbers of shadow rays and hemisphere rays for the MIS weights.

    Returns
    -------
    DirectLight
        Both estimates of all n entries.
    """
    n = job.n
    weighted, complete = np.zeros((n, 3), np.float32), np.zeros((n, 3), np.float32)
    variance, analytic = np.zeros(n, np.float32), np.zeros(n, np.uint8)
    punctual = [(light, kind) for light in lights for kind in [kind_of(light)] if max(light.intensity) > 0]
    emitter_light = _EmitterLight.build(job, sampling)
    cast = np.zeros(-(-n // TILE), np.int64)

    def work(begin: int, end: int) -> Part:
        buffers = job.packet_buffers()
        origin, normal = job.tile_points(begin, end)
        tile = _Tile.zeros(end - begin)
        n_cast = emitter_light.add(begin, origin, normal, buffers, tile)
        if punctual:
            ray = np.zeros((end - begin, N_POINTS, 4), np.float32)
            weight = np.zeros((end - begin, N_POINTS), np.float32)
            for light, kind in punctual:
                kind.fill(light, origin, normal, ray, weight)
                add_visible(buffers, origin, ray, weight, np.array(light.intensity, np.float32), tile.light)
        return tile.light[:, WEIGHTED], tile.light[:, COMPLETE], tile.variance, tile.analytic, n_cast

    def keep(begin: int, end: int, part: Part) -> None:
        weighted[begin:end], complete[begin:end], variance[begin:end], analytic[begin:end] = part[:4]
        cast[begin // TILE] = part[4]

    rays = sampling.n_light * bool(len(sampling.emitters.power)) + N_POINTS * len(punctual)
    job.run(Stage.DIRECT_LIGHT, n, TILE, work, keep, rays_per_item=rays)
    return DirectLight(weighted, complete, variance, analytic, int(cast.sum()) + N_POINTS * len(punctual) * n)


class _Tile(NamedTuple):
    """Light of m consecutive entries: a tile or a part of a tile.

    light : (m, 6) float32, lx, columns `WEIGHTED` and `COMPLETE`
    variance (m,) float32, lx2; analytic (m,) uint8 : see `DirectLight`
    """

    light: NDArray[np.float32]
    variance: NDArray[np.float32]
    analytic: NDArray[np.uint8]

    @classmethod
    def zeros(cls, m: int) -> _Tile:
        """Return zeros for m entries."""
        return cls(np.zeros((m, 6), np.float32), np.zeros(m, np.float32), np.zeros(m, np.uint8))

    def part(self, own: slice) -> _Tile:
        """Return views of the entries in the slice `own`."""
        return _Tile(self.light[own], self.variance[own], self.analytic[own])


@dataclass(frozen=True)
class _EmitterLight:
    """Computes the light of emissive triangles, tile by tile.

    Attributes
    ----------
    lookup : TriangleLookup, finds the emitter of a hit
    chooser : EmitterChooser, chooses the clusters of emitters to which shadow rays are cast
    shading : Shading or None, from `kernels.emitters.needed_shading`
    sobol_points : (n_light, 2) uint32
        Sobol points of shadow rays to visible clusters.
    hidden_points : (n_hidden, 2) uint32
        Sobol points of shadow rays to hidden clusters, see `radiosity.emitter_choice`.
    near_points : (N_HEMISPHERE, 2) uint32
        Sobol points of hemisphere rays close to emitters.
    n_gather, n_light : int, see `EmitterSampling`
    """

    lookup: TriangleLookup
    chooser: EmitterChooser
    shading: Shading | None
    sobol_points: NDArray[np.uint32]
    hidden_points: NDArray[np.uint32]
    near_points: NDArray[np.uint32]
    n_gather: int
    n_light: int

    @classmethod
    def build(cls, job: TraceJob, sampling: EmitterSampling) -> _EmitterLight:
        """Return the data that all tiles of a job share."""
        chooser = sampling.chooser(job.chart)
        return cls(
            lookup=job.lookup,
            chooser=chooser,
            shading=sampling.needed_shading(),
            sobol_points=sobol_reversed(sampling.n_light, job.seed, 1),
            hidden_points=sobol_reversed(chooser.n_hidden, job.seed, 3),
            near_points=sobol_reversed(N_HEMISPHERE, job.seed, 2),
            n_gather=sampling.n_gather,
            n_light=sampling.n_light,
        )

    def add(
        self,
        begin: int,
        origin: NDArray[np.float32],
        normal: NDArray[np.float32],
        buffers: PacketBuffers,
        tile: _Tile,
    ) -> int:
        """Add the light of emitters to `tile`; return the number of rays cast, without probe rays.

        begin : int, first entry of the tile
        origin, normal : (m, 16, 3) float32, world; origins in metres, unit normals
        """
        n_cast = 0
        for choice in self.chooser.choose(begin, origin, normal, buffers):
            own = choice.part
            points, out = (origin[own], normal[own]), tile.part(own)
            n_cast += self._sample(choice, points, begin + own.start, buffers, out)
            if choice.view > CLOSE and (choice.hidden is not None or not out.analytic.all()):
                n_cast += self._gather(choice, points, begin + own.start, buffers, out)
        return n_cast

    def _sample(
        self,
        choice: Choice,
        points: tuple[NDArray[np.float32], ...],
        begin: int,
        buffers: PacketBuffers,
        out: _Tile,
    ) -> int:
        """Add the light that shadow rays find to `out`; return the number of these rays."""
        n_cast = 0
        # Numbers of hemisphere rays for the MIS weights: `weighted` is combined with the rays of the final
        # gather, `complete` with the rays of `_gather`.
        hemisphere = np.array([self.n_gather, N_HEMISPHERE * (choice.view > CLOSE)], np.float64)
        for emitters, sobol_points in ((choice.seen, self.sobol_points), (choice.hidden, self.hidden_points)):
            if emitters is None or not emitters.chance.any():
                continue
            light, square = np.zeros_like(out.light), np.zeros(len(out.light), np.float32)
            analytic = out.analytic if emitters is choice.seen else np.zeros(len(out.light), np.uint8)
            n_cast += light_samples(
                *points, emitters, self.shading, buffers, begin, sobol_points,
                shared_bits_mask(len(sobol_points)), hemisphere, analytic, light, square,
            )  # fmt: skip
            out.light[:] += light
            out.variance[:] += batch_variance(light[:, WEIGHTED].sum(axis=1), square)
        return n_cast

    def _gather(
        self,
        choice: Choice,
        points: tuple[NDArray[np.float32], ...],
        begin: int,
        buffers: PacketBuffers,
        out: _Tile,
    ) -> int:
        """Cast hemisphere rays, and add the light of emitters that they hit to `complete`.

        Returns the number of rays.
        """
        found = np.zeros((len(out.light), N_COLUMNS), np.float32)
        limits, black = np.array([0.0, self.n_light], np.float64), np.zeros(3, np.float32)
        gather(
            *points, self.lookup, nothing_seen(), choice.found, self.shading, buffers, begin,
            self.near_points, shared_bits_mask(N_HEMISPHERE), black, limits, out.analytic, found,
        )  # fmt: skip
        out.light[:, COMPLETE] += found[:, DIRECT : DIRECT + 3]
        return N_HEMISPHERE * len(out.light)


def batch_variance(total: NDArray[np.float32], squares: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return (m,) float32: the variance of (R + G + B) / 3 of m texels, from 16 batches of samples each.

    R, G and B of a texel are sums over its batches.

    Parameters
    ----------
    total : (m,) float32
        R + G + B, summed over the batches.
    squares : (m,) float32
        (R + G + B)^2 of each batch, summed over the batches.
    """
    spread = np.maximum(squares - total * total / N_POINTS, 0) * (N_POINTS / (N_POINTS - 1.0)) / 9.0
    return spread.astype(np.float32)
