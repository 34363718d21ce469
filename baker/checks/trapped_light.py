"""Gain of light by reflections between nearly white surfaces, by random paths.

If the share s_n of the light is left after n reflections, each of them keeps about s_n^(1/n), and all bounces
together multiply light by 1 / (1 - s_n^(1/n)), the sum of the geometric series.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.direct_light import cosine_directions, spread_points

# Points on surfaces (a multiple of 16), paths from each, and their reflections.
POINTS, PATHS, REFLECTIONS = 256, 16, 20
# As in the solve of a bake.
MAX_ALBEDO = 0.999
# Gain above which light counts as trapped: that of albedo 0.95 everywhere, more than any ordinary room.
MOST_GAIN = 20.0


def trapped_gain(context: CheckContext, albedo: NDArray[np.float64]) -> float:
    """Return the factor by which all bounces multiply light where it is trapped.

    Parameters
    ----------
    context : CheckContext
    albedo : (M,) float64
        Of each material, 0 to 1.

    Returns
    -------
    float
        1 if there is no surface, or no point at which the gain exceeds `MOST_GAIN`.
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
        direction = cosine_directions(normal, 1, random)
        origin = world.lifted(position, triangle, normal)
        hit, distance = world.first_hits(
            origin, direction, np.zeros(len(direction)), np.full(len(direction), 1e30)
        )
        met = np.maximum(hit, 0)
        behind = np.einsum("nx,nx->n", direction, world.normal[met]) > 0
        left[(hit < 0) | (behind & ~world.double_sided[met])] = 0.0
        alive = left > 0
        triangle = np.where(alive, met, triangle)
        normal = np.where(behind[:, None], -world.normal[met], world.normal[met])
        position = np.where(
            alive[:, None], origin + direction * np.where(alive, distance, 0.0)[:, None], position
        )
    mean = left.reshape(POINTS, PATHS).mean(axis=1)
    # Average over points where light is trapped only: otherwise an open part of the scene would outweigh a
    # white room.
    trapped = mean > (1.0 - 1.0 / MOST_GAIN) ** REFLECTIONS
    return 1.0 / (1.0 - float(mean[trapped].mean()) ** (1.0 / REFLECTIONS)) if trapped.any() else 1.0
