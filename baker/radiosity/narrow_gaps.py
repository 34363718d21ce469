"""How deep texels lie in narrow gaps: under a rug, between books, where a cupboard meets the wall.

Light falls off within the width of a gap at its mouth. A patch that reached from the lit floor to below the
rug would carry the floor's light there: texels in gaps have patches of their own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.parallel import run_tiles
from baker.core.progress import Progress
from baker.core.texels import TexelBuffer
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.kernels.surface import Surface
from baker.radiosity.direct import TILE
from baker.radiosity.kernels.gather import estimate_occlusion
from baker.radiosity.point_cache import PointCache, tile_points
from baker.trace.embree import Tracer
from baker.trace.packets import new_packet_buffers

STAGE = "crevices"
# Sixteen neighbouring texels of which at most one of these first rays each was blocked are in the open.
_RAYS, _LOOK = 16, 4
# A texel lies in a gap if less than this share of its rays gets further than so many texels: for gaps about
# as wide as a texel, and for gaps about as wide as a patch.
_OPEN, _NEAR, _FAR = 0.25, 2.0, 8.0


def gap_depth(
    texels: TexelBuffer,
    surface: Surface,
    mask: NDArray[np.uint16],
    tracer: Tracer,
    *,
    seed: int,
    threads: int,
    progress: Progress,
    kept: PointCache | None = None,
) -> tuple[NDArray[np.uint8], int]:
    """Find texels in gaps with short rays.

    Parameters
    ----------
    mask : (n,) uint16
        Bit k is set if point k of a texel is not buried.
    kept : PointCache, optional
        Points of an earlier stage with the same tiles.

    Returns
    -------
    depth : (n,) uint8
        Of each entry: 0 in the open, 1 in a gap some texels wide, 2 in one about a texel wide.
    rays : int
        Cast.
    """
    n = texels.n
    near, far = np.ones((2, n), np.float32)
    net, shared = sobol_reversed(_RAYS, seed, 8), shared_bits_mask(_RAYS)
    cast = np.zeros(-(-n // TILE), np.int64)

    def work(begin: int, end: int) -> None:
        # Texels of a tile are neighbours: one length suits them all.
        side = np.sqrt(np.median(texels.area[begin:end]))
        points = tile_points(surface, mask, begin, end, kept)
        for share, reach in ((far, _FAR), (near, _NEAR)):
            cast[begin // TILE] += estimate_occlusion(
                *points,
                new_packet_buffers(tracer.without_transmittance()),
                begin,
                net,
                shared,
                np.float32(reach * side),
                _LOOK,
                share,
            )
            # Whatever lies in a narrow gap lies in a wide one, too.
            if (share[begin:end] >= _OPEN).all():
                break

    run_tiles(n, TILE, work, threads=threads, stage=STAGE, progress=progress, rays_per_item=_RAYS)
    return (far < _OPEN).astype(np.uint8) + (near < _OPEN), int(cast.sum())
