"""Whether places lie inside of a solid or see nothing but black backs: the bake's rule, with other rays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.probe import BLACK_BACK, PROOF, SOLID_BACK, SOLID_FRONT
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.scene import Reference

# Rays that tell whether a place is buried.
RAYS = 8


class Views(NamedTuple):
    """How many of the rays of places come from the inside of a solid, and how many see a black back.

    rays int; inside, black (n,) int64
    """

    rays: int
    inside: NDArray[np.int64]
    black: NDArray[np.int64]


def is_inside_geometry(views: Views) -> NDArray[np.bool_]:
    """Tell which places are buried."""
    found: NDArray[np.bool_] = (views.inside >= PROOF) | (views.inside + views.black == views.rays)
    return found


def look_around(
    reference: Reference,
    origin: NDArray[np.float64],
    normal: NDArray[np.float64],
    rays: int,
    random: np.random.Generator,
) -> Views:
    """Cast cosine-weighted rays from places.

    Parameters
    ----------
    reference : Reference
        Built with `buried=True`.
    origin, normal : (n, 3) float64
    rays : int, of each place
    """
    inside, black = np.zeros(len(origin), np.int64), np.zeros(len(origin), np.int64)
    for _ in range(rays):
        # The normal and a point of the unit sphere.
        ball = random.standard_normal((len(origin), 3))
        direction = normal + ball / np.linalg.norm(ball, axis=1, keepdims=True)
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
        hits = first_hits(reference, origin, direction)
        told = np.where(hits.triangle >= 0, reference.tells[hits.triangle], 0)
        inside += told == np.where(hits.front, SOLID_FRONT, SOLID_BACK)
        black += (told == BLACK_BACK) & ~hits.front
    return Views(rays, inside, black)
