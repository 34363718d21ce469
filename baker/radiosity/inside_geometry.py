"""Which points of which texels lie inside other geometry.

A point is buried if it lies inside a solid (`topology.solids`), or if all that it sees is black: backs of
one-sided surfaces all around. The first surface that a ray from the inside of a solid meets is that solid's
own, from behind, or another one that lies in there, too; no ray from outside ever meets the back of a closed
surface first. So two such rays prove a point to be inside, however much else is in there. A few rays from
every texel find suspects; suspects and their neighbours are then examined point by point, so that a texel
half under a box keeps its free half.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import run_tiles
from baker.core.progress import Progress
from baker.core.texels import TexelBuffer
from baker.kernels.probe import BLACK_BACK, ELSEWHERE, PROOF, inside_hits
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.kernels.surface import N_POINTS, Surface
from baker.kernels.triangle_lookup import TriangleLookup
from baker.radiosity.point_cache import points_of
from baker.trace.embree import Tracer
from baker.trace.packets import new_packet_buffers

STAGE = "buried texels"
_TILE = 2048
# First look: every 4th of the 16 points, one ray each. Second look: every point.
_STRIDE = 4
_RAYS_PER_POINT = 8


def find_buried(
    texels: TexelBuffer,
    surface: Surface,
    table: TriangleLookup,
    tells: NDArray[np.uint8],
    tracer: Tracer,
    *,
    seed: int,
    threads: int,
    progress: Progress,
) -> tuple[NDArray[np.uint16], int]:
    """Return (n,) uint16 masks of good points (bit k: point k is free), and the rays cast.

    tells : (T,) uint8, what each triangle says about who sees it, see `kernels.probe`
    """
    n = texels.n
    mask = np.full(n, 0xFFFF, np.uint16)
    if not n or not tells.any():
        return mask, 0

    # Without solids only points that see nothing but black are buried.
    proof = PROOF if (tells > BLACK_BACK).any() else ELSEWHERE
    cast = 0

    def look(
        chosen: NDArray[np.int64], rays_per_point: int, stride: int, pair: int, proof: int
    ) -> NDArray[np.bool_]:
        wanted = np.arange(0, N_POINTS, stride, dtype=np.uint8)[None]
        hits = np.zeros((len(chosen), wanted.size), np.uint8)
        net = sobol_reversed(wanted.size * rays_per_point, seed, pair)
        shared = shared_bits_mask(len(net))
        rays = np.zeros(-(-len(chosen) // _TILE), np.int64)

        def work(begin: int, end: int) -> None:
            points = points_of(surface, mask, chosen[begin:end], wanted)
            buffers = new_packet_buffers(tracer.without_transmittance())
            rays[begin // _TILE] = inside_hits(
                *points, table, tells, buffers, begin, net, shared, rays_per_point, proof, hits
            )

        run_tiles(
            len(chosen), _TILE, work, threads=threads, stage=STAGE, progress=progress, rays_per_item=len(net)
        )
        nonlocal cast
        cast += int(rays.sum())
        found: NDArray[np.bool_] = (hits % ELSEWHERE >= proof) | (hits < ELSEWHERE)
        return found

    first: NDArray[np.bool_] = np.any(look(np.arange(n), 1, _STRIDE, 3, 1), axis=1)
    suspect = _with_neighbours(texels, first)
    chosen = np.flatnonzero(suspect)
    good = ~look(chosen, _RAYS_PER_POINT, 1, 4, proof)
    mask[chosen] = (
        (good.astype(np.uint32) << np.arange(N_POINTS, dtype=np.uint32)).sum(axis=1).astype(np.uint16)
    )
    return mask, cast


def _with_neighbours(texels: TexelBuffer, suspect: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Add to suspects the texels around them in their page (fronts and backs apart)."""
    out = suspect.copy()
    for back in (False, True):
        side = np.flatnonzero(texels.back == back)
        if not suspect[side].any():
            continue
        size = texels.resolution
        pages = np.zeros((texels.n_pages, size + 2, size + 2), bool)
        page, rest = np.divmod(texels.pixel, size * size)
        row, column = np.divmod(rest, size)
        at = side[suspect[side]]
        for down in range(3):
            for right in range(3):
                pages[page[at], row[at] + down, column[at] + right] = True
        out[side] |= pages[page[side], row[side] + 1, column[side] + 1]
    return out
