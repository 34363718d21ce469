"""The final gather of all texels: sharp first bounce, smooth further bounces, AO from the same rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import Part, TileRunner, run_tiles
from baker.core.progress import Progress
from baker.kernels.emitters import Emitters, needed_shading
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.kernels.shading import Shading
from baker.kernels.surface import Surface
from baker.kernels.triangle_lookup import TriangleLookup
from baker.radiosity.direct import TILE, batch_variance
from baker.radiosity.emitter_choice import LampChooser
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
from baker.radiosity.point_cache import PointCache, tile_points
from baker.trace.embree import Tracer
from baker.trace.packets import new_packet_buffers

STAGE = "final gather"
AO_STAGE = "ambient occlusion"


@dataclass(frozen=True)
class Gathered:
    """What the gather rays of front texels brought.

    Attributes
    ----------
    indirect, direct : (n_front, 3) float32, lx; `direct` is sky and the gather's half of emitters
    open : (n_front,) float32, AO within the distance asked
    variance : (n_front,) float32, lx2, of the mean of RGB of indirect + direct
    rays : int
    """

    indirect: NDArray[np.float32]
    direct: NDArray[np.float32]
    open: NDArray[np.float32]
    variance: NDArray[np.float32]
    rays: int


def final_gather(
    n_front: int,
    surface: Surface,
    mask: NDArray[np.uint16],
    table: TriangleLookup,
    seen: SeenLight,
    exact: NDArray[np.uint8],
    emitters: Emitters,
    shading: Shading,
    tracer: Tracer,
    *,
    n_samples: int,
    n_light: int,
    sky: tuple[float, float, float],
    ao_distance: float,
    seed: int,
    threads: int,
    progress: Progress,
    chart: NDArray[np.int32] | None = None,
    kept: PointCache | None = None,
    run: TileRunner = run_tiles,
) -> Gathered:
    """Cast `n_samples` cosine-weighted rays from every front texel.

    Parameters
    ----------
    seen : SeenLight
        Light that texels reflect (`Sides.seen_light`); emission is found by MIS with `n_light` shadow rays.
    exact : (n,) uint8
        1 for entries whose direct light from emitters is complete already.
    sky : radiance, cd/m2
    ao_distance : metres, may be inf
    chart : (n,) int32, of each entry
    kept : points of an earlier stage with the same tiles
    run : works on the tiles
    """
    indirect, direct = np.zeros((n_front, 3), np.float32), np.zeros((n_front, 3), np.float32)
    opened, variance = np.zeros(n_front, np.float32), np.zeros(n_front, np.float32)
    net = sobol_reversed(n_samples, seed, 6)
    shared = shared_bits_mask(n_samples)
    limits = np.array([ao_distance, n_light], np.float64)
    radiance = np.array(sky, np.float32)
    needed = needed_shading(emitters, shading)
    chooser = LampChooser.build(emitters, n_light, chart)

    def work(begin: int, end: int) -> Part:
        # Lights are chosen for the tile that `direct_light` saw, which goes on with backs.
        whole = min(begin + TILE, len(surface.pixel))
        origin, normal = tile_points(surface, mask, begin, whole, kept)
        buffers, out = new_packet_buffers(tracer), np.zeros((end - begin, N_COLUMNS), np.float32)
        for choice in chooser.choose(begin, origin, normal, buffers):
            part = slice(choice.part.start, min(choice.part.stop, end - begin))
            if part.start >= part.stop:
                break
            gather(
                origin[part], normal[part], table, seen, choice.found, needed, buffers,
                begin + part.start, net, shared, radiance, limits, exact[begin:end][part], out[part],
            )  # fmt: skip
        spread = batch_variance(out[:, INDIRECT : DIRECT + 3].sum(axis=1), out[:, SQUARE])
        return out[:, INDIRECT : INDIRECT + 3], out[:, DIRECT : DIRECT + 3], out[:, OPEN], spread

    def keep(begin: int, end: int, part: Part) -> None:
        indirect[begin:end], direct[begin:end], opened[begin:end], variance[begin:end] = part

    run(
        n_front,
        TILE,
        work,
        keep=keep,
        threads=threads,
        stage=STAGE,
        progress=progress,
        rays_per_item=n_samples,
    )
    return Gathered(indirect, direct, opened, variance, n_front * n_samples)


def ambient_occlusion(
    n_front: int,
    surface: Surface,
    mask: NDArray[np.uint16],
    tracer: Tracer,
    *,
    n_samples: int,
    distance: float,
    seed: int,
    threads: int,
    progress: Progress,
    kept: PointCache | None = None,
    run: TileRunner = run_tiles,
) -> NDArray[np.float32]:
    """Return the open share (n_front,) float32 of the hemisphere within `distance` metres."""
    out = np.zeros(n_front, np.float32)
    net = sobol_reversed(n_samples, seed, 6)
    shared = shared_bits_mask(n_samples)
    reach = np.float32(min(distance, 1.0e30))

    def work(begin: int, end: int) -> Part:
        points = tile_points(surface, mask, begin, end, kept)
        estimate_occlusion(
            *points, new_packet_buffers(tracer.without_transmittance()), begin, net, shared, reach, 0, out
        )
        return (out[begin:end],)

    def keep(begin: int, end: int, part: Part) -> None:
        out[begin:end] = part[0]

    run(
        n_front,
        TILE,
        work,
        keep=keep,
        threads=threads,
        stage=AO_STAGE,
        progress=progress,
        rays_per_item=n_samples,
    )
    return out
