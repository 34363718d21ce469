"""What lies around judged places: whether they are buried or in narrow gaps, and which room they are in.

`pathtracer.inside_geometry` tells what is buried. A place is in a gap if most of what it sees is nearer than
two texels: no texel can follow the light there, so gaps are counted, and judged by the figures over all
texels only.
A room is what can be seen from one point in the air. Such points are the middles of rays between surfaces;
the one that sees most places makes the first room, the one that sees most of the rest the second. Closed
rooms are told apart, and so are those whose doors stand open, but for what is seen through the door.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.kernels.probe import BLACK_BACK, SOLID_BACK, SOLID_FRONT
from baker.kernels.surface import OFFSET, ROUNDING
from baker.metrics.texel_area import TexelPlaces
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.inside_geometry import RAYS, is_inside_geometry
from baker.pathtracer.inside_geometry import look_around as cast_around
from baker.pathtracer.scene import Reference

# Texels; and the share of a place's rays that end within them in a gap.
_NEAR, _GAP, _CONTACT = 2.0, 0.5, 0.1
# Points in the air that rooms are made of; places that a room must have.
_AIR, _LEAST_ROOM = 160, 8
# Rays that tell whether a point in the air lies in a solid.
_AROUND = 32
# A ray that meets nothing is taken to be this long, as a share of the scene's radius.
_OUT = 0.25
_TOUCH = 1.0e-3


@dataclass(frozen=True)
class Surroundings:
    """What was seen around n points.

    Attributes
    ----------
    places : TexelPlaces
        Those of texels with free places, without the buried ones.
    buried : (n,) bool
        All places are.
    free : (n,) float64
        Share of a point's places that are not buried.
    gap : (n,) bool
        In a gap, or buried.
    room : (n,) int32
        Number of the room; -1 in gaps and where no point in the air sees.
    air : (m, 3) float64
        Points in the air that rooms were made of.
    """

    places: TexelPlaces
    buried: NDArray[np.bool_]
    free: NDArray[np.float64]
    gap: NDArray[np.bool_]
    room: NDArray[np.int32]
    air: NDArray[np.float64]


def look_around(reference: Reference, places: TexelPlaces, seed: int) -> Surroundings:
    """Find what is buried, what lies in gaps, and rooms."""
    random = np.random.Generator(np.random.PCG64([seed, 9]))
    black, near, air = _first_look(reference, places, random)
    suspect = np.flatnonzero(black.any(axis=1))
    free = np.ones(len(places.position))
    if len(suspect):
        places, free[suspect] = _free_places(reference, places, suspect, random)
    buried = free == 0
    gap = (near.mean(axis=1) > _GAP) | buried
    room = np.full(len(air), -1, np.int32)
    eyes = np.zeros((0, 3))
    # Places that none of the first points in the air see get some of their own: small rooms.
    for _ in range(2):
        left = np.flatnonzero((room < 0) & ~gap)
        some = _outside(reference, air[left[random.permutation(len(left))[:_AIR]]], seed)
        _add_rooms(reference, places, some, left, room)
        eyes = np.concatenate([eyes, some])
    return Surroundings(places, buried, free, gap, room, eyes)


def _outside(reference: Reference, air: NDArray[np.float64], seed: int) -> NDArray[np.float64]:
    """Return the points (m, 3) in the air that lie in no solid: nobody looks around from inside of one.

    A ray from a buried place of a texel that is partly free has its middle in a solid where it meets the
    front of another solid within.
    """
    random = np.random.Generator(np.random.PCG64([seed, 14]))
    # Without a normal directions are even over the sphere.
    views = cast_around(reference, air, np.zeros_like(air), _AROUND, random)
    return air[~is_inside_geometry(views)]


def in_contact(reference: Reference, places: TexelPlaces, seed: int) -> NDArray[np.bool_]:
    """Tell of points (n,) whether a tenth of what their places see is nearer than two texels."""
    _, near, _ = _first_look(reference, places, np.random.Generator(np.random.PCG64([seed, 9])))
    touching: NDArray[np.bool_] = near.mean(axis=1) > _CONTACT
    return touching


def _free_places(
    reference: Reference, places: TexelPlaces, suspect: NDArray[np.int64], random: np.random.Generator
) -> tuple[TexelPlaces, NDArray[np.float64]]:
    """Return places, the buried ones replaced by free ones of the same texel, and the share of free ones."""
    position, normal = places.position[suspect], places.normal[suspect]
    free = ~buried_places(reference, position, normal, places.face_normal[suspect], random)
    count = free.sum(axis=1, keepdims=True)
    # Free places first, in their order; they are taken in turn.
    order = np.argsort(~free, axis=1, kind="stable")
    turn = np.arange(free.shape[1]) % np.maximum(count, 1)
    pick = np.where(free | (count == 0), np.arange(free.shape[1]), np.take_along_axis(order, turn, axis=1))
    changed = [np.array(a) for a in (places.position, places.normal, places.face_normal)]
    for array in changed:
        array[suspect] = np.take_along_axis(array[suspect], pick[..., None], axis=1)
    free_ones = replace(places, position=changed[0], normal=changed[1], face_normal=changed[2])
    return free_ones, count[:, 0] / free.shape[1]


def buried_places(
    reference: Reference,
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    face_normal: NDArray[np.float64],
    random: np.random.Generator,
) -> NDArray[np.bool_]:
    """Return (n, k): which of the places (n, k, 3) are buried."""
    origin = lifted(reference, position, face_normal)
    found = is_inside_geometry(cast_around(reference, origin, normal.reshape(-1, 3), RAYS, random))
    return found.reshape(position.shape[:2])


def _first_look(
    reference: Reference, places: TexelPlaces, random: np.random.Generator
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float64]]:
    """Cast a ray from each place: does it meet what buries, is the hit near (n, k), a middle (n, 3)."""
    n, k = places.position.shape[:2]
    origin = lifted(reference, places.position, places.face_normal)
    way = _cosine(places.normal.reshape(-1, 3), random)
    hits = first_hits(reference, origin, way)
    told = np.where(hits.triangle >= 0, reference.tells[hits.triangle], 0)
    inside = told == np.where(hits.front, SOLID_FRONT, SOLID_BACK)
    black = (inside | ((told == BLACK_BACK) & ~hits.front)).reshape(n, k)
    width = np.sqrt(places.surface / np.maximum(places.area, 1e-12))
    near = hits.depth.reshape(n, k) < _NEAR * width[:, None]
    length = np.minimum(hits.depth, _OUT * reference.sphere[3])
    middle = origin + 0.5 * length[:, None] * way
    # The longest of a point's rays ends its room's far side.
    longest = np.argmax(np.where(black, 0.0, length.reshape(n, k)), axis=1)
    return black, near, middle.reshape(n, k, 3)[np.arange(n), longest]


def _add_rooms(
    reference: Reference,
    places: TexelPlaces,
    air: NDArray[np.float64],
    left: NDArray[np.int64],
    room: NDArray[np.int32],
) -> None:
    """Make rooms of the points `left`, as seen from points in the air (m, 3); `room` is changed."""
    seen = visible(reference, air, places.position[left, 0], places.face_normal[left, 0])
    alone = np.ones(len(left), bool)
    while len(air):
        count = (seen & alone).sum(axis=1)
        best = int(np.argmax(count))
        if count[best] < _LEAST_ROOM:
            break
        room[left[alone & seen[best]]] = room.max() + 1
        alone &= ~seen[best]


def visible(
    reference: Reference, eye: NDArray[np.float64], place: NDArray[np.float64], face: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return (m, n): the front of place (n, 3) with normals `face` is seen from points `eye` (m, 3)."""
    m, n = len(eye), len(place)
    target = lifted(reference, place[:, None], face[:, None])
    way = target[None] - eye[:, None]
    facing = (way * face[None]).sum(axis=2) < 0
    row, column = np.nonzero(facing)
    result = np.zeros((m, n), bool)
    result[row, column] = seen_along(reference, eye[row], way[row, column])
    return result


def seen_along(
    reference: Reference, origin: NDArray[np.float64], way: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Return whether nothing lies between each origin (n, 3) and the end of its way (n, 3)."""
    length = np.linalg.norm(way, axis=1)
    hits = first_hits(reference, origin, way / np.maximum(length, 1e-30)[:, None])
    seen: NDArray[np.bool_] = hits.depth > length * (1 - _TOUCH)
    return seen


def _cosine(normal: NDArray[np.float64], random: np.random.Generator) -> NDArray[np.float64]:
    """Return cosine-weighted directions (n, 3): the normal and a point of the unit sphere."""
    ball = random.standard_normal(normal.shape)
    way = normal + ball / np.linalg.norm(ball, axis=1, keepdims=True)
    result: NDArray[np.float64] = way / np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
    return result


def lifted(
    reference: Reference, position: NDArray[np.float64], face: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return places (n, k, 3) as (n k, 3), off their surface by what rounding needs."""
    position, face = position.reshape(-1, 3), face.reshape(-1, 3)
    far, sizes = np.abs(position).max(axis=1, keepdims=True), reference.surfaces
    step = OFFSET * np.minimum(np.maximum(far, sizes.min_offset_scale), sizes.default_size)
    step = np.maximum(step, ROUNDING * np.maximum(far, sizes.default_size))
    lifted: NDArray[np.float64] = position + step * face
    return lifted
