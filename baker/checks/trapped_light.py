"""Estimates the gain of light by reflections between nearly white surfaces, with random paths.

Let s_n be the share of the light that is left after n reflections. Each reflection then keeps a share of
about s_n^(1/n). The gain is the ratio of all light to direct light. It is the sum of a geometric series,
1 / (1 - s_n^(1/n)).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.direct_light import cosine_directions, spread_points

# Number of points on surfaces (a multiple of 16), of paths from each point, and of reflections in each path.
POINTS, PATHS, REFLECTIONS = 256, 16, 20
# Upper limit of albedos, the same as `MAX_ALBEDO` of `baker.radiosity.solve`.
MAX_ALBEDO = 0.999
# Gain above which light counts as trapped: the gain of a closed room whose albedo is 0.95 everywhere.
MOST_GAIN = 20.0


def trapped_gain(context: CheckContext, albedo: NDArray[np.float64]) -> float:
    """Return the gain of light by reflections at the points at which light is trapped.

    Light is trapped at a point if the gain of the paths from this point exceeds `MOST_GAIN`.

    Parameters
    ----------
    context : CheckContext
        The scene.
    albedo : (M,) float64
        Albedo of each material, 0 to 1.

    Returns
    -------
    float
        The gain that follows from the mean share s_n over all points at which light is trapped, n =
        `REFLECTIONS`. It is 1 if the scene has no surface, or if light is trapped nowhere.
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
    # Average only over points where light is trapped: low gains in open parts of the scene would hide the
    # high gain in a closed white room.
    trapped = mean > (1.0 - 1.0 / MOST_GAIN) ** REFLECTIONS
    return 1.0 / (1.0 - float(mean[trapped].mean()) ** (1.0 / REFLECTIONS)) if trapped.any() else 1.0
