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
from baker.kernels.gather import open_share
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.kernels.surface import Surface
from baker.radiosity.points import points_of
from baker.trace.embree import Tracer
from baker.trace.packets import new_caster

STAGE = "crevices"
_TILE = 512
_RAYS = 16
# A texel lies in a gap if less than this share of its rays gets further than so many texels: for gaps about
# as wide as a texel, and for gaps about as wide as a patch.
_OPEN, _REACH = 0.25, (2.0, 8.0)


def gap_depth(
    texels: TexelBuffer,
    surface: Surface,
    mask: NDArray[np.uint16],
    tracer: Tracer,
    *,
    seed: int,
    threads: int,
    progress: Progress,
) -> tuple[NDArray[np.uint8], int]:
    """Find texels in gaps with short rays.

    Parameters
    ----------
    mask : (n,) uint16
        Bit k is set if point k of a texel is not buried.

    Returns
    -------
    depth : (n,) uint8
        Of each entry: 0 in the open, 1 in a gap some texels wide, 2 in one about a texel wide.
    rays : int
        Cast.
    """
    n = texels.n
    share = np.ones((len(_REACH), n), np.float32)
    net, shared = sobol_reversed(_RAYS, seed, 8), shared_bits_mask(_RAYS)

    def work(begin: int, end: int) -> None:
        # Texels of a tile are neighbours: one length suits them all.
        side = np.sqrt(np.median(texels.area[begin:end]))
        points = points_of(surface, mask, np.arange(begin, end))
        for row, reach in zip(share, _REACH, strict=True):
            open_share(*points, new_caster(tracer), begin, net, shared, np.float32(reach * side), row)

    rays = len(_REACH) * _RAYS
    run_tiles(n, _TILE, work, threads=threads, stage=STAGE, progress=progress, rays_per_item=rays)
    # Whatever lies in a narrow gap lies in a wide one, too.
    return (share < _OPEN).sum(axis=0, dtype=np.uint8), n * rays
