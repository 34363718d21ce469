"""Finds texels in narrow gaps: under a rug, between books, between a cupboard and the wall.

Light decreases strongly between the opening of a gap and a depth of about one gap width. A patch has a single
radiosity. If a patch contained the lit floor beside a rug and the floor under it, both would get the same
radiosity. Therefore texels inside gaps and texels outside gaps belong to different patches.
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

# _RAYS: number of rays per texel.
# _EARLY_OUT: number of rays per texel after which tracing may stop. If at most one of the first _EARLY_OUT
# rays of each of sixteen consecutive texels is blocked, these texels are outside gaps.
_RAYS, _EARLY_OUT = 16, 4
# _OPEN: limit of the share of unblocked rays of a texel. Below this limit, the texel lies in a gap.
# _NEAR: length of the rays, in texel sides, that find gaps about as wide as a texel.
# _FAR: length of the rays, in texel sides, that find gaps about as wide as a patch.
_OPEN, _NEAR, _FAR = 0.25, 2.0, 8.0


def gap_level(texels: TexelBuffer, job: TraceJob) -> tuple[NDArray[np.uint8], int]:
    """Find the texels in narrow gaps by casting short rays.

    Parameters
    ----------
    texels : TexelBuffer
        The n entries of the job.
    job : TraceJob
        Ray origins of these entries, and the scene.

    Returns
    -------
    level : (n,) uint8
        Gap level of each entry: 0 outside gaps, 1 in a gap several texels wide, 2 in a gap about a texel
        wide.
    rays : int
        Number of rays cast.
    """
    n = texels.n
    near, far = np.ones((2, n), np.float32)
    sobol_points, shared = sobol_reversed(_RAYS, job.seed, 8), shared_bits_mask(_RAYS)
    cast = np.zeros(-(-n // TILE), np.int64)

    def work(begin: int, end: int) -> None:
        # Use the same ray length for all texels of the tile, computed from their median area.
        side = np.sqrt(np.median(texels.area[begin:end]))
        points = job.tile_points(begin, end)
        for share, sides in ((far, _FAR), (near, _NEAR)):
            max_distance = np.float32(sides * side)
            cast[begin // TILE] += estimate_occlusion(
                *points, job.occlusion_buffers(), begin, sobol_points, shared, max_distance, _EARLY_OUT, share
            )
            # Skip the shorter rays if no texel of the tile lies in a gap several texels wide.
            if (share[begin:end] >= _OPEN).all():
                break

    job.run_here(Stage.NARROW_GAPS, n, TILE, work, rays_per_item=_RAYS)
    return (far < _OPEN).astype(np.uint8) + (near < _OPEN), int(cast.sum())
