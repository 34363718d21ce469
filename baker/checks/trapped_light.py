"""How often light is reflected between nearly white surfaces before it ends, by random paths.

What is left after n reflections is s_n; all bounces together multiply light by about 1 / (1 - s_n^(1/n)).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.direct_light import cosine_ways, spread_points

# Points on surfaces (a multiple of 16), paths from each, and their reflections.
POINTS, PATHS, REFLECTIONS = 256, 16, 20
# As in the solve of a bake.
MAX_ALBEDO = 0.999
# What multiplies light by more than an ordinary room.
MOST_GAIN = 20.0


def trapped_gain(context: CheckContext, albedo: NDArray[np.float64]) -> float:
    """Return by how much all bounces multiply light where it is trapped most.

    Parameters
    ----------
    subject : Subject
    albedo : (M,) float64, of each material
    """
    world = context.world
    if not world.area.sum() > 0:
        return 1.0
    random = np.random.default_rng(context.settings.seed)
    position, normal, triangle = spread_points(world, POINTS, random)
    position, normal = np.repeat(position, PATHS, axis=0), np.repeat(normal, PATHS, axis=0)
    triangle = np.repeat(triangle, PATHS)
    left = np.ones(len(position))
    reflected = np.minimum(albedo, MAX_ALBEDO)
    for _ in range(REFLECTIONS):
        left *= reflected[world.material[triangle]]
        way = cosine_ways(normal, 1, random)
        origin = world.lifted(position, triangle, normal)
        hit, distance = world.first_hits(origin, way, np.zeros(len(way)), np.full(len(way), 1e30))
        met = np.maximum(hit, 0)
        behind = np.einsum("nx,nx->n", way, world.normal[met]) > 0
        left[(hit < 0) | (behind & ~world.double_sided[met])] = 0.0
        alive = left > 0
        triangle = np.where(alive, met, triangle)
        normal = np.where(behind[:, None], -world.normal[met], world.normal[met])
        position = np.where(alive[:, None], origin + way * np.where(alive, distance, 0.0)[:, None], position)
    mean = left.reshape(POINTS, PATHS).mean(axis=1)
    # Where light ends early elsewhere says nothing of the room in which it does not.
    trapped = mean > (1.0 - 1.0 / MOST_GAIN) ** REFLECTIONS
    return 1.0 / (1.0 - float(mean[trapped].mean()) ** (1.0 / REFLECTIONS)) if trapped.any() else 1.0
