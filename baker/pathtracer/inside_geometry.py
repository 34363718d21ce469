"""Whether points are inside geometry, by the bake's rule with independent rays.

A point is inside geometry if enough of its rays hit a solid from inside, or all rays hit such a side or a
black back.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.probe import BLACK_BACK, PROOF, SOLID_BACK, SOLID_FRONT
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.scene import Reference

# Rays for each point.
RAYS = 8


class Views(NamedTuple):
    """Counts of rays from n points that hit a solid from inside, and that hit a black back.

    Attributes
    ----------
    rays : int
        Of each point.
    inside, black : (n,) int64
    """

    rays: int
    inside: NDArray[np.int64]
    black: NDArray[np.int64]


def is_inside_geometry(views: Views) -> NDArray[np.bool_]:
    """Return which points are inside geometry.

    Parameters
    ----------
    views : Views
        Of n points.

    Returns
    -------
    (n,) bool
        True inside geometry.
    """
    found: NDArray[np.bool_] = (views.inside >= PROOF) | (views.inside + views.black == views.rays)
    return found


def look_around(
    reference: Reference,
    origin: NDArray[np.float64],
    normal: NDArray[np.float64],
    rays: int,
    random: np.random.Generator,
) -> Views:
    """Cast cosine-weighted rays from points.

    Parameters
    ----------
    reference : Reference
        Built with `find_solids=True`.
    origin : (n, 3) float64
        Metres, relative to the geometry's origin.
    normal : (n, 3) float64
        Unit, world.
    rays : int
        For each point.
    random : Generator
        Of the directions.

    Returns
    -------
    Views
        Of the n points.
    """
    inside, black = np.zeros(len(origin), np.int64), np.zeros(len(origin), np.int64)
    for _ in range(rays):
        # Add a point of the unit sphere to the normal.
        ball = random.standard_normal((len(origin), 3))
        direction = normal + ball / np.linalg.norm(ball, axis=1, keepdims=True)
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
        hits = first_hits(reference, origin, direction)
        found = np.where(hits.triangle >= 0, reference.hit_kind[hits.triangle], 0)
        inside += found == np.where(hits.front, SOLID_FRONT, SOLID_BACK)
        black += (found == BLACK_BACK) & ~hits.front
    return Views(rays, inside, black)
