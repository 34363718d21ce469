"""The final gather: computes irradiance and ambient occlusion of the texels in the page with hemisphere rays.

Each ray reads the light that the texel at its hit reflects. Ambient occlusion uses the same rays. Front
texels are the entries stored in the page; the backs of double-sided surfaces are not gathered.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import Part
from baker.core.stage import Stage
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.radiosity.direct import TILE, batch_variance
from baker.radiosity.emitter_choice import Choice, EmitterSampling
from baker.radiosity.kernels.gather import (
    DIRECT,
    INDIRECT,
    N_COLUMNS,
    OPEN,
    SQUARE,
    estimate_occlusion,
    gather,
)
from baker.radiosity.kernels.side_table import SeenLight
from baker.radiosity.trace_job import TraceJob


@dataclass(frozen=True)
class Gathered:
    """Irradiance and ambient occlusion of the front texels, from their gather rays.

    Attributes
    ----------
    indirect : (n_front, 3) float32, lx
        RGB of the irradiance from light that surfaces reflect.
    direct : (n_front, 3) float32, lx
        RGB of the irradiance from the sky, and from emitters times the MIS weight of gather rays.
    open : (n_front,) float32
        Ambient occlusion within `ao_distance`; 1 is unoccluded.
    variance : (n_front,) float32, lx2
        Variance of (R + G + B) / 3 of indirect + direct.
    rays : int
        Number of gather rays. Rays that are cast a second time, because a `BLEND` surface stopped a ray of
        their packet, count twice.
    """

    indirect: NDArray[np.float32]
    direct: NDArray[np.float32]
    open: NDArray[np.float32]
    variance: NDArray[np.float32]
    rays: int

    @classmethod
    def zeros(cls, n_front: int) -> Gathered:
        """Return zeros for `n_front` texels."""
        indirect, direct = np.zeros((n_front, 3), np.float32), np.zeros((n_front, 3), np.float32)
        opened, variance = np.zeros(n_front, np.float32), np.zeros(n_front, np.float32)
        return cls(indirect, direct, opened, variance, 0)


def final_gather(
    job: TraceJob,
    n_front: int,
    seen: SeenLight,
    analytic: NDArray[np.uint8],
    sampling: EmitterSampling,
    *,
    sky: tuple[float, float, float],
    ao_distance: float,
) -> Gathered:
    """Cast `sampling.n_gather` cosine-weighted rays from every front texel.

    Parameters
    ----------
    job : TraceJob
        Ray origins, scene and tile runner, as passed to `direct_light`.
    n_front : int
        Number of front texels, which are the first entries of the job.
    seen : SeenLight
        Light that texels reflect, from `Sides.seen_light`.
    analytic : (n,) uint8
        `DirectLight.analytic`: 1 for entries whose direct light is computed in closed form, so rays that hit
        visible emitters add nothing.
    sampling : EmitterSampling
        Emitters that rays may hit, and the numbers of rays for their MIS weights.
    sky : tuple of float
        Radiance of the sky, RGB, cd/m2.
    ao_distance : float
        Distance in metres up to which hits count as occlusion; may be inf.

    Returns
    -------
    Gathered
        Light and ambient occlusion of the front texels.
    """
    gathered, n_rays = Gathered.zeros(n_front), sampling.n_gather
    cast = np.zeros(-(-n_front // TILE), np.int64)
    sobol_points, shared = sobol_reversed(n_rays, job.seed, 6), shared_bits_mask(n_rays)
    limits, radiance = np.array([ao_distance, sampling.n_light], np.float64), np.array(sky, np.float32)
    shading, chooser = sampling.needed_shading(), sampling.chooser(job.chart)

    def work(begin: int, end: int) -> Part:
        # Choose emitters for the same tile as `direct_light`. The last tile with fronts may also contain
        # backs, which are not gathered.
        whole = min(begin + TILE, job.n)
        origin, normal = job.tile_points(begin, whole)
        buffers, out = job.packet_buffers(), np.zeros((end - begin, N_COLUMNS), np.float32)
        n_cast = 0
        for choice, part in _fronts(chooser.choose(begin, origin, normal, buffers), end - begin):
            n_cast += gather(
                origin[part], normal[part], job.lookup, seen, choice.found, shading, buffers,
                begin + part.start, sobol_points, shared, radiance, limits, analytic[begin:end][part],
                out[part],
            )  # fmt: skip
        spread = batch_variance(out[:, INDIRECT : DIRECT + 3].sum(axis=1), out[:, SQUARE])
        return out[:, INDIRECT : INDIRECT + 3], out[:, DIRECT : DIRECT + 3], out[:, OPEN], spread, n_cast

    def keep(begin: int, end: int, part: Part) -> None:
        gathered.indirect[begin:end], gathered.direct[begin:end] = part[:2]
        gathered.open[begin:end], gathered.variance[begin:end] = part[2:4]
        cast[begin // TILE] = part[4]

    job.run(Stage.FINAL_GATHER, n_front, TILE, work, keep, rays_per_item=n_rays)
    return replace(gathered, rays=int(cast.sum()))


def _fronts(choices: list[Choice], m: int) -> Iterator[tuple[Choice, slice]]:
    """Yield the choices for the first m entries of a tile, each with the slice of its entries among them."""
    for choice in choices:
        if choice.part.start < m:
            yield choice, slice(choice.part.start, min(choice.part.stop, m))


def ambient_occlusion(job: TraceJob, n_front: int, *, n_samples: int, distance: float) -> NDArray[np.float32]:
    """Cast `n_samples` cosine-weighted rays from every front texel for ambient occlusion alone.

    Parameters
    ----------
    job : TraceJob
        Ray origins, scene and tile runner.
    n_front : int
        Number of front texels, which are the first entries of the job.
    n_samples : int
        Rays from each texel.
    distance : float
        Distance in metres up to which hits count as occlusion; may be inf.

    Returns
    -------
    (n_front,) float32
        Cosine-weighted share of the hemisphere without a hit within `distance`.
    """
    out = np.zeros(n_front, np.float32)
    sobol_points, shared = sobol_reversed(n_samples, job.seed, 6), shared_bits_mask(n_samples)
    max_distance = np.float32(min(distance, 1.0e30))

    def work(begin: int, end: int) -> Part:
        points = job.tile_points(begin, end)
        estimate_occlusion(
            *points, job.occlusion_buffers(), begin, sobol_points, shared, max_distance, 0, out
        )
        return (out[begin:end],)

    def keep(begin: int, end: int, part: Part) -> None:
        out[begin:end] = part[0]

    job.run(Stage.AMBIENT_OCCLUSION, n_front, TILE, work, keep, rays_per_item=n_samples)
    return out
