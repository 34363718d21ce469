"""Builds the ray tree of a scene, with the filters of triangles that let light through."""

from __future__ import annotations

from baker.core.geometry import Geometry
from baker.kernels.shading import Shading
from baker.shading.alpha import hit_filter
from baker.shading.transmittance import build_transmittance_table, transmittance_filter
from baker.trace.embree import RayScene


def build_ray_tree(geometry: Geometry, shading: Shading, *, threads: int) -> RayScene:
    """Return the tree of all triangles.

    Parameters
    ----------
    geometry : Geometry
        Triangles.
    shading : Shading
        Their materials.
    threads : int
        Threads of the build; 0 means all.

    Returns
    -------
    RayScene
        The tree.
    """
    table = build_transmittance_table(shading)
    passing, colouring = hit_filter(shading, table), transmittance_filter(shading, table)
    return RayScene(
        geometry.position, geometry.triangle, threads=threads, hit_filter=passing, blend_filter=colouring
    )
