"""Finds the object on which each texel lies, and random surface points inside texels.

The functions use only the uv of `scene.glb` and not the rasteriser of the bake, so errors of that rasteriser
are not repeated.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.kernels.clip import MAX_CORNERS
from baker.kernels.surface import ROUNDING
from baker.metrics.kernels.texel_pieces import spread_pieces, texel_owners, texel_pieces

# Share of a texel's square that a triangle must cover for its instance to own the texel.
_MIN_AREA = 1.0e-3
# Share of a texel's square that surface covers. From this share on, the texel counts as completely covered.
_WHOLE = 0.98
# Limit of the cosine of the angle between a vertex normal and the face normal. Up to this limit, the vertex
# lies at a hard edge, and its tangent plane is not used in `lift`.
_HARD_EDGE = 0.7


@dataclass(frozen=True)
class SurfacePoints:
    """k points on the surface inside each of n texels.

    Attributes
    ----------
    position : (n, k, 3) float64, metres, world, relative to the geometry's origin
        Points on the curved surface that the shading normals describe, as in the bake. Rays from points on
        the flat triangle would be blocked by neighbouring triangles.
    normal, face_normal : (n, k, 3) float64, unit, world
        Shading normal, and normal of the triangle. Both point to its front.
    area : (n,) float64
        Share of each texel's square that surface covers.
    surface : (n,) float64, m2
        World area of the surface inside each texel.
    offset : (n, 2) float64, texels
        Mean of the points relative to the texel's centre, (column, row). 0 for completely covered texels.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    face_normal: NDArray[np.float64]
    area: NDArray[np.float64]
    surface: NDArray[np.float64]
    offset: NDArray[np.float64]


def instance_map(geometry: Geometry, n_pages: int, resolution: int) -> NDArray[np.int32]:
    """Return, for each texel, the instance of the triangle that covers the largest area of the texel.

    Parameters
    ----------
    geometry : Geometry
        The triangles of the scene, with the lightmap uv of the bake.
    n_pages : int
        Number of pages, P.
    resolution : int, texels
        Width and height of a page.

    Returns
    -------
    (P, H, W) int32
        Index of the instance; -1 for texels of which no triangle covers more than `_MIN_AREA`.
    """
    owner = np.full(n_pages * resolution * resolution, -1, np.int32)
    most = np.full(len(owner), _MIN_AREA, np.float32)
    texel_owners(geometry.uv, geometry.triangle, geometry.page, geometry.instance, resolution, owner, most)
    return owner.reshape(n_pages, resolution, resolution)


def surface_points(
    geometry: Geometry, pixel: NDArray[np.int64], resolution: int, n_points: int, seed: int
) -> SurfacePoints:
    """Choose random surface points inside texels, with uniform density in uv.

    Parameters
    ----------
    geometry : Geometry
        The triangles of the scene, with the lightmap uv of the bake.
    pixel : (n,) int64
        (page * resolution + row) * resolution + column, without duplicates. Each texel must contain surface.
    resolution : int, texels
        Width and height of a page.
    n_points : int
        Points in each texel.
    seed : int
        Seed of the random choice.

    Returns
    -------
    SurfacePoints
        `n_points` points in each of the n texels.
    """
    found, weight, covered, middle = _spread(geometry, pixel, resolution, n_points, seed)
    # The points of a completely covered texel represent its centre, so their offset is 0.
    offset = np.where(covered[:, None] < _WHOLE, middle - 0.5, 0.0)
    corner = geometry.triangle[found]
    position = (geometry.position[corner].astype(np.float64) * weight[..., None]).sum(axis=2)
    normal = (geometry.normal[corner].astype(np.float64) * weight[..., None]).sum(axis=2)
    face = geometry.face_normal[found].astype(np.float64)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    away = (length < 1e-6) | ((normal * face).sum(axis=2, keepdims=True) <= 0)
    normal = np.where(away, face, normal / np.maximum(length, 1e-12))
    # Move the points off their triangle by a few float32 spacings of its size, against rounding errors.
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

    A vector is the sum over the triangle's corners of the vector from the point to the corner's tangent
    plane, weighted by barycentric coordinates. A corner does not contribute if the point is above its tangent
    plane, or if the corner lies at a hard edge.

    Parameters
    ----------
    geometry : Geometry
        The triangles.
    corner : (n, k, 3) int32
        Vertices of each point's triangle.
    weight : (n, k, 3) float64
        Barycentric coordinates.
    position : (n, k, 3) float64, metres, world, relative to the geometry's origin
        The points on the flat triangles.
    face : (n, k, 3) float64, unit
        Normals of the triangles.

    Returns
    -------
    (n, k, 3) float64, metres
        The vectors to add to the positions.
    """
    result = np.zeros_like(position)
    for i in range(3):
        normal = geometry.normal[corner[..., i]].astype(np.float64)
        below = ((position - geometry.position[corner[..., i]]) * normal).sum(axis=2)
        soft = (normal * face).sum(axis=2) > _HARD_EDGE
        result += (weight[..., i] * np.where(soft, np.maximum(-below, 0.0), 0.0))[..., None] * normal
    return result


def square_metres(geometry: Geometry, triangle: NDArray[np.int64], resolution: int) -> NDArray[np.float64]:
    """Return the world area that one texel's square has on each triangle.

    Parameters
    ----------
    geometry : Geometry
        The triangles of the scene, with the lightmap uv of the bake.
    triangle : (n, k) int64
        Triangles with uv area.
    resolution : int, texels
        Width and height of a page.

    Returns
    -------
    (n, k) float64, m2
        World area of each triangle / its uv area in texels.
    """
    corner = geometry.triangle[triangle]
    one, two = (
        geometry.position[corner[..., k]].astype(np.float64) - geometry.position[corner[..., 0]]
        for k in (1, 2)
    )
    u, v = ((geometry.uv[corner[..., k]].astype(np.float64) - geometry.uv[corner[..., 0]]) for k in (1, 2))
    texels = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]) * resolution**2
    world = np.linalg.norm(np.cross(one, two), axis=-1)
    # The uv area is above 0, because triangles are chosen in proportion to it.
    return np.asarray(world / np.maximum(texels, 1e-12), np.float64)


def one_surface_point(
    geometry: Geometry, pixel: NDArray[np.int64], resolution: int, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Choose one random surface point inside each texel.

    Parameters
    ----------
    geometry : Geometry
        The triangles of the scene, with the lightmap uv of the bake.
    pixel : (n,) int64
        (page * resolution + row) * resolution + column. Each texel must contain surface.
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
    """Choose k = `n_points` random surface points inside each of the n texels `pixel`.

    The results are:

    - the triangle of each point (n, k);
    - the barycentric weights of each point (n, k, 3);
    - the area of each texel that surface covers (n,), in texels;
    - the mean position of each texel's points in its square (n, 2), (column, row), 0 to 1.
    """
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
    # Stratify the first number, which selects the piece of surface by area. Permute the strata, so that the
    # first few points already sample all pieces of a texel.
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
        Position of the lookup relative to the texel's centre, (column, row).

    Returns
    -------
    value : (n, C) float64
        Interpolated values.
    """
    height, width = pages.shape[1:3]
    page, rest = np.divmod(pixel, height * width)
    row, column = np.divmod(rest, width)
    # Find the neighbouring texels on the side of the offset, and the weights of the four texels.
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
