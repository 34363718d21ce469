"""Finds points inside geometry, by the same rule as the bake but with different rays.

A point is inside geometry if at least `kernels.probe.PROOF` of its rays hit a solid from inside. It is also
inside if each of its rays hits either a solid from inside or a black back, the back of a one-sided surface.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.probe import BLACK_BACK, PROOF, SOLID_BACK, SOLID_FRONT
from baker.pathtracer.first_hit import first_hits
from baker.pathtracer.scene import Reference

# Number of rays from each point.
RAYS = 8


class Views(NamedTuple):
    """For each of n points, how many rays hit a solid from inside, and how many hit a black back.

    Attributes
    ----------
    rays : int
        Number of rays from each point.
    inside : (n,) int64
        Number of each point's rays that hit a solid from inside.
    black : (n,) int64
        Number of each point's rays that hit a black back.
    """

    rays: int
    inside: NDArray[np.int64]
    black: NDArray[np.int64]


def is_inside_geometry(views: Views) -> NDArray[np.bool_]:
    """Return which of n points are inside geometry.

    Parameters
    ----------
    views : Views
        Counts of the points, from `cast_around`.

    Returns
    -------
    (n,) bool
        True for points inside geometry.
    """
    found: NDArray[np.bool_] = (views.inside >= PROOF) | (views.inside + views.black == views.rays)
    return found


def cast_around(
    reference: Reference,
    origin: NDArray[np.float64],
    normal: NDArray[np.float64],
    rays: int,
    random: np.random.Generator,
) -> Views:
    """Cast cosine-weighted rays from n points, and count those that hit a solid from inside or a black back.

    Parameters
    ----------
    reference : Reference
        The scene, built with `find_solids=True`.
    origin : (n, 3) float64
        Points, metres, relative to the geometry's origin.
    normal : (n, 3) float64
        Normals at the points, unit, world.
    rays : int
        Number of rays from each point.
    random : Generator
        Generator of the random directions.

    Returns
    -------
    Views
        The counts of each point.
    """
    inside, black = np.zeros(len(origin), np.int64), np.zeros(len(origin), np.int64)
    for _ in range(rays):
        # The sum of the normal and a random unit vector has a cosine-weighted direction.
        ball = random.standard_normal((len(origin), 3))
        direction = normal + ball / np.linalg.norm(ball, axis=1, keepdims=True)
        direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-9)
        hits = first_hits(reference, origin, direction)
        found = np.where(hits.triangle >= 0, reference.hit_kind[hits.triangle], 0)
        inside += found == np.where(hits.front, SOLID_FRONT, SOLID_BACK)
        black += (found == BLACK_BACK) & ~hits.front
    return Views(rays, inside, black)
