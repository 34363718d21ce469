"""Direct light of every texel: lights without area, then emissive triangles.

Two estimates come out. The first leaves to the final gather what its rays find at emitters (MIS);
the second is complete and lights the surfaces that later bounces start from.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import kind_of
from baker.core.parallel import Part, TileRunner, run_tiles
from baker.core.progress import Progress
from baker.core.scene import PunctualLight
from baker.kernels.emitters import Emitters, needed_shading
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.kernels.shading import Shading
from baker.kernels.surface import N_POINTS, Surface
from baker.kernels.triangle_lookup import TriangleLookup
from baker.radiosity.emitter_choice import Choice, LampChooser
from baker.radiosity.kernels.area_light import light_samples
from baker.radiosity.kernels.gather import DIRECT, N_COLUMNS, gather
from baker.radiosity.kernels.shadow import add_visible
from baker.radiosity.kernels.side_table import nothing_seen
from baker.radiosity.point_cache import PointCache, tile_points
from baker.trace.embree import Tracer
from baker.trace.packets import PacketBuffers, new_packet_buffers

# Texels that are lit together; `gather` uses the same tiles, so that both see the same light chances.
TILE = 512
STAGE = "direct light"
# Hemisphere rays that complete the second estimate close to emitters: where a cluster's radius is more than
# this share of its distance. Further away shadow rays alone are as good.
N_HEMISPHERE = 4
CLOSE = 0.5


@dataclass(frozen=True)
class DirectLight:
    """Direct irradiance of all texel entries.

    Attributes
    ----------
    weighted : (n, 3) float32, lx, without what gather rays find at emitters
    complete : (n, 3) float32, lx
    variance : (n,) float32, lx2, of the mean of `weighted`'s RGB
    exact : (n,) uint8, 1 where `weighted` is complete, too
    rays : int, shadow rays cast at lamps; of other rays those that may be needed
    """

    weighted: NDArray[np.float32]
    complete: NDArray[np.float32]
    variance: NDArray[np.float32]
    exact: NDArray[np.uint8]
    rays: int


def direct_light(
    surface: Surface,
    mask: NDArray[np.uint16],
    table: TriangleLookup,
    lights: tuple[PunctualLight, ...],
    emitters: Emitters,
    shading: Shading,
    tracer: Tracer,
    *,
    n_light: int,
    n_gather: int,
    seed: int,
    threads: int,
    progress: Progress,
    chart: NDArray[np.int32] | None = None,
    kept: PointCache | None = None,
    run: TileRunner = run_tiles,
) -> DirectLight:
    """Light every texel entry directly.

    Parameters
    ----------
    mask : (n,) uint16
        Bit k is set if point k of the texel is not buried.
    n_light, n_gather : int
        Shadow rays per texel, and the final gather's hemisphere rays that they are weighed against.
    kept : PointCache, optional
        Where points are left for later stages with the same tiles.
    chart : (n,) int32, optional
        Of each entry: lights are chosen for each chart of a tile.
    run : TileRunner
        Works on the tiles.
    """
    n = len(surface.pixel)
    weighted, complete = np.zeros((n, 3), np.float32), np.zeros((n, 3), np.float32)
    variance, exact = np.zeros(n, np.float32), np.zeros(n, np.uint8)
    net = sobol_reversed(n_light, seed, 1)
    chooser = LampChooser.build(emitters, n_light, chart)
    hidden_net = sobol_reversed(chooser.n_hidden, seed, 3)
    few = sobol_reversed(N_HEMISPHERE, seed, 2)
    weigh = {near: np.array([n_gather, N_HEMISPHERE * near], np.float64) for near in (True, False)}
    punctual = [(light, kind) for light in lights for kind in [kind_of(light)] if max(light.intensity) > 0]

    dark, black = nothing_seen(), np.zeros(3, np.float32)
    limits = np.array([0.0, n_light], np.float64)
    few_shared = shared_bits_mask(N_HEMISPHERE)

    cast = np.zeros(-(-n // TILE), np.int64)
    needed = needed_shading(emitters, shading)

    def from_emitters(
        choice: Choice,
        origin: NDArray[np.float32],
        normal: NDArray[np.float32],
        begin: int,
        buffers: PacketBuffers,
        out: NDArray[np.float32],
        spread: NDArray[np.float32],
        done: NDArray[np.uint8],
    ) -> int:
        near, n_cast = choice.view > CLOSE, 0
        for lamps, own_net in ((choice.seen, net), (choice.hidden, hidden_net)):
            if lamps is None or not lamps.chance.any():
                continue
            own, second = np.zeros_like(out), np.zeros(len(out), np.float32)
            complete = done if lamps is choice.seen else np.zeros(len(out), np.uint8)
            n_cast += light_samples(
                origin, normal, lamps, needed, buffers, begin, own_net, shared_bits_mask(len(own_net)),
                weigh[near], complete, own, second,
            )  # fmt: skip
            out += own
            spread += batch_variance(own[:, :3].sum(axis=1), second)
        if near and (choice.hidden is not None or not done.all()):
            n_cast += N_HEMISPHERE * len(out)
            found = np.zeros((len(out), N_COLUMNS), np.float32)
            gather(
                origin, normal, table, dark, choice.found, needed, buffers, begin, few, few_shared,
                black, limits, done, found,
            )  # fmt: skip
            out[:, 3:] += found[:, DIRECT : DIRECT + 3]
        return n_cast

    def work(begin: int, end: int) -> Part:
        buffers = new_packet_buffers(tracer)
        origin, normal = tile_points(surface, mask, begin, end, kept)
        out, spread = np.zeros((end - begin, 6), np.float32), np.zeros(end - begin, np.float32)
        done, n_cast = np.zeros(end - begin, np.uint8), 0
        for choice in chooser.choose(begin, origin, normal, buffers):
            part = choice.part
            n_cast += from_emitters(
                choice,
                origin[part],
                normal[part],
                begin + part.start,
                buffers,
                out[part],
                spread[part],
                done[part],
            )
        if punctual:
            ray = np.zeros((end - begin, N_POINTS, 4), np.float32)
            weight = np.zeros((end - begin, N_POINTS), np.float32)
            for light, kind in punctual:
                kind.fill(light, origin, normal, ray, weight)
                add_visible(buffers, origin, ray, weight, np.array(light.intensity, np.float32), out)
        return out[:, :3], out[:, 3:], spread, done, n_cast

    def keep(begin: int, end: int, part: Part) -> None:
        weighted[begin:end], complete[begin:end], variance[begin:end], exact[begin:end] = part[:4]
        cast[begin // TILE] = part[4]

    rays = n_light * bool(len(emitters.power)) + N_POINTS * len(punctual)
    run(n, TILE, work, keep=keep, threads=threads, stage=STAGE, progress=progress, rays_per_item=rays)
    return DirectLight(weighted, complete, variance, exact, int(cast.sum()) + N_POINTS * len(punctual) * n)


def batch_variance(total: NDArray[np.float32], squares: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return the variance of the mean of RGB of sums over 16 batches.

    Parameters
    ----------
    total : (m,) float32
        Sum of R, G and B over all batches.
    squares : (m,) float32
        Sum of the squares of the batches' shares of it.
    """
    spread = np.maximum(squares - total * total / N_POINTS, 0) * (N_POINTS / (N_POINTS - 1.0)) / 9.0
    return spread.astype(np.float32)
