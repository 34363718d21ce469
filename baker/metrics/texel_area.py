"""The object that each texel lies on, and random points on the surface inside texels.

This is independent of the rasteriser of the bake and uses the uv of `scene.glb` only, so that it does not
repeat errors of the rasteriser.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.kernels.clip import MAX_CORNERS
from baker.kernels.surface import ROUNDING
from baker.metrics.kernels.texel_pieces import spread_pieces, texel_owners, texel_pieces

# Smallest share of a texel's square that counts as surface.
_MIN_AREA = 1.0e-3
# Share of a texel's square from which it counts as covered as a whole.
_WHOLE = 0.98
# No lift from vertices whose normal deviates from the face normal by more than this (cosine): a hard edge,
# not a smooth surface.
_HARD_EDGE = 0.7


@dataclass(frozen=True)
class SurfacePoints:
    """k points on the surface inside each of n texels.

    Attributes
    ----------
    position : (n, k, 3) float64, metres, world, relative to the geometry's origin
        On the curved surface that the shading normals describe, like the points of the bake. Rays from points
        on the facet itself would be blocked by neighbouring facets.
    normal, face_normal : (n, k, 3) float64, unit, world
        Shading normal and normal of the triangle, both on its front.
    area : (n,) float64
        Share of the texel's square that surface covers.
    surface : (n,) float64, m2
        World area of that surface.
    offset : (n, 2) float64, texels
        Mean of the points relative to the texel's centre, (column, row); 0 for texels covered as a whole.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    face_normal: NDArray[np.float64]
    area: NDArray[np.float64]
    surface: NDArray[np.float64]
    offset: NDArray[np.float64]


def instance_map(geometry: Geometry, n_pages: int, resolution: int) -> NDArray[np.int32]:
    """Return the instance that covers most of each texel.

    Parameters
    ----------
    geometry : Geometry
        With the lightmap uv of the bake.
    n_pages : int
        Number of pages, P.
    resolution : int, texels
        Width and height of a page.

    Returns
    -------
    (P, H, W) int32
        Index of the instance, -1 for none.
    """
    owner = np.full(n_pages * resolution * resolution, -1, np.int32)
    most = np.full(len(owner), _MIN_AREA, np.float32)
    texel_owners(geometry.uv, geometry.triangle, geometry.page, geometry.instance, resolution, owner, most)
    return owner.reshape(n_pages, resolution, resolution)


def surface_points(
    geometry: Geometry, pixel: NDArray[np.int64], resolution: int, n_points: int, seed: int
) -> SurfacePoints:
    """Choose random points on the surface inside texels, uniformly in the area of the texels' squares.

    Parameters
    ----------
    geometry : Geometry
        With the lightmap uv of the bake.
    pixel : (n,) int64
        (page * resolution + row) * resolution + column, without duplicates.
    resolution : int, texels
        Width and height of a page.
    n_points : int
        Points in each texel.
    seed : int
        Seed of the random choice.

    Returns
    -------
    SurfacePoints
        n x `n_points` points.
    """
    found, weight, covered, middle = _spread(geometry, pixel, resolution, n_points, seed)
    # The points of a texel that is covered as a whole represent its centre.
    offset = np.where(covered[:, None] < _WHOLE, middle - 0.5, 0.0)
    corner = geometry.triangle[found]
    position = (geometry.position[corner].astype(np.float64) * weight[..., None]).sum(axis=2)
    normal = (geometry.normal[corner].astype(np.float64) * weight[..., None]).sum(axis=2)
    face = geometry.face_normal[found].astype(np.float64)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    away = (length < 1e-6) | ((normal * face).sum(axis=2, keepdims=True) <= 0)
    normal = np.where(away, face, normal / np.maximum(length, 1e-12))
    # Offset the points by some float32 spacings of their triangle's size, which callers do not have.
    edge = geometry.position[corner[..., 1:]].astype(np.float64) - geometry.position[corner[..., :1]]
    position += lift(geometry, corner, weight, position, face)
    position += ROUNDING * np.abs(edge).max(axis=(2, 3))[..., None] * face
    surface = covered * square_metres(geometry, found, resolution).mean(axis=1)
    return SurfacePoints(position, normal, face, covered, surface, offset)


def lift(
    geometry: Geometry,
    corner: NDArray[np.int32],
    weight: NDArray[np.float64],
    position: NDArray[np.float64],
    face: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the vectors (n, k, 3) from points to the curved surface that the shading normals describe.

    The vector is the sum, weighted by barycentric coordinates, of the vectors to the tangent planes of the
    three corners, without those planes that the point is above.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    corner : (n, k, 3) int32
        Vertices of each point's triangle.
    weight : (n, k, 3) float64
        Barycentric coordinates.
    position : (n, k, 3) float64, metres, world, relative to the geometry's origin
        The points on the facets.
    face : (n, k, 3) float64, unit
        Normals of the triangles.

    Returns
    -------
    (n, k, 3) float64, metres
        Vectors to add to the positions.
    """
    result = np.zeros_like(position)
    for i in range(3):
        normal = geometry.normal[corner[..., i]].astype(np.float64)
        below = ((position - geometry.position[corner[..., i]]) * normal).sum(axis=2)
        soft = (normal * face).sum(axis=2) > _HARD_EDGE
        result += (weight[..., i] * np.where(soft, np.maximum(-below, 0.0), 0.0))[..., None] * normal
    return result


def square_metres(geometry: Geometry, triangle: NDArray[np.int64], resolution: int) -> NDArray[np.float64]:
    """Return the world area of one texel's square on triangles.

    Parameters
    ----------
    geometry : Geometry
        With the lightmap uv of the bake.
    triangle : (n, k) int64
        Triangles that cover some of a page.
    resolution : int, texels
        Width and height of a page.

    Returns
    -------
    (n, k) float64, m2
        Areas.
    """
    corner = geometry.triangle[triangle]
    one, two = (
        geometry.position[corner[..., k]].astype(np.float64) - geometry.position[corner[..., 0]]
        for k in (1, 2)
    )
    u, v = ((geometry.uv[corner[..., k]].astype(np.float64) - geometry.uv[corner[..., 0]]) for k in (1, 2))
    texels = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]) * resolution**2
    world = np.linalg.norm(np.cross(one, two), axis=-1)
    # The uv area is above 0, since points are chosen in proportion to it.
    return np.asarray(world / np.maximum(texels, 1e-12), np.float64)


def one_surface_point(
    geometry: Geometry, pixel: NDArray[np.int64], resolution: int, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Choose one random point on the surface inside each texel.

    Parameters
    ----------
    geometry : Geometry
        With the lightmap uv of the bake.
    pixel : (n,) int64
        (page * resolution + row) * resolution + column; each must lie on some surface.
    resolution : int, texels
        Width and height of a page.
    seed : int
        Seed of the random choice.

    Returns
    -------
    triangle : (n,) int64
        Triangle of each point.
    weight : (n, 3) float64
        Barycentric coordinates.
    """
    found, weight, _, _ = _spread(geometry, pixel, resolution, 1, seed)
    return found[:, 0], weight[:, 0]


def _spread(
    geometry: Geometry, pixel: NDArray[np.int64], resolution: int, n_points: int, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return triangles (n, k), weights (n, k, 3), total area (n,) and mean point in the texel (n, 2)."""
    wanted = np.full((int(geometry.page.max(initial=0)) + 1) * resolution * resolution, -1, np.int32)
    wanted[pixel] = np.arange(len(pixel), dtype=np.int32)
    count = np.zeros(len(pixel), np.int64)
    nothing = np.zeros((0, MAX_CORNERS, 2))
    none = np.zeros(0, np.int64)
    arrays = (geometry.uv, geometry.triangle, geometry.page, resolution, wanted)
    texel_pieces(*arrays, count, none, none, nothing, none, np.zeros(0))
    start = np.concatenate([[0], np.cumsum(count)])
    total = int(start[-1])
    triangle, corners = np.zeros(total, np.int64), np.zeros(total, np.int64)
    polygon, area = np.zeros((total, MAX_CORNERS, 2)), np.zeros(total)
    texel_pieces(*arrays, start[:-1].copy(), triangle, corners, polygon, np.zeros(1, np.int64), area)
    random = np.random.Generator(np.random.PCG64([seed, 7])).random((len(pixel), n_points, 3))
    # Stratify by area, in random order, so that few passes already sample all parts of a texel.
    random[..., 0] = (np.arange(n_points) + random[..., 0]) / n_points
    random[..., 0] = np.random.Generator(np.random.PCG64([seed, 8])).permuted(random[..., 0], axis=1)
    found = np.zeros((len(pixel), n_points), np.int64)
    weight = np.zeros((len(pixel), n_points, 3))
    covered, middle = np.zeros(len(pixel)), np.zeros((len(pixel), 2))
    spread_pieces(
        geometry.uv, geometry.triangle, resolution, pixel, start, triangle, corners, polygon, area,
        random, found, weight, covered, middle,
    )  # fmt: skip
    return found, weight, covered, middle


def look_up(
    pages: NDArray[np.float32], pixel: NDArray[np.int64], offset: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Look maps up bilinearly, as engines do, at offsets from the centres of texels.

    Parameters
    ----------
    pages : (P, H, W, C) float32
        Pages of a channel.
    pixel : (n,) int64
        (page * H + row) * W + column.
    offset : (n, 2) float64, texels, -0.5 to 0.5
        (column, row), relative to the texel's centre.

    Returns
    -------
    value : (n, C) float64
        Interpolated values.
    """
    height, width = pages.shape[1:3]
    page, rest = np.divmod(pixel, height * width)
    row, column = np.divmod(rest, width)
    # Find the neighbours on the side of the offset, and their weights.
    down, right = np.where(offset[:, 1] < 0, -1, 1), np.where(offset[:, 0] < 0, -1, 1)
    lower, beside = np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1)
    y, x = np.abs(offset[:, 1])[:, None], np.abs(offset[:, 0])[:, None]
    above = (1 - x) * pages[page, row, column] + x * pages[page, row, beside]
    below = (1 - x) * pages[page, lower, column] + x * pages[page, lower, beside]
    return np.asarray((1 - y) * above + y * below, np.float64)


def look_up_uv(
    pages: NDArray[np.float32], page: NDArray[np.int32], uv: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Look maps up bilinearly at lightmap uv.

    Parameters
    ----------
    pages : (P, H, W, C) float32
        Pages of a channel.
    page : (n,) int32
        Page of each point.
    uv : (n, 2) float64, 0 to 1
        Lightmap uv of each point.

    Returns
    -------
    value : (n, C) float64
        Interpolated values.
    """
    height, width = pages.shape[1:3]
    at = uv * (width, height)
    texel = np.clip(np.floor(at), 0, (width - 1, height - 1))
    pixel = (page.astype(np.int64) * height + texel[:, 1].astype(np.int64)) * width + texel[:, 0].astype(
        np.int64
    )
    return look_up(pages, pixel, np.clip(at - texel, 0.0, 1.0) - 0.5)
