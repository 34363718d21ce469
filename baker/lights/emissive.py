"""Builds the table of emitters: emissive triangles with their power, in clusters of neighbours.

    power = pi area L

L is the luminance of the radiance. For a part of a textured triangle, L is the mean of R, G and B. The power
of a two-sided triangle is twice as large. Textured triangles are cut into parts (`lights.emissive_texture`),
and each part is an emitter. The radiance at a point of a part is looked up in the texture. In three cases,
the part has its exact mean radiance instead: the texture is constant in the part, the part is very small
(`_SMALL`), or its radiance varies too much (`_SPARSE`). In triangles with alpha, the radiance is always
looked up.

Based on: see `kernels.emitters`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import LUMINANCE_WEIGHTS
from baker.core.geometry import Geometry
from baker.kernels.emitters import (
    AREA,
    CLUSTER,
    CORNER,
    CUMULATIVE,
    INSIDE,
    NORMAL,
    RADIANCE,
    ROW_LENGTH,
    SHARE,
    TEXTURED,
    TWO_SIDED,
    Emitters,
)  # fmt: skip
from baker.kernels.shading import Shading
from baker.lights.emissive_texture import EmissiveTextures, brightness, cut

_LUMINANCE = np.array(LUMINANCE_WEIGHTS)
# Largest number of clusters. The time to compute the weights of clusters for a tile of texels is proportional
# to the number of clusters.
MAX_CLUSTERS = 256
# Largest number of parts of all textured triangles, minus the number of textured triangles.
MOST_PARTS = 32768
# Largest total weight of the parts of one triangle. Clusters have about equal weights; an uncut triangle has
# weight 1.
_CROWD = 64.0
# Limits of variance / mean^2 of the radiance in a part. Up to _CONSTANT (relative standard deviation 0.001),
# the radiance is treated as uniform. Above _SPARSE, the part has its mean radiance, because most texture
# samples would be black, and no more parts were available to divide it.
_CONSTANT, _SPARSE = 1.0e-6, 1.0
# Limit of the longest edge of a part, as a share of the scene's diagonal. Up to this limit, a part that is
# also at most one texel of the texture wide has its mean radiance instead of the texture. The difference is
# visible only from small distances, and sampling the mean causes no noise.
_SMALL = 1.0 / 128.0


@dataclass(frozen=True)
class _Pieces:
    """The m emitters before they are sorted: whole triangles, then parts.

    triangle : (m,) int64, triangle of the scene
    inside : (m, 3) float64, see `emissive_texture.Parts`
    radiance : (m, 3) float64, mean radiance, cd/m2
    brightness : (m,) float64, cd/m2; luminance of whole triangles, mean of R, G and B of parts
    textured : (m,) bool, whether the radiance is looked up in the texture; else it is `radiance`
    node (k, 4), root (T,) int32 : see `Emitters`, with indices of these m emitters
    """

    triangle: NDArray[np.int64]
    inside: NDArray[np.float64]
    radiance: NDArray[np.float64]
    brightness: NDArray[np.float64]
    textured: NDArray[np.bool_]
    node: NDArray[np.int32]
    root: NDArray[np.int32]


def build_emitters(geometry: Geometry, shading: Shading, most_parts: int = MOST_PARTS) -> Emitters:
    """Find the triangles that emit, and group them into clusters.

    Parameters
    ----------
    geometry : Geometry
        Triangles of the scene.
    shading : Shading
        Materials of these triangles.
    most_parts : int
        Largest number of parts of all textured triangles, minus the number of textured triangles.

    Returns
    -------
    Emitters
        Emitters in spatial order, in at most `MAX_CLUSTERS` clusters.
    """
    piece = _find_pieces(geometry, shading, most_parts)
    area = (geometry.area[piece.triangle] * piece.inside[:, 2] ** 2).astype(np.float32)
    power = np.pi * area * piece.brightness
    two_sided = geometry.double_sided[piece.triangle]
    power = np.where(two_sided, 2.0 * power, power)
    corner = _corners(geometry, piece)
    order = _spatial_order(corner)
    chosen = order[power[order] > 0]
    triangle, power = piece.triangle[chosen], power[chosen]
    two_sided, corner = two_sided[chosen], corner[chosen]
    first = _cluster_bounds(triangle)
    n_clusters = len(first) - 1
    cluster = np.repeat(np.arange(n_clusters, dtype=np.int32), np.diff(first))
    cluster_power = np.bincount(cluster, power, n_clusters)
    share = power / cluster_power[cluster]
    cumulative = np.cumsum(share) - np.arange(n_clusters)[cluster]
    centre, radius, axis, spread = _bounds(corner, geometry.face_normal[triangle], two_sided, first)
    row = np.zeros((len(triangle), ROW_LENGTH), np.float32)
    row[:, CORNER : CORNER + 9] = corner.reshape(-1, 9)
    row[:, NORMAL : NORMAL + 3] = geometry.face_normal[triangle]
    row[:, AREA] = area[chosen]
    row[:, TWO_SIDED] = two_sided
    row[:, SHARE] = share
    row[:, CUMULATIVE] = np.maximum(cumulative, 0)
    row[:, CLUSTER] = cluster
    textured = piece.textured[chosen]
    factor = shading.emission[shading.material[triangle]] if len(triangle) else np.zeros((0, 3))
    row[:, RADIANCE : RADIANCE + 3] = np.where(textured[:, None], factor, piece.radiance[chosen])
    row[:, TEXTURED] = textured
    row[:, INSIDE : INSIDE + 3] = piece.inside[chosen]
    node, root = _renumbered(piece, chosen)
    number, weight = triangle.astype(np.int32), cluster_power.astype(np.float32)
    return Emitters(row, number, first, centre, radius, weight, axis, spread, node, root)


def _renumbered(piece: _Pieces, chosen: NDArray[np.int64]) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return `node` and `root` for the new numbering, in which emitter i is emitter chosen[i] of `piece`.

    Emitters that are not chosen, which have no power, get the code -1 (black).
    """
    number = np.full(len(piece.triangle) + 1, -1, np.int32)
    number[chosen] = np.arange(len(chosen))
    node, root = (
        np.where(code >= -1, number[np.maximum(code, -1)], code).astype(np.int32)
        for code in (piece.node, piece.root)
    )
    return node, root


def _find_pieces(geometry: Geometry, shading: Shading, most_parts: int) -> _Pieces:
    """Return the untextured triangles that emit, and the parts of textured triangles that emit."""
    candidate = np.flatnonzero((shading.emission.max(axis=1) > 0)[geometry.material] & (geometry.area > 0))
    material = geometry.material[candidate]
    whole = np.tile([0.0, 0.0, 1.0], (len(candidate), 1))
    radiance = shading.emission[material].astype(np.float64)
    textured = shading.emission_texture[material] >= 0
    root = np.full(len(geometry.triangle), -1, np.int32)
    root[candidate] = np.arange(len(candidate))
    if not textured.any():
        none = np.zeros((0, 4), np.int32)
        return _Pieces(candidate, whole, radiance, radiance @ _LUMINANCE, textured, none, root)
    image = candidate[textured]
    parts = cut(
        EmissiveTextures.of(shading, image),
        geometry.area[image].astype(np.float64),
        _SMALL * geometry.diagonal / _longest(geometry.position[geometry.triangle[image]]),
        most_parts,
    )
    untextured = candidate[~textured]
    root[untextured] = np.arange(len(untextured))
    # In triangles with alpha, look up the texture in all parts: radiance and alpha may vary together, so they
    # must be multiplied at the same point.
    varied = (parts.spread > _CONSTANT) & (parts.spread <= _SPARSE)
    if len(shading.alpha.slot):
        varied |= shading.alpha.slot[image][parts.owner] >= 0
    shift = np.int32(len(untextured))
    node = np.where(parts.node >= 0, parts.node + shift, parts.node).astype(np.int32)
    root[image] = np.where(parts.root >= 0, parts.root + shift, parts.root)
    return _Pieces(
        np.concatenate([untextured, image[parts.owner]]),
        np.concatenate([whole[~textured], parts.inside]),
        np.concatenate([radiance[~textured], parts.mean]),
        np.concatenate([radiance[~textured] @ _LUMINANCE, brightness(parts.mean)]),
        np.concatenate([np.zeros(len(untextured), bool), varied]),
        node,
        root,
    )


def _longest(corner: NDArray[np.float32]) -> NDArray[np.float64]:
    """Return (n,) float64: the length of the longest edge of each triangle.

    corner : (n, 3, 3) float32, positions of the corners
    """
    edge = corner.astype(np.float64) - corner[:, [1, 2, 0]]
    longest: NDArray[np.float64] = np.linalg.norm(edge, axis=2).max(axis=1)
    return np.maximum(longest, 1e-300)


def _corners(geometry: Geometry, piece: _Pieces) -> NDArray[np.float32]:
    """Return (m, 3, 3) float32: the positions of the corners of each emitter, metres."""
    corner = geometry.position[geometry.triangle[piece.triangle]]
    part = np.flatnonzero(piece.inside[:, 2] != 1.0)
    if len(part):
        whole, inside = corner[part].astype(np.float64), piece.inside[part]
        edge = whole[:, 1:] - whole[:, :1]
        at = whole[:, 0] + np.einsum("mk,mka->ma", inside[:, :2], edge)
        step = inside[:, 2, None] * edge.transpose(1, 0, 2)
        corner[part] = np.stack([at, at + step[0], at + step[1]], axis=1)
    return corner


def _cluster_bounds(triangle: NDArray[np.int64]) -> NDArray[np.int32]:
    """Return (C + 1,) int32: cluster c contains the emitters bound[c] to bound[c + 1] - 1.

    triangle : (m,) int64, triangle of each emitter, in spatial order
    """
    n = len(triangle)
    n_clusters = min(n, MAX_CLUSTERS)
    _, which, count = np.unique(triangle, return_inverse=True, return_counts=True)
    if not n or count.max() == 1:
        return np.linspace(0, n, n_clusters + 1).round().astype(np.int32)
    # Limit the total weight of a triangle's parts. Otherwise a screen of a thousand parts would get nearly
    # all clusters.
    weight = np.cumsum(np.minimum(_CROWD / count, 1.0)[which.reshape(-1)])
    bound = np.searchsorted(weight, np.linspace(0, weight[-1], n_clusters + 1)[1:-1])
    return np.unique(np.concatenate([[0], bound, [n]])).astype(np.int32)


def _spatial_order(corner: NDArray[np.float32]) -> NDArray[np.int64]:
    """Return (m,) int64: the order of triangles along a 3D Morton curve through their centroids.

    corner : (m, 3, 3) float32, positions of the corners
    """
    if not len(corner):
        return np.zeros(0, np.int64)
    centre = corner.mean(axis=1).astype(np.float64)
    low = centre.min(axis=0)
    cell = ((centre - low) / max(float(np.ptp(centre, axis=0).max()), 1e-12) * 1023.0).astype(np.int64)
    key = np.zeros(len(cell), np.int64)
    for bit in range(10):
        for axis in range(3):
            key |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(key, kind="stable")


def _bounds(
    corner: NDArray[np.float32],
    normal: NDArray[np.float32],
    two_sided: NDArray[np.bool_],
    first: NDArray[np.int32],
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Return `centre`, `radius`, `axis` and `spread` of each cluster, see `Emitters`.

    corner : (m, 3, 3) float32, metres; normal : (m, 3) float32; first : (C + 1,) int32, see `Emitters`
    """
    n = len(first) - 1
    centre, axis = np.zeros((n, 3), np.float32), np.zeros((n, 3), np.float32)
    radius, spread = np.zeros(n, np.float32), np.full(n, np.pi, np.float32)
    for c in range(n):
        span = slice(first[c], first[c + 1])
        points = corner[span].reshape(-1, 3)
        centre[c] = 0.5 * (points.min(axis=0) + points.max(axis=0))
        radius[c] = np.linalg.norm(points - centre[c], axis=1).max() * 1.0001
        mean = normal[span].mean(axis=0)
        length = float(np.linalg.norm(mean))
        if length > 0.1 and not two_sided[span].any():
            axis[c] = mean / length
            spread[c] = np.arccos(np.clip((normal[span] @ axis[c]).min(), -1.0, 1.0)) + 1e-3
    return centre, radius, axis, spread
