"""Points of the surface at chart borders, near walls and between texels, as an engine looks them up.

An engine looks the map up bilinearly at any point of the surface. There the four texels around it take part:
covered, filled or dilated, whatever they are. What such a lookup should find is the mean light of the places
that these four stand for, weighed as the lookup weighs them: only places of the same surface that the point
sees, or a lookup at the foot of a wall would be held against the light behind the wall.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from baker.core.geometry import Geometry
from baker.metrics.sample_texels import choose_texels
from baker.metrics.texel_area import TexelPlaces, square_metres, texel_places, texel_points
from baker.pathtracer.scene import Reference
from baker.verification.surroundings import buried_places, in_contact, lifted, seen_along

# Shares of the points: at the borders of charts, near other surfaces, anywhere.
_BORDER, _CONTACT = 0.4, 0.5
# How many texels are looked at for one that lies near another surface.
_POOL = 16
_PLACES, _POOL_PLACES = 16, 8
# A place belongs to a point's surface if it is this near, in texels, and faces the same way (cosine).
_REACH, _SAME = 4.0, 0.5


@dataclass(frozen=True)
class EdgePoints:
    """Points of the surface, and the places that their lookups should be the mean of.

    Attributes
    ----------
    pixel : (n,) int64
    owner : (n,) int32
    places : TexelPlaces
        `middle` is the point in relation to the texel's centre.
    """

    pixel: NDArray[np.int64]
    owner: NDArray[np.int32]
    places: TexelPlaces


def border_texels(owner: NDArray[np.int32], covered: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return (P, H, W): the last covered texels of charts, and those beyond them that hold some surface.

    A texel is the last if a neighbour is not covered, or belongs to another object.
    """
    own = np.where(covered, owner, -1)
    result = np.zeros(owner.shape, bool)
    for page in range(len(owner)):
        high = maximum_filter(own[page], 3, mode="nearest")
        low = minimum_filter(own[page], 3, mode="nearest")
        last = covered[page] & (low != high)
        beyond = ~covered[page] & (high == owner[page])
        result[page] = (owner[page] >= 0) & (last | beyond)
    return result


def edge_points(
    reference: Reference,
    geometry: Geometry,
    owner: NDArray[np.int32],
    covered: NDArray[np.bool_],
    n: int,
    n_places: int,
    seed: int,
) -> EdgePoints:
    """Choose about n points and find what their lookups should find.

    Parameters
    ----------
    owner, covered : (P, H, W)
        Object of each texel, -1 for none; texels that hold a measured value.
    """
    size = owner.shape[1]
    flat, usable = owner.reshape(-1), covered.reshape(-1)
    even = np.zeros(len(flat))
    border = choose_texels(flat, border_texels(owner, covered).reshape(-1), even, int(n * _BORDER), seed + 1)
    pool = choose_texels(flat, usable, even, int(n * _CONTACT * _POOL), seed + 2)
    contact = np.zeros(0, np.int64)
    if len(pool):
        pool = pool[in_contact(reference, texel_places(geometry, pool, size, _POOL_PLACES, seed), seed)]
        contact = choose_texels(flat, np.isin(np.arange(len(flat)), pool), even, int(n * _CONTACT), seed)
    rest = choose_texels(flat, usable, even, int(n * (1 - _BORDER - _CONTACT)), seed + 3)
    pixel = np.unique(np.concatenate([border, contact, rest]))
    if not len(pixel):
        return EdgePoints(pixel, flat[pixel], texel_places(geometry, pixel, size, n_places, seed))
    point = _points(geometry, pixel, size, seed)
    random = np.random.Generator(np.random.PCG64([seed, 11]))
    where = point.position[:, None], point.normal[:, None], point.face_normal[:, None]
    seen = ~buried_places(reference, *where, random)[:, 0]
    point, pixel = point.of(seen), pixel[seen]
    places = _footprints(reference, geometry, point, owner, n_places, seed)
    return EdgePoints(pixel, flat[pixel], places)


@dataclass(frozen=True)
class _Points:
    """Points (n, 3) of the surface; `at` (n, 2): column and row in the page, in texels, not rounded."""

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    face_normal: NDArray[np.float64]
    at: NDArray[np.float64]
    page: NDArray[np.int64]
    square: NDArray[np.float64]

    def of(self, which: NDArray[np.bool_]) -> _Points:
        return _Points(*(getattr(self, f.name)[which] for f in fields(self)))


def _points(geometry: Geometry, pixel: NDArray[np.int64], size: int, seed: int) -> _Points:
    """Return one point inside each texel."""
    triangle, weight = texel_points(geometry, pixel, size, seed)
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
    n_places: int,
    seed: int,
) -> TexelPlaces:
    """Return for each point places of the four texels of its lookup, as often as these weigh.

    Where it sees no place of them the point itself stands for them.
    """
    size, n = owner.shape[1], len(point.at)
    tap, share = _taps(point, size)
    mine = owner[point.page, np.floor(point.at[:, 1]).astype(int), np.floor(point.at[:, 0]).astype(int)]
    usable = owner.reshape(-1)[tap] == mine[:, None]
    pixel, place_of = np.unique(tap[usable], return_inverse=True)
    spread = texel_places(geometry, pixel, size, _PLACES, seed)
    row, column = np.nonzero(usable)
    # Candidates (m, _PLACES) of point `row`.
    position, normal, face = (
        array[place_of] for array in (spread.position, spread.normal, spread.face_normal)
    )
    off = position - point.position[row][:, None]
    near = np.linalg.norm(off, axis=2) < _REACH * np.sqrt(point.square[row])[:, None]
    good = near & ((face * point.face_normal[row][:, None]).sum(axis=2) > _SAME)
    i, j = np.nonzero(good)
    ends = lifted(reference, position[i, j], face[i, j])
    origin = lifted(reference, point.position[row[i]], point.face_normal[row[i]])
    good[i, j] = seen_along(reference, origin, ends - origin)
    weight = np.zeros((n, 4, _PLACES))
    weight[row, column] = good * (share[row, column] / np.maximum(good.sum(axis=1), 1))[:, None]
    candidate = np.zeros((n, 4, _PLACES), np.int64)
    candidate[row, column] = np.arange(len(row))[:, None] * _PLACES + np.arange(_PLACES)
    drawn, none = _draw(weight.reshape(n, -1), n_places, seed)
    chosen = np.take_along_axis(candidate.reshape(n, -1), drawn, axis=1)
    own = (point.position, point.normal, point.face_normal)
    where = [
        np.where(none[:, None, None], alone[:, None], array.reshape(-1, 3)[chosen] if len(row) else 0.0)
        for alone, array in zip(own, (position, normal, face), strict=True)
    ]
    places, normals, faces = where
    return TexelPlaces(places, normals, faces, np.ones(n), point.square, np.mod(point.at, 1.0) - 0.5)


def _taps(point: _Points, size: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return the four texels of each point's lookup, (n, 4), and their weights."""
    first = np.floor(point.at - 0.5)
    part = point.at - 0.5 - first
    corner = np.array([(0, 0), (1, 0), (0, 1), (1, 1)])
    at = np.clip(first[:, None] + corner, 0, size - 1).astype(np.int64)
    share = np.where(corner == 1, part[:, None], 1 - part[:, None]).prod(axis=2)
    return (point.page[:, None] * size + at[..., 1]) * size + at[..., 0], share


def _draw(weight: NDArray[np.float64], n: int, seed: int) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Return n columns of each row of `weight` (m, k), in proportion to it, and which rows have none."""
    total = weight.sum(axis=1)
    random = np.random.Generator(np.random.PCG64([seed, 12]))
    # Even shares in random order, so that few passes already see all of a footprint.
    at = random.permuted((np.arange(n) + random.random((len(weight), 1))) / n, axis=1)
    edge = np.cumsum(weight, axis=1) / np.maximum(total, 1e-30)[:, None]
    drawn = (at[:, :, None] > edge[:, None, :]).sum(axis=2)
    return np.minimum(drawn, weight.shape[1] - 1), total <= 0
