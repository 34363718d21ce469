"""Finds texels in narrow gaps: under a rug, between books, between a cupboard and the wall.

Inside a gap, light falls off over a distance of about the gap's width. A patch that extends from the lit
floor to below a rug would have the floor's radiosity there, so texels in gaps share no patch with texels
outside.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.stage import Stage
from baker.core.texels import TexelBuffer
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.radiosity.direct import TILE
from baker.radiosity.kernels.gather import estimate_occlusion
from baker.radiosity.trace_job import TraceJob

# Sixteen neighbouring texels are outside gaps if at most one of the first _EARLY_OUT rays of each is blocked.
_RAYS, _EARLY_OUT = 16, 4
# A texel lies in a gap if less than the share _OPEN of its rays is unblocked up to a distance in texel sides:
# _NEAR for gaps about as wide as a texel, _FAR for gaps about as wide as a patch.
_OPEN, _NEAR, _FAR = 0.25, 2.0, 8.0


def gap_level(texels: TexelBuffer, job: TraceJob) -> tuple[NDArray[np.uint8], int]:
    """Find texels in gaps with short rays.

    Parameters
    ----------
    texels : TexelBuffer
        The n entries of the job.
    job : TraceJob
        Points and ray buffers of these entries.

    Returns
    -------
    level : (n,) uint8
        Of each entry: 0 outside gaps, 1 in a gap some texels wide, 2 in one about a texel wide.
    rays : int
        Number of rays cast.
    """
    n = texels.n
    near, far = np.ones((2, n), np.float32)
    sobol_points, shared = sobol_reversed(_RAYS, job.seed, 8), shared_bits_mask(_RAYS)
    cast = np.zeros(-(-n // TILE), np.int64)

    def work(begin: int, end: int) -> None:
        # Use the median side for all texels of a tile, which are neighbours.
        side = np.sqrt(np.median(texels.area[begin:end]))
        points = job.tile_points(begin, end)
        for share, sides in ((far, _FAR), (near, _NEAR)):
            max_distance = np.float32(sides * side)
            cast[begin // TILE] += estimate_occlusion(
                *points, job.occlusion_buffers(), begin, sobol_points, shared, max_distance, _EARLY_OUT, share
            )
            # A narrow gap is part of a wide one: without wide gaps there are no narrow ones.
            if (share[begin:end] >= _OPEN).all():
                break

    job.run_here(Stage.NARROW_GAPS, n, TILE, work, rays_per_item=_RAYS)
    return (far < _OPEN).astype(np.uint8) + (near < _OPEN), int(cast.sum())
