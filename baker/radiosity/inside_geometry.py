"""Finds the points of texels that lie inside geometry.

Each texel has 16 points. A point is inside geometry if it lies in a solid (`topology.solids`), or if all its
rays hit black backs, the backs of one-sided surfaces.

A ray from inside a solid first hits the solid's back or an object in the solid. A ray from outside never hits
a back of a closed surface first, except if it passes through an edge. This happens rarely, so two rays that
first hit backs of solids are taken as proof that a point is inside.

A first pass casts a few rays from every texel to find candidates. A second pass tests each point of the
candidates and of their neighbours. So a texel that lies half under a box keeps the valid points of its
uncovered half.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.stage import Stage
from baker.core.texels import TexelBuffer
from baker.kernels.probe import BLACK_BACK, ELSEWHERE, PROOF, inside_hits
from baker.kernels.sampling import shared_bits_mask, sobol_reversed
from baker.kernels.surface import N_POINTS
from baker.radiosity.point_cache import points_of
from baker.radiosity.trace_job import TraceJob

# Texels per tile.
_TILE = 2048
# First pass: every 4th of a texel's 16 points is tested, with one ray.
_STRIDE = 4
# Second pass: rays from each of the 16 points.
_RAYS_PER_POINT = 8


def find_inside_geometry(
    texels: TexelBuffer, job: TraceJob, hit_kind: NDArray[np.uint8]
) -> tuple[NDArray[np.uint16], int]:
    """Find the valid points of texels, which are the points that do not lie inside geometry.

    Parameters
    ----------
    texels : TexelBuffer
        The n entries of the job.
    job : TraceJob
        Ray origins and scene. Its `valid_points` are not read, because all points are tested.
    hit_kind : (T,) uint8
        For each triangle, what a first hit on it implies about the ray's origin, see `kernels.probe`.

    Returns
    -------
    valid_points : (n,) uint16
        Bit k is set where point k does not lie inside geometry.
    rays : int
        Number of rays cast.
    """
    n = texels.n
    valid = np.full(n, 0xFFFF, np.uint16)
    if not n or not hit_kind.any():
        return valid, 0

    # Without solids, a point is invalid only if all its rays hit black backs.
    proof = PROOF if (hit_kind > BLACK_BACK).any() else ELSEWHERE
    first, rays = _test_points(job, hit_kind, np.arange(n), _Pass(1, _STRIDE, 3, 1))
    suspect: NDArray[np.bool_] = np.any(first, axis=1)
    chosen = np.flatnonzero(_with_neighbours(texels, suspect))
    inside, more = _test_points(job, hit_kind, chosen, _Pass(_RAYS_PER_POINT, 1, 4, proof))
    bits = (~inside).astype(np.uint32) << np.arange(N_POINTS, dtype=np.uint32)
    valid[chosen] = bits.sum(axis=1).astype(np.uint16)
    return valid, rays + more


class _Pass(NamedTuple):
    """Parameters of the first or second pass.

    rays_per_point : int, rays from each tested point
    stride : int, the points 0, `stride`, 2 `stride`, ... of the 16 points are tested
    pair : int, pair of dimensions of the Sobol sequence
    proof : int, number of hits on backs of solids that prove a point to be inside
    """

    rays_per_point: int
    stride: int
    pair: int
    proof: int


def _test_points(
    job: TraceJob, hit_kind: NDArray[np.uint8], chosen: NDArray[np.int64], test: _Pass
) -> tuple[NDArray[np.bool_], int]:
    """Return (m, w) bool, True for tested points that lie inside geometry, and the number of rays cast.

    hit_kind : (T,) uint8, see `find_inside_geometry`; chosen : (m,) int64, texel entries
    """
    every = np.full(job.n, 0xFFFF, np.uint16)
    wanted = np.arange(0, N_POINTS, test.stride, dtype=np.uint8)[None]
    hits = np.zeros((len(chosen), wanted.size), np.uint8)
    sobol_points = sobol_reversed(wanted.size * test.rays_per_point, job.seed, test.pair)
    shared = shared_bits_mask(len(sobol_points))
    rays = np.zeros(-(-len(chosen) // _TILE), np.int64)

    def work(begin: int, end: int) -> None:
        points = points_of(job.surface, every, chosen[begin:end], wanted)
        rays[begin // _TILE] = inside_hits(
            *points, job.lookup, hit_kind, job.occlusion_buffers(), begin, sobol_points, shared,
            test.rays_per_point, test.proof, hits,
        )  # fmt: skip

    job.run_here(Stage.INSIDE_GEOMETRY, len(chosen), _TILE, work, rays_per_item=len(sobol_points))
    inside: NDArray[np.bool_] = (hits % ELSEWHERE >= test.proof) | (hits < ELSEWHERE)
    return inside, int(rays.sum())


def _with_neighbours(texels: TexelBuffer, suspect: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (n,) bool: the candidates and their eight neighbours in the page.

    suspect : (n,) bool, the candidates; a back is a neighbour of backs only
    """
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
