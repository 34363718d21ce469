"""Places of texels that lie inside other geometry are not judged: a bake stores the light of the free ones.

A place is buried if most of what it sees are black backs of one-sided surfaces.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.judge.texel_area import TexelPlaces
from baker.reference.first_hit import first_hits
from baker.reference.view import Reference

_RAYS = 8
_SHARE = 0.5
# Origins leave the surface by this share of the largest coordinate.
_OFFSET = 1.0e-5


def free_places(reference: Reference, places: TexelPlaces, seed: int) -> TexelPlaces:
    """Return places of which the buried ones are replaced by free ones of the same texel, if it has any."""
    random = np.random.Generator(np.random.PCG64([seed, 9]))
    suspect = np.flatnonzero((_black_share(reference, places, 1, random) > 0).any(axis=1))
    if not len(suspect):
        return places
    some = replace(
        places,
        position=places.position[suspect],
        normal=places.normal[suspect],
        face_normal=places.face_normal[suspect],
    )
    free = _black_share(reference, some, _RAYS, random) <= _SHARE
    count = free.sum(axis=1, keepdims=True)
    # Free places first, in their order; they are taken in turn.
    order = np.argsort(~free, axis=1, kind="stable")
    turn = np.arange(free.shape[1]) % np.maximum(count, 1)
    pick = np.where(free | (count == 0), np.arange(free.shape[1]), np.take_along_axis(order, turn, axis=1))
    changed = [np.array(a) for a in (places.position, places.normal, places.face_normal)]
    for array in changed:
        array[suspect] = np.take_along_axis(array[suspect], pick[..., None], axis=1)
    return replace(places, position=changed[0], normal=changed[1], face_normal=changed[2])


def _black_share(
    reference: Reference, places: TexelPlaces, rays: int, random: np.random.Generator
) -> NDArray[np.float64]:
    """Return (n, k): the share of a place's cosine-weighted rays that meet black backs."""
    position = places.position.reshape(-1, 3)
    normal, face = places.normal.reshape(-1, 3), places.face_normal.reshape(-1, 3)
    least = reference.surfaces.least
    step = _OFFSET * np.maximum(np.abs(position).max(axis=1, keepdims=True), least)
    origin = position + step * face
    black = np.zeros(len(position))
    for _ in range(rays):
        # A cosine-weighted direction: the normal and a point of the unit sphere.
        ball = random.standard_normal((len(position), 3))
        way = normal + ball / np.linalg.norm(ball, axis=1, keepdims=True)
        way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-9)
        hits = first_hits(reference, origin, way)
        black += (hits.triangle >= 0) & ~hits.lit
    return black.reshape(places.position.shape[:2]) / rays
