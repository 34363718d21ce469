"""Finds the triangles whose opacity may be below 1 somewhere, and builds the table of their alpha."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.core.scene import Scene
from baker.kernels.alpha import (
    ALPHA,
    ALPHA_EDGE_1,
    ALPHA_EDGE_2,
    CUTOFF,
    ROW_LENGTH,
    SURFACE,
    TEXTURE,
    UV,
    UV_EDGE_1,
    UV_EDGE_2,
    AlphaTable,
    no_alpha,
)
from baker.kernels.shading import Shading
from baker.kernels.textures import TexturePack, value_limits
from baker.kernels.transmittance import TransmittanceTable
from baker.shading.kernels.pane import PANE
from baker.topology.unique_rows import first_equal, unique_rows
from baker.trace.embree import HitFilter


def build_alpha(
    scene: Scene,
    geometry: Geometry,
    pack: TexturePack,
    base_texture: NDArray[np.int32],
    base_uv: NDArray[np.float32],
) -> AlphaTable:
    """Find the triangles of MASK and BLEND materials whose opacity may be below 1 somewhere.

    The lower bound of a triangle's alpha is its smallest alpha at a corner times the smallest alpha of the
    whole texture.

    Parameters
    ----------
    scene : Scene
        Materials and meshes.
    geometry : Geometry
        Triangles of the scene.
    pack : TexturePack
        Textures.
    base_texture : (M,) int32
        For each material, the number of its base colour texture in `pack`, -1 for none.
    base_uv : (V, 2) float32
        Image uv of each lightmap vertex for the base colour texture; (1, 2) if no material has one.

    Returns
    -------
    AlphaTable
        Alpha of these triangles.
    """
    mode = np.array([m.alpha_mode for m in scene.materials])
    # For each material, the smallest alpha that blocks all light: the cutoff for MASK, 1 for BLEND.
    blocks = np.array(
        [m.alpha_cutoff if m.alpha_mode == "MASK" else 1.0 for m in scene.materials], np.float32
    )
    # Column CUTOFF of BLEND materials, see `kernels.alpha` and `kernels.pane`.
    blend_code = np.array(
        [-1.0 if m.reflectance is None else PANE - m.reflectance for m in scene.materials], np.float32
    )
    candidate = np.flatnonzero(np.isin(mode, ("MASK", "BLEND"))[geometry.material])
    if not len(candidate):
        return no_alpha()
    material = geometry.material[candidate]
    factor = np.array([m.base_colour[3] for m in scene.materials], np.float32)
    alpha = factor[material][:, None] * _corner_alpha(scene, geometry, candidate)
    # The alpha of a pane is the share that it does not transmit, which vertex colours do not change.
    pane = blend_code[material] < -1.0
    alpha[pane] = factor[material[pane]][:, None]
    lowest = np.array([1.0 if k < 0 else _lowest_alpha(pack, int(k)) for k in base_texture], np.float32)
    chosen = np.flatnonzero(alpha.min(axis=1) * lowest[material] < blocks[material])
    if not len(chosen):
        return no_alpha()
    triangle, material, alpha = candidate[chosen], material[chosen], alpha[chosen]
    slot = np.full(len(geometry.triangle), -1, np.int32)
    slot[triangle] = np.arange(len(triangle), dtype=np.int32)
    row = np.zeros((len(triangle), ROW_LENGTH), np.float32)
    if len(base_uv) > 1:
        uv = base_uv[geometry.triangle[triangle]]
        row[:, UV : UV + 2] = uv[:, 0]
        row[:, UV_EDGE_1 : UV_EDGE_1 + 2] = uv[:, 1] - uv[:, 0]
        row[:, UV_EDGE_2 : UV_EDGE_2 + 2] = uv[:, 2] - uv[:, 0]
    row[:, ALPHA] = alpha[:, 0]
    row[:, ALPHA_EDGE_1 : ALPHA_EDGE_2 + 1] = alpha[:, 1:] - alpha[:, :1]
    row[:, CUTOFF] = np.where(mode[material] == "MASK", blocks[material], blend_code[material])
    row[:, TEXTURE] = base_texture[material]
    blend = np.flatnonzero(row[:, CUTOFF] < 0)
    row[blend, SURFACE] = _connected_surface(geometry, triangle[blend])
    return AlphaTable(slot, row)


def hit_filter(shading: Shading, table: TransmittanceTable | None = None) -> HitFilter | None:
    """Return the filter that accepts or rejects ray hits on triangles that let light through.

    Parameters
    ----------
    shading : Shading
        Materials.
    table : TransmittanceTable, optional
        BLEND triangles; None if there are none.

    Returns
    -------
    HitFilter or None
        Argument `hit_filter` of `RayScene`; None if all triangles are opaque.
    """
    if not len(shading.alpha.row):
        return None
    # Import the compiled function only if it is needed, because loading it takes time.
    from baker.shading.kernels.alpha_filter import filter_of

    return filter_of(shading.alpha, table, shading.pack)


def _corner_alpha(scene: Scene, geometry: Geometry, triangle: NDArray[np.int64]) -> NDArray[np.float32]:
    """Return (n, 3) float32: the vertex alpha at the corners of n triangles, 1 without vertex colours."""
    alpha = np.ones((len(triangle), 3), np.float32)
    # Triangles are sorted by instance.
    bound = np.searchsorted(geometry.instance[triangle], np.arange(len(scene.instances) + 1))
    for index, instance in enumerate(scene.instances):
        colour = scene.meshes[instance.mesh].colour
        own = slice(bound[index], bound[index + 1])
        if colour is not None:
            alpha[own] = colour[geometry.vertex_source[geometry.triangle[triangle[own]]], 3]
    return alpha


def _connected_surface(geometry: Geometry, triangle: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return (n,) int64: the number, below 2^24, of the connected surface of each triangle.

    Corners of one instance at the same position are one vertex. Triangles that share vertices are connected.
    Triangles with the same three vertices are separate layers and get different numbers.
    """
    if not len(triangle):
        return np.zeros(0, np.int64)
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    corner = geometry.triangle[triangle].reshape(-1)
    # Add 0 to convert -0 to 0, because rows are compared by their bytes.
    position = geometry.position[corner] + np.float32(0.0)
    instance = np.repeat(geometry.instance[triangle], 3)[:, None]
    kept, vertex = unique_rows([position, instance], len(corner))
    vertex = np.sort(vertex.reshape(-1, 3), axis=1)
    link = np.concatenate([vertex[:, :2], vertex[:, 1:]])
    graph = coo_array((np.ones(len(link), bool), (link[:, 0], link[:, 1])), shape=(len(kept), len(kept)))
    part = connected_components(graph, directed=False)[1][vertex[:, 0]].astype(np.int64)
    same = first_equal([vertex], len(vertex))
    order = np.argsort(same, kind="stable")
    begins = np.flatnonzero(np.diff(same[order], prepend=-1))
    layer = np.zeros(len(same), np.int64)
    layer[order] = np.arange(len(same)) - np.repeat(begins, np.diff(begins, append=len(same)))
    # Reduce the numbers modulo 2^24, because float32 represents only whole numbers up to 2^24 exactly.
    return unique_rows([part[:, None], layer[:, None]], len(part))[1] % (1 << 24)


def _lowest_alpha(pack: TexturePack, k: int) -> float:
    """Return the smallest alpha of a texture."""
    lowest, _ = value_limits(pack, k)
    _, _, _, alpha = lowest
    return float(alpha)
