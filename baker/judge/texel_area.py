"""Which object lies under each texel, and places spread over a texel's own area.

The bake finds the same things on its way; this is written apart from it, from `scene.glb`'s uv alone, so
that a mistake there is not made twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from baker.core.geometry import Geometry
from baker.kernels.clip import MAX_CORNERS, clip_to_square, polygon_area, polygon_point

# Less of a texel's square than this is no surface to be judged.
_LEAST = 1.0e-3


@dataclass(frozen=True)
class TexelPlaces:
    """Points on the surface inside texels.

    Attributes
    ----------
    position, normal, face_normal : (n, k, 3) float64
        World; `normal` is the shading normal, both on the triangle's front.
    area : (n,) float64
        Share of the texel's square that surface covers.
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    face_normal: NDArray[np.float64]
    area: NDArray[np.float64]


def instance_map(geometry: Geometry, n_pages: int, resolution: int) -> NDArray[np.int32]:
    """Return (P, H, W) int32: the instance that covers most of each texel, -1 where none lies."""
    owner = np.full(n_pages * resolution * resolution, -1, np.int32)
    most = np.full(len(owner), _LEAST, np.float32)
    _own(geometry.uv, geometry.triangle, geometry.page, geometry.instance, resolution, owner, most)
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
    wanted = np.full((int(geometry.page.max(initial=0)) + 1) * resolution * resolution, -1, np.int32)
    wanted[pixel] = np.arange(len(pixel), dtype=np.int32)
    count = np.zeros(len(pixel), np.int64)
    nothing = np.zeros((0, MAX_CORNERS, 2))
    none = np.zeros(0, np.int64)
    arrays = (geometry.uv, geometry.triangle, geometry.page, resolution, wanted)
    _pieces(*arrays, count, none, none, nothing, none, np.zeros(0))
    start = np.concatenate([[0], np.cumsum(count)])
    total = int(start[-1])
    triangle, corners = np.zeros(total, np.int64), np.zeros(total, np.int64)
    polygon, area = np.zeros((total, MAX_CORNERS, 2)), np.zeros(total)
    _pieces(*arrays, start[:-1].copy(), triangle, corners, polygon, np.zeros(1, np.int64), area)
    random = np.random.Generator(np.random.PCG64([seed, 7])).random((len(pixel), n_places, 3))
    # Even shares of the area, in random order, so that few passes already see all of a texel.
    random[..., 0] = (np.arange(n_places) + random[..., 0]) / n_places
    random[..., 0] = np.random.Generator(np.random.PCG64([seed, 8])).permuted(random[..., 0], axis=1)
    found = np.zeros((len(pixel), n_places), np.int64)
    weight = np.zeros((len(pixel), n_places, 3))
    covered = np.zeros(len(pixel))
    _spread(
        geometry.uv, geometry.triangle, resolution, pixel, start, triangle, corners, polygon, area,
        random, found, weight, covered,
    )  # fmt: skip
    corner = geometry.triangle[found]
    position = (geometry.position[corner].astype(np.float64) * weight[..., None]).sum(axis=2)
    normal = (geometry.normal[corner].astype(np.float64) * weight[..., None]).sum(axis=2)
    face = geometry.face_normal[found].astype(np.float64)
    length = np.linalg.norm(normal, axis=2, keepdims=True)
    away = (length < 1e-6) | ((normal * face).sum(axis=2, keepdims=True) <= 0)
    normal = np.where(away, face, normal / np.maximum(length, 1e-12))
    return TexelPlaces(position, normal, face, covered)


@njit(cache=True, error_model="numpy")
def _box(corner, size):  # type: ignore[no-untyped-def]
    """Return first column, last column, first row, last row of texels that a triangle (3, 2) may touch."""
    low_x, high_x = min(corner[:, 0]), max(corner[:, 0])
    low_y, high_y = min(corner[:, 1]), max(corner[:, 1])
    return (
        max(math.floor(low_x), 0), min(math.floor(high_x), size - 1),
        max(math.floor(low_y), 0), min(math.floor(high_y), size - 1),
    )  # fmt: skip


@njit(cache=True, error_model="numpy")
def _own(uv, triangle, page, instance, size, owner, most):  # type: ignore[no-untyped-def]
    corner = np.zeros((3, 2))
    cut, spare = np.zeros((MAX_CORNERS, 2)), np.zeros((MAX_CORNERS, 2))
    for t in range(len(triangle)):
        for j in range(3):
            corner[j, 0] = uv[triangle[t, j], 0] * size
            corner[j, 1] = uv[triangle[t, j], 1] * size
        left, right, top, bottom = _box(corner, size)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                pixel = (np.int64(page[t]) * size + y) * size + x
                inside = polygon_area(cut, clip_to_square(corner, x, y, cut, spare))
                if inside > most[pixel]:
                    most[pixel] = inside
                    owner[pixel] = instance[t]


@njit(cache=True, error_model="numpy")
def _pieces(uv, triangle, page, size, wanted, at, piece, corners, polygon, write, area):  # type: ignore[no-untyped-def]
    """Count the pieces of triangles inside wanted texels (no `write`), or store them from `at` on."""
    corner = np.zeros((3, 2))
    cut, spare = np.zeros((MAX_CORNERS, 2)), np.zeros((MAX_CORNERS, 2))
    for t in range(len(triangle)):
        for j in range(3):
            corner[j, 0] = uv[triangle[t, j], 0] * size
            corner[j, 1] = uv[triangle[t, j], 1] * size
        left, right, top, bottom = _box(corner, size)
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                i = wanted[(np.int64(page[t]) * size + y) * size + x]
                if i < 0:
                    continue
                n = clip_to_square(corner, x, y, cut, spare)
                inside = polygon_area(cut, n)
                if inside <= 0.0:
                    continue
                if len(write):
                    k = at[i]
                    piece[k], corners[k], area[k] = t, n, inside
                    polygon[k] = cut
                at[i] += 1


@njit(cache=True, error_model="numpy")
def _spread(  # type: ignore[no-untyped-def]
    uv, triangle, size, pixel, start, piece, corners, polygon, area, random, found, weight, covered
):
    for i in range(len(pixel)):
        first, last = start[i], start[i + 1]
        total = 0.0
        for e in range(first, last):
            total += area[e]
        covered[i] = total
        rest = pixel[i] % (size * size)
        for k in range(random.shape[1]):
            left = random[i, k, 0] * total
            e = first
            while e < last - 1 and left >= area[e]:
                left -= area[e]
                e += 1
            if e >= last:
                continue
            x, y = polygon_point(polygon[e], corners[e], random[i, k, 1], random[i, k, 2])
            x += rest % size
            y += rest // size
            t = piece[e]
            a, b, c = triangle[t, 0], triangle[t, 1], triangle[t, 2]
            ax, ay = float(uv[a, 0]) * size, float(uv[a, 1]) * size
            bx, by = uv[b, 0] * size - ax, uv[b, 1] * size - ay
            cx, cy = uv[c, 0] * size - ax, uv[c, 1] * size - ay
            det = bx * cy - by * cx
            w1 = w2 = 1.0 / 3.0
            if det != 0.0:
                w1 = min(max(((x - ax) * cy - (y - ay) * cx) / det, 0.0), 1.0)
                w2 = min(max((bx * (y - ay) - by * (x - ax)) / det, 0.0), 1.0 - w1)
            found[i, k] = t
            weight[i, k, 0], weight[i, k, 1], weight[i, k, 2] = 1.0 - w1 - w2, w1, w2
