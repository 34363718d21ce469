"""Builds the Embree scene of a bake, with filter functions for triangles that let light through."""

from __future__ import annotations

from baker.core.geometry import Geometry
from baker.kernels.shading import Shading
from baker.shading.alpha import hit_filter
from baker.shading.transmittance import build_transmittance_table, transmittance_filter
from baker.trace.embree import RayScene


def build_ray_tree(geometry: Geometry, shading: Shading, *, threads: int) -> RayScene:
    """Build the Embree scene of all triangles.

    Parameters
    ----------
    geometry : Geometry
        Triangles.
    shading : Shading
        Materials of these triangles.
    threads : int
        Number of threads that build the tree; 0 means all.

    Returns
    -------
    RayScene
        The Embree scene.
    """
    table = build_transmittance_table(shading)
    passing, colouring = hit_filter(shading, table), transmittance_filter(shading, table)
    return RayScene(
        geometry.position, geometry.triangle, threads=threads, hit_filter=passing, blend_filter=colouring
    )
