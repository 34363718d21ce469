"""Which object lies under each texel, and places spread over a texel's own area.

The bake finds the same things on its way; this is written apart from it, from `scene.glb`'s uv alone, so
that a mistake there is not made twice.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.kernels.clip import MAX_CORNERS
from baker.kernels.surface import ROUNDING
from baker.metrics.kernels.texel_pieces import spread_pieces, texel_owners, texel_pieces

# Less of a texel's square than this is no surface to be judged.
_LEAST = 1.0e-3
_WHOLE = 0.98
# A vertex whose normal leans further from the face than this (cosine) belongs to a hard edge: no lift.
_HARD = 0.7


@dataclass(frozen=True)
class TexelPlaces:
    """Points on the surface inside texels.

    Attributes
    ----------
    position, normal, face_normal : (n, k, 3) float64
        World; `normal` is the shading normal, both on the triangle's front. Places lie on the curved surface
        that the shading normals suggest, as those of the bake do: on a facet itself, half of what a curved
        surface sees would be behind the next facet.
    area : (n,) float64
        Share of the texel's square that surface covers.
    surface : (n,) float64
        That surface's size in the world, m2.
    middle : (n, 2) float64
        Mean of the places from the texel's centre, (column, row), texels; 0 where all of it is covered.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    face_normal: NDArray[np.float64]
    area: NDArray[np.float64]
    surface: NDArray[np.float64]
    middle: NDArray[np.float64]


def instance_map(geometry: Geometry, n_pages: int, resolution: int) -> NDArray[np.int32]:
    """Return (P, H, W) int32: the instance that covers most of each texel, -1 where none lies."""
    owner = np.full(n_pages * resolution * resolution, -1, np.int32)
    most = np.full(len(owner), _LEAST, np.float32)
    texel_owners(geometry.uv, geometry.triangle, geometry.page, geometry.instance, resolution, owner, most)
    return owner.reshape(n_pages, resolution, resolution)


def texel_places(
    geometry: Geometry, pixel: NDArray[np.int64], resolution: int, n_places: int, seed: int
) -> TexelPlaces:
    """Spread places over the surface inside texels, uniform in the area it takes of their squares.

    Parameters
    ----------
    geometry : Geometry
        With the lightmap uv of the bake.
    pixel : (n,) int64
        (page * resolution + row) * resolution + column; each once.
    n_places : int
        Places of each texel.
    """
    found, weight, covered, middle = _spread(geometry, pixel, resolution, n_places, seed)
    # A whole texel's places lie around its centre but for their own scatter.
    middle = np.where(covered[:, None] < _WHOLE, middle - 0.5, 0.0)
    corner = geometry.triangle[found]
    position = (geometry.position[corner].astype(np.float64) * weight[..., None]).sum(axis=2)
    normal = (geometry.normal[corner].astype(np.float64) * weight[..., None]).sum(axis=2)
    face = geometry.face_normal[found].astype(np.float64)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    away = (length < 1e-6) | ((normal * face).sum(axis=2, keepdims=True) <= 0)
    normal = np.where(away, face, normal / np.maximum(length, 1e-12))
    # Off large triangles by some of their float32 steps: whoever starts rays here does not know their size.
    edge = geometry.position[corner[..., 1:]].astype(np.float64) - geometry.position[corner[..., :1]]
    position += lift(geometry, corner, weight, position, face)
    position += ROUNDING * np.abs(edge).max(axis=(2, 3))[..., None] * face
    surface = covered * square_metres(geometry, found, resolution).mean(axis=1)
    return TexelPlaces(position, normal, face, covered, surface, middle)


def lift(
    geometry: Geometry,
    corner: NDArray[np.int32],
    weight: NDArray[np.float64],
    position: NDArray[np.float64],
    face: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return by what vectors (n, k, 3) places lie below the curved surface that the shading normals suggest.

    That surface is the weighted mean of a place's projections onto the tangent planes of the three corners,
    of those planes that it lies below.

    Parameters
    ----------
    corner : (n, k, 3), vertices; weight : (n, k, 3), of these; position, face : (n, k, 3)
    """
    result = np.zeros_like(position)
    for i in range(3):
        normal = geometry.normal[corner[..., i]].astype(np.float64)
        below = ((position - geometry.position[corner[..., i]]) * normal).sum(axis=2)
        soft = (normal * face).sum(axis=2) > _HARD
        result += (weight[..., i] * np.where(soft, np.maximum(-below, 0.0), 0.0))[..., None] * normal
    return result


def square_metres(geometry: Geometry, triangle: NDArray[np.int64], resolution: int) -> NDArray[np.float64]:
    """Return how many m2 of the world one texel's square is on triangles (n, k)."""
    corner = geometry.triangle[triangle]
    one, two = (
        geometry.position[corner[..., k]].astype(np.float64) - geometry.position[corner[..., 0]]
        for k in (1, 2)
    )
    u, v = ((geometry.uv[corner[..., k]].astype(np.float64) - geometry.uv[corner[..., 0]]) for k in (1, 2))
    texels = np.abs(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]) * resolution**2
    world = np.linalg.norm(np.cross(one, two), axis=-1)
    # Places lie where a triangle takes some of the page, so its uv area is not zero.
    return np.asarray(world / np.maximum(texels, 1e-12), np.float64)


def texel_points(
    geometry: Geometry, pixel: NDArray[np.int64], resolution: int, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return one point on the surface inside each texel: its triangle (n,) and the corners' weights (n, 3).

    Parameters
    ----------
    geometry, pixel, resolution, seed
        As of `texel_places`; each texel must hold some surface.
    """
    found, weight, _, _ = _spread(geometry, pixel, resolution, 1, seed)
    return found[:, 0], weight[:, 0]


def _spread(
    geometry: Geometry, pixel: NDArray[np.int64], resolution: int, n_places: int, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return triangles (n, k), weights (n, k, 3), area in all (n,), mean place in the texel (n, 2)."""
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
    random = np.random.Generator(np.random.PCG64([seed, 7])).random((len(pixel), n_places, 3))
    # Even shares of the area, in random order, so that few passes already see all of a texel.
    random[..., 0] = (np.arange(n_places) + random[..., 0]) / n_places
    random[..., 0] = np.random.Generator(np.random.PCG64([seed, 8])).permuted(random[..., 0], axis=1)
    found = np.zeros((len(pixel), n_places), np.int64)
    weight = np.zeros((len(pixel), n_places, 3))
    covered, middle = np.zeros(len(pixel)), np.zeros((len(pixel), 2))
    spread_pieces(
        geometry.uv, geometry.triangle, resolution, pixel, start, triangle, corners, polygon, area,
        random, found, weight, covered, middle,
    )  # fmt: skip
    return found, weight, covered, middle


def look_up(
    pages: NDArray[np.float32], pixel: NDArray[np.int64], middle: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Read maps bilinearly, as engines do, beside the centres of texels.

    Parameters
    ----------
    pages : (P, H, W, C) float32
    pixel : (n,) int64
    middle : (n, 2) float64
        Where in relation to the texel's centre, (column, row), texels, -0.5 to 0.5.

    Returns
    -------
    value : (n, C) float64
    """
    height, width = pages.shape[1:3]
    page, rest = np.divmod(pixel, height * width)
    row, column = np.divmod(rest, width)
    # The neighbours that the place leans towards, and how far.
    down, right = np.where(middle[:, 1] < 0, -1, 1), np.where(middle[:, 0] < 0, -1, 1)
    lower, beside = np.clip(row + down, 0, height - 1), np.clip(column + right, 0, width - 1)
    y, x = np.abs(middle[:, 1])[:, None], np.abs(middle[:, 0])[:, None]
    above = (1 - x) * pages[page, row, column] + x * pages[page, row, beside]
    below = (1 - x) * pages[page, lower, column] + x * pages[page, lower, beside]
    return np.asarray((1 - y) * above + y * below, np.float64)


def look_up_uv(
    pages: NDArray[np.float32], page: NDArray[np.int32], uv: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Read maps (P, H, W, C) bilinearly at lightmap uv (n, 2) of pages (n,); return (n, C)."""
    height, width = pages.shape[1:3]
    at = uv * (width, height)
    texel = np.clip(np.floor(at), 0, (width - 1, height - 1))
    pixel = (page.astype(np.int64) * height + texel[:, 1].astype(np.int64)) * width + texel[:, 0].astype(
        np.int64
    )
    return look_up(pages, pixel, np.clip(at - texel, 0.0, 1.0) - 0.5)
