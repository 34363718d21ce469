"""Chooses points at chart borders, next to walls and between texels, where bilinear lookups are compared.

An engine looks up the map bilinearly at arbitrary points of the surface. The lookup reads four texels, which
are called the footprint. Each of the four may be covered, filled or dilated. The reference of a lookup is the
mean light at points inside these four texels. The points in a texel together have the weight of the texel in
the lookup. Only points of the same surface that are visible from the looked-up point are used. Otherwise, a
lookup next to a wall would be compared with light on the other side of the wall.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from baker.core.geometry import Geometry
from baker.metrics.sample_texels import choose_texels
from baker.metrics.texel_area import SurfacePoints, one_surface_point, square_metres, surface_points
from baker.pathtracer.scene import Reference
from baker.verification.surroundings import in_contact, inside_points, lifted, seen_along

# Share of points at the borders of charts, and share of points near other surfaces. The remaining points are
# random.
_BORDER, _CONTACT = 0.4, 0.5
# Number of random texels that are tested to find one point near another surface.
_POOL = 16
# Number of points in each texel of a footprint, and in each tested texel.
_POINTS_PER_TEXEL, _POOL_POINTS = 16, 8
# Two points count as points of the same surface if their distance is below _MAX_TEXELS texels, and the cosine
# of the angle between their face normals is above _MIN_COSINE.
_MAX_TEXELS, _MIN_COSINE = 4.0, 0.5


@dataclass(frozen=True)
class EdgePoints:
    """n looked-up points. The mean light at k points around a looked-up point is the reference of the lookup.

    Attributes
    ----------
    pixel : (n,) int64
        Texel that contains each looked-up point, (page * H + row) * W + column.
    owner : (n,) int32
        Object of each looked-up point.
    surface : SurfacePoints
        The k points; `offset` is the position of the looked-up point relative to the texel's centre.
    """

    pixel: NDArray[np.int64]
    owner: NDArray[np.int32]
    surface: SurfacePoints


def border_texels(owner: NDArray[np.int32], covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (P, H, W) bool: the border texels of charts.

    These are covered texels with a neighbour that is not covered or lies on another object. An uncovered
    texel with surface is a border texel if a covered neighbour lies on its own object.

    Parameters
    ----------
    owner : (P, H, W) int32
        Object of each texel, -1 for none.
    covered : (P, H, W) bool
        Texels with a measured value.
    """
    own = np.where(covered, owner, -1)
    result = np.zeros(owner.shape, bool)
    for page in range(len(owner)):
        high = maximum_filter(own[page], 3, mode="nearest")
        low = minimum_filter(own[page], 3, mode="nearest")
        outermost = covered[page] & (low != high)
        result[page] = outermost | (~covered[page] & _beside_own(owner[page], own[page]))
    return result


def _beside_own(owner: NDArray[np.int32], own: NDArray[np.int32]) -> NDArray[np.bool_]:
    """Return (H, W) bool: texels on an object with a neighbour in `own` (-1: none) on the same object."""
    height, width = owner.shape
    padded = np.pad(own, 1, constant_values=-1)
    near = np.zeros(owner.shape, bool)
    for y, x in np.ndindex(3, 3):
        near |= padded[y : y + height, x : x + width] == owner
    return near & (owner >= 0)


def edge_points(
    reference: Reference,
    geometry: Geometry,
    owner: NDArray[np.int32],
    covered: NDArray[np.bool_],
    n: int,
    n_points: int,
    seed: int,
) -> EdgePoints:
    """Choose about n looked-up points, and the points whose mean light is the reference of each lookup.

    Parameters
    ----------
    reference : Reference
        The scene of the path tracer.
    geometry : Geometry
        The triangles of the bake.
    owner : (P, H, W) int32
        Object of each texel, -1 for none.
    covered : (P, H, W) bool
        Texels with a measured value.
    n : int
        Approximate number of looked-up points.
    n_points : int
        Number k of points of each footprint.
    seed : int
        Seed of the random choice.

    Returns
    -------
    EdgePoints
        The looked-up points that are not inside geometry.
    """
    size = owner.shape[1]
    flat, usable = owner.reshape(-1), covered.reshape(-1)
    even = np.zeros(len(flat))
    border = choose_texels(flat, border_texels(owner, covered).reshape(-1), even, int(n * _BORDER), seed + 1)
    pool = choose_texels(flat, usable, even, int(n * _CONTACT * _POOL), seed + 2)
    contact = np.zeros(0, np.int64)
    if len(pool):
        pool = pool[in_contact(reference, surface_points(geometry, pool, size, _POOL_POINTS, seed), seed)]
        contact = choose_texels(flat, np.isin(np.arange(len(flat)), pool), even, int(n * _CONTACT), seed)
    rest = choose_texels(flat, usable, even, int(n * (1 - _BORDER - _CONTACT)), seed + 3)
    pixel = np.unique(np.concatenate([border, contact, rest]))
    if not len(pixel):
        return EdgePoints(pixel, flat[pixel], surface_points(geometry, pixel, size, n_points, seed))
    point = _points(geometry, pixel, size, seed)
    random = np.random.Generator(np.random.PCG64([seed, 11]))
    where = point.position[:, None], point.normal[:, None], point.face_normal[:, None]
    seen = ~inside_points(reference, *where, random)[:, 0]
    point, pixel = point.of(seen), pixel[seen]
    surface = _footprints(reference, geometry, point, owner, n_points, seed)
    return EdgePoints(pixel, flat[pixel], surface)


@dataclass(frozen=True)
class _Points:
    """n points of the surface.

    Attributes
    ----------
    position : (n, 3) float64, metres, relative to the geometry's origin
    normal, face_normal : (n, 3) float64, unit shading and face normals
    at : (n, 2) float64, column and row in the page, texels, not rounded
    page : (n,) int64
    square : (n,) float64, m2, world area of a texel's square
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    face_normal: NDArray[np.float64]
    at: NDArray[np.float64]
    page: NDArray[np.int64]
    square: NDArray[np.float64]

    def of(self, which: NDArray[np.bool_]) -> _Points:
        return _Points(*(getattr(self, f.name)[which] for f in fields(self)))


def _points(geometry: Geometry, pixel: NDArray[np.int64], size: int, seed: int) -> _Points:
    """Return one random point of the surface inside each texel `pixel` (n,)."""
    triangle, weight = one_surface_point(geometry, pixel, size, seed)
    corner = geometry.triangle[triangle]
    position, normal, uv = (
        (array[corner].astype(np.float64) * weight[..., None]).sum(axis=1)
        for array in (geometry.position, geometry.normal, geometry.uv)
    )
    face = geometry.face_normal[triangle].astype(np.float64)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    away = (length < 1e-6) | ((normal * face).sum(axis=1, keepdims=True) <= 0)
    normal = np.where(away, face, normal / np.maximum(length, 1e-12))
    square = square_metres(geometry, triangle[:, None], size)[:, 0]
    return _Points(position, normal, face, uv * size, pixel // size**2, square)


def _footprints(
    reference: Reference,
    geometry: Geometry,
    point: _Points,
    owner: NDArray[np.int32],
    n_points: int,
    seed: int,
) -> SurfacePoints:
    """Return `n_points` points in the footprint of each point.

    The points are drawn from candidates in the four texels, with the weights of the lookup. If no candidate
    is visible from the looked-up point, that point itself is used.
    """
    size, n = owner.shape[1], len(point.at)
    tap, share = _taps(point, size)
    mine = owner[point.page, np.floor(point.at[:, 1]).astype(int), np.floor(point.at[:, 0]).astype(int)]
    usable = owner.reshape(-1)[tap] == mine[:, None]
    pixel, number = np.unique(tap[usable], return_inverse=True)
    spread = surface_points(geometry, pixel, size, _POINTS_PER_TEXEL, seed)
    row, column = np.nonzero(usable)
    # Make _POINTS_PER_TEXEL candidates for each of m pairs. A pair consists of a point, with the index `row`,
    # and one of the four texels of its footprint, with the index `column`.
    position, normal, face = (array[number] for array in (spread.position, spread.normal, spread.face_normal))
    # Keep candidates on the same surface that are visible from the point.
    off = position - point.position[row][:, None]
    near = np.linalg.norm(off, axis=2) < _MAX_TEXELS * np.sqrt(point.square[row])[:, None]
    good = near & ((face * point.face_normal[row][:, None]).sum(axis=2) > _MIN_COSINE)
    i, j = np.nonzero(good)
    ends = lifted(reference, position[i, j], face[i, j])
    origin = lifted(reference, point.position[row[i]], point.face_normal[row[i]])
    good[i, j] = seen_along(reference, origin, ends - origin)
    # Distribute the weight of each texel evenly over its remaining candidates, and draw from all candidates.
    weight = np.zeros((n, 4, _POINTS_PER_TEXEL))
    weight[row, column] = good * (share[row, column] / np.maximum(good.sum(axis=1), 1))[:, None]
    candidate = np.zeros((n, 4, _POINTS_PER_TEXEL), np.int64)
    candidate[row, column] = np.arange(len(row))[:, None] * _POINTS_PER_TEXEL + np.arange(_POINTS_PER_TEXEL)
    drawn, none = _draw(weight.reshape(n, -1), n_points, seed)
    chosen = np.take_along_axis(candidate.reshape(n, -1), drawn, axis=1)
    own = (point.position, point.normal, point.face_normal)
    where = [
        np.where(none[:, None, None], alone[:, None], array.reshape(-1, 3)[chosen] if len(row) else 0.0)
        for alone, array in zip(own, (position, normal, face), strict=True)
    ]
    positions, normals, faces = where
    return SurfacePoints(positions, normals, faces, np.ones(n), point.square, np.mod(point.at, 1.0) - 0.5)


def _taps(point: _Points, size: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return (n, 4) int64, the four texels of each point's lookup, and (n, 4) float64, their weights."""
    first = np.floor(point.at - 0.5)
    part = point.at - 0.5 - first
    corner = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    at = np.clip(first[:, None] + corner, 0, size - 1).astype(np.int64)
    share = np.where(corner == 1, part[:, None], 1 - part[:, None]).prod(axis=2)
    return (point.page[:, None] * size + at[..., 1]) * size + at[..., 0], share


def _draw(weight: NDArray[np.float64], n: int, seed: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Draw n columns of each row of `weight` with probabilities proportional to the weights in the row.

    weight : (m, k) float64

    Returns (m, n) int64, the columns, and (m,) bool, the rows whose weights are all 0.
    """
    total = weight.sum(axis=1)
    random = np.random.Generator(np.random.PCG64([seed, 12]))
    # Use stratified samples in random order, so that the first few passes cover the whole footprint.
    at = random.permuted((np.arange(n) + random.random((len(weight), 1))) / n, axis=1)
    edge = np.cumsum(weight, axis=1) / np.maximum(total, 1e-30)[:, None]
    drawn = (at[:, :, None] > edge[:, None, :]).sum(axis=2)
    return np.minimum(drawn, weight.shape[1] - 1), total <= 0
