"""Finds which compared points are inside geometry or in narrow gaps, and groups the other points in rooms.

`baker.pathtracer.inside_geometry` finds the points inside geometry. A texel is in a narrow gap if more than
half of the rays from its points end within two texels. Texels cannot resolve the light in gaps, so texels in
gaps are used only for the error metrics over all texels and over the texels of each object.

A room is a set of points that are visible from one point in the air. Points in the air are midpoints of rays
between surfaces. The point in the air from which most points are visible defines the first room. The point
from which most of the remaining points are visible defines the second room, and so on. This rule separates
closed rooms. The rule also separates rooms with open doors, except for the surface that is visible through
the door.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.kernels.probe import BLACK_BACK, SOLID_BACK, SOLID_FRONT
from baker.kernels.surface import OFFSET, ROUNDING
from baker.metrics.texel_area import SurfacePoints
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.inside_geometry import RAYS, cast_around, is_inside_geometry
from baker.pathtracer.scene import Reference

# Length below which a ray counts as near, texels.
_NEAR = 2.0
# Share of near rays above which a texel is in a gap, and share above which it is in contact with another
# surface.
_GAP, _CONTACT = 0.5, 0.1
# Largest number of points in the air from which a round finds rooms, and smallest number of texels in a room.
_AIR, _MIN_ROOM = 160, 8
# Number of rays that test whether a point in the air is inside geometry.
_AROUND = 32
# Largest ray length that is used to find points in the air, as a share of the scene's radius.
_MISS_LENGTH = 0.25
# Distance from the end of a segment within which a hit does not block the segment, as a share of its length.
_TOUCH = 1.0e-3


@dataclass(frozen=True)
class Surroundings:
    """The surroundings of n texels with k points each.

    Attributes
    ----------
    points : SurfacePoints
        The points. If a texel has valid points, its points inside geometry are replaced by copies of valid
        points.
    inside : (n,) bool
        Whether all points of the texel are inside geometry.
    valid_share : (n,) float64
        Share of the texel's points that are valid.
    gap : (n,) bool
        Whether the texel is in a narrow gap or inside geometry.
    room : (n,) int32
        Index of the room; -1 in gaps, and if the texel is in no room.
    air : (m, 3) float64, metres, world, relative to the geometry's origin
        Points in the air from which rooms were found.
    """

    points: SurfacePoints
    inside: NDArray[np.bool_]
    valid_share: NDArray[np.float64]
    gap: NDArray[np.bool_]
    room: NDArray[np.int32]
    air: NDArray[np.float64]


def find_surroundings(reference: Reference, points: SurfacePoints, seed: int) -> Surroundings:
    """Find the points inside geometry, and the narrow gaps and rooms of n texels with k points each."""
    random = np.random.Generator(np.random.PCG64([seed, 9]))
    black, near, air = _first_look(reference, points, random)
    # Test all points of a texel if one of its rays hits a black back or the inside of a solid.
    tested = np.flatnonzero(black.any(axis=1))
    valid_share = np.ones(len(points.position))
    if len(tested):
        points, valid_share[tested] = _valid_points(reference, points, tested, random)
    inside = valid_share == 0
    gap = (near.mean(axis=1) > _GAP) | inside
    room = np.full(len(air), -1, np.int32)
    eyes = np.zeros((0, 3))
    # The second round uses points in the air of texels that are in no room yet. This round finds small rooms.
    for _ in range(2):
        left = np.flatnonzero((room < 0) & ~gap)
        some = _outside(reference, air[left[random.permutation(len(left))[:_AIR]]], seed)
        _add_rooms(reference, points, some, left, room)
        eyes = np.concatenate([eyes, some])
    return Surroundings(points, inside, valid_share, gap, room, eyes)


def _outside(reference: Reference, air: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Return (m, 3) float64: the points `air` that are not inside geometry.

    Midpoints of rays can be inside a solid if the ray starts at a point inside geometry.
    """
    random = np.random.Generator(np.random.PCG64([seed, 14]))
    # Pass normals of 0, which give uniformly distributed directions.
    views = cast_around(reference, air, np.zeros_like(air), _AROUND, random)
    return air[~is_inside_geometry(views)]


def in_contact(reference: Reference, points: SurfacePoints, seed: int) -> NDArray[np.bool_]:
    """Return (n,) bool: the texels for which more than a tenth of the rays end within two texels."""
    _, near, _ = _first_look(reference, points, np.random.Generator(np.random.PCG64([seed, 9])))
    touching: NDArray[np.bool_] = near.mean(axis=1) > _CONTACT
    return touching


def _valid_points(
    reference: Reference, points: SurfacePoints, tested: NDArray[np.int64], random: np.random.Generator
) -> tuple[SurfacePoints, NDArray[np.float64]]:
    """Replace invalid points of the tested texels by valid points of the same texel.

    tested : (m,) int64, indices of texels

    Returns the points of all texels, and (m,) float64, the shares of valid points of the tested texels.
    """
    position, normal = points.position[tested], points.normal[tested]
    valid = ~inside_points(reference, position, normal, points.face_normal[tested], random)
    count = valid.sum(axis=1, keepdims=True)
    # Replace the invalid points by copies of the valid points of the texel. Each valid point is used about
    # equally often.
    order = np.argsort(~valid, axis=1, kind="stable")
    turn = np.arange(valid.shape[1]) % np.maximum(count, 1)
    pick = np.where(valid | (count == 0), np.arange(valid.shape[1]), np.take_along_axis(order, turn, axis=1))
    changed = [np.array(a) for a in (points.position, points.normal, points.face_normal)]
    for array in changed:
        array[tested] = np.take_along_axis(array[tested], pick[..., None], axis=1)
    replaced = replace(points, position=changed[0], normal=changed[1], face_normal=changed[2])
    return replaced, count[:, 0] / valid.shape[1]


def inside_points(
    reference: Reference,
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    face_normal: NDArray[np.float64],
    random: np.random.Generator,
) -> NDArray[np.bool_]:
    """Return (n, k) bool: the points inside geometry.

    position, face_normal : (n, k, 3) float64; normal : (n, k, 3) float64, shading normals
    """
    origin = lifted(reference, position, face_normal)
    found = is_inside_geometry(cast_around(reference, origin, normal.reshape(-1, 3), RAYS, random))
    return found.reshape(position.shape[:2])


def _first_look(
    reference: Reference, points: SurfacePoints, random: np.random.Generator
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float64]]:
    """Cast one ray from each of k points of n texels.

    The results are:

    - (n, k) bool: whether the ray hits a black back or the inside of a solid;
    - (n, k) bool: whether the hit is near;
    - (n, 3) float64: for each texel, the midpoint of the longest ray that hits no black back and no inside.
    """
    n, k = points.position.shape[:2]
    origin = lifted(reference, points.position, points.face_normal)
    direction = _cosine(points.normal.reshape(-1, 3), random)
    hits = first_hits(reference, origin, direction)
    flags = np.where(hits.triangle >= 0, reference.hit_kind[hits.triangle], 0)
    inside = flags == np.where(hits.front, SOLID_FRONT, SOLID_BACK)
    black = (inside | ((flags == BLACK_BACK) & ~hits.front)).reshape(n, k)
    width = np.sqrt(points.surface / np.maximum(points.area, 1e-12))
    near = hits.depth.reshape(n, k) < _NEAR * width[:, None]
    length = np.minimum(hits.depth, _MISS_LENGTH * reference.sphere[3])
    middle = origin + 0.5 * length[:, None] * direction
    # Choose the longest ray, which usually ends at the far side of the room.
    longest = np.argmax(np.where(black, 0.0, length.reshape(n, k)), axis=1)
    return black, near, middle.reshape(n, k, 3)[np.arange(n), longest]


def _add_rooms(
    reference: Reference,
    points: SurfacePoints,
    air: NDArray[np.float64],
    left: NDArray[np.int64],
    room: NDArray[np.int32],
) -> None:
    """Assign texels to new rooms by visibility from points in the air.

    air : (m, 3) float64, metres; left : (p,) int64, indices of texels without a room
    room : (n,) int32, changed at texels that get a room
    """
    seen = visible(reference, air, points.position[left, 0], points.face_normal[left, 0])
    alone = np.ones(len(left), bool)
    while len(air):
        count = (seen & alone).sum(axis=1)
        best = int(np.argmax(count))
        if count[best] < _MIN_ROOM:
            break
        room[left[alone & seen[best]]] = room.max() + 1
        alone &= ~seen[best]


def visible(
    reference: Reference, eye: NDArray[np.float64], point: NDArray[np.float64], face: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return (m, n) bool: whether the front of each point is visible from each eye.

    eye : (m, 3) float64, metres; point : (n, 3) float64, metres; face : (n, 3) float64, face normals
    """
    m, n = len(eye), len(point)
    target = lifted(reference, point[:, None], face[:, None])
    segment = target[None] - eye[:, None]
    facing = (segment * face[None]).sum(axis=2) < 0
    row, column = np.nonzero(facing)
    result = np.zeros((m, n), bool)
    result[row, column] = seen_along(reference, eye[row], segment[row, column])
    return result


def seen_along(
    reference: Reference, origin: NDArray[np.float64], segment: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return (n,) bool: whether no surface blocks the segment from `origin` to `origin + segment`, (n, 3)."""
    length = np.linalg.norm(segment, axis=1)
    hits = first_hits(reference, origin, segment / np.maximum(length, 1e-30)[:, None])
    seen: NDArray[np.bool_] = hits.depth > length * (1 - _TOUCH)
    return seen


def _cosine(normal: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Return (n, 3) float64: cosine-weighted random directions around normals (n, 3).

    Each direction is the normalised sum of the normal and a random point on the unit sphere.
    """
    sphere = random.standard_normal(normal.shape)
    total = normal + sphere / np.linalg.norm(sphere, axis=1, keepdims=True)
    result: NDArray[np.float64] = total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-9)
    return result


def lifted(
    reference: Reference, position: NDArray[np.float64], face: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return (n k, 3) float64: points (n, k, 3) after an offset along their face normals.

    The offset keeps rays from hitting their own surface because of rounding errors.
    """
    position, face = position.reshape(-1, 3), face.reshape(-1, 3)
    far, sizes = np.abs(position).max(axis=1, keepdims=True), reference.surfaces
    step = OFFSET * np.minimum(np.maximum(far, sizes.min_offset_scale), sizes.default_size)
    step = np.maximum(step, ROUNDING * np.maximum(far, sizes.default_size))
    lifted: NDArray[np.float64] = position + step * face
    return lifted
