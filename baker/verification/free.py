"""Places of texels inside other geometry are not judged: a bake stores the light of the free ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from baker.judge.texel_area import TexelPlaces
from baker.reference.buried import RAYS, Views, is_buried, look_around
from baker.reference.view import Reference

# Origins leave the surface by this share of the largest coordinate.
_OFFSET = 1.0e-5


def free_places(reference: Reference, places: TexelPlaces, seed: int) -> TexelPlaces:
    """Return places of which the buried ones are replaced by free ones of the same texel, if it has any."""
    random = np.random.Generator(np.random.PCG64([seed, 9]))
    first = _views(reference, places, 1, random)
    suspect = np.flatnonzero((first.black + first.inside > 0).any(axis=1))
    if not len(suspect):
        return places
    some = replace(
        places,
        position=places.position[suspect],
        normal=places.normal[suspect],
        face_normal=places.face_normal[suspect],
    )
    free = ~is_buried(_views(reference, some, RAYS, random))
    count = free.sum(axis=1, keepdims=True)
    # Free places first, in their order; they are taken in turn.
    order = np.argsort(~free, axis=1, kind="stable")
    turn = np.arange(free.shape[1]) % np.maximum(count, 1)
    pick = np.where(free | (count == 0), np.arange(free.shape[1]), np.take_along_axis(order, turn, axis=1))
    changed = [np.array(a) for a in (places.position, places.normal, places.face_normal)]
    for array in changed:
        array[suspect] = np.take_along_axis(array[suspect], pick[..., None], axis=1)
    return replace(places, position=changed[0], normal=changed[1], face_normal=changed[2])


def _views(reference: Reference, places: TexelPlaces, rays: int, random: np.random.Generator) -> Views:
    """Return what the rays of places (n, k) meet, counts (n, k)."""
    position = places.position.reshape(-1, 3)
    normal, face = places.normal.reshape(-1, 3), places.face_normal.reshape(-1, 3)
    step = _OFFSET * np.maximum(np.abs(position).max(axis=1, keepdims=True), reference.surfaces.least)
    found = look_around(reference, position + step * face, normal, rays, random)
    shape = places.position.shape[:2]
    return Views(found.rays, found.inside.reshape(shape), found.black.reshape(shape))
