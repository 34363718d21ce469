"""Builds the Embree scene of a bake, with filter functions for triangles that let light through."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.kernels.shading import Shading
from baker.shading.alpha import hit_filter
from baker.shading.transmittance import build_transmittance_table, transmittance_filter
from baker.trace.embree import RayScene


def build_ray_tree(
    geometry: Geometry, shading: Shading, *, threads: int, unseen: NDArray[np.bool_] | None = None
) -> RayScene:
    """Build the Embree scene of the triangles.

    Parameters
    ----------
    geometry : Geometry
        Triangles.
    shading : Shading
        Materials of these triangles.
    threads : int
        Number of threads that build the tree; 0 means all.
    unseen : (I,) bool, optional
        Instances that no ray hits.

    Returns
    -------
    RayScene
        The Embree scene.
    """
    table = build_transmittance_table(shading)
    passing, colouring = hit_filter(shading, table), transmittance_filter(shading, table)
    position, triangle = geometry.position, geometry.triangle
    if unseen is not None and unseen.any():
        # Embree skips triangles whose corners are NaN. The other triangles keep their numbers.
        position = np.concatenate([position, np.full((1, 3), np.nan, np.float32)])
        triangle = np.where(unseen[geometry.instance][:, None], np.int32(len(geometry.position)), triangle)
    return RayScene(position, triangle, threads=threads, hit_filter=passing, blend_filter=colouring)
