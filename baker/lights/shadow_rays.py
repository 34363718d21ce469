"""Writes shadow rays towards the built-in kinds of lights, and the unoccluded irradiance of each ray.

The kernels are not in the files of `baker.lights.kinds`: loading a scene imports those files, and importing
Numba would take longer than loading most scenes.
"""

from __future__ import annotations

import math

import numpy as np

from baker.trace.jit import inner, kernel, larger, smaller

# TFAR of shadow rays, as a share of the distance to the light: the rays end just before the light.
_SHORT = np.float32(0.99999)


@inner
def range_window(square, inverse_range):  # type: ignore[no-untyped-def]
    """Return clamp(1 - (r / range)^4, 0, 1).

    square : r^2, square of the distance; inverse_range : 1 / range^2, 0 without a range
    """
    share = square * inverse_range
    return larger(1.0 - share * share, 0.0)


@kernel
def fill_inverse_square(position, inverse_range, origin, normal, ray, weight):  # type: ignore[no-untyped-def]
    """Write shadow rays to a light at `position`, and the weights cos / r^2 times `range_window`.

    position : (3,) float64, metres, in the same space as `origin`
    inverse_range : float, 1 / range^2, 0 without a range, see `PunctualLight.inverse_range`
    origin, normal : (n, 16, 3), ray : (n, 16, 4), weight : (n, 16) float32, see `FillRays`
    """
    for i in range(origin.shape[0]):
        for k in range(origin.shape[1]):
            dx = position[0] - origin[i, k, 0]
            dy = position[1] - origin[i, k, 1]
            dz = position[2] - origin[i, k, 2]
            square = larger(dx * dx + dy * dy + dz * dz, 1.0e-20)
            cosine = (dx * normal[i, k, 0] + dy * normal[i, k, 1] + dz * normal[i, k, 2]) / math.sqrt(square)
            ray[i, k, 0], ray[i, k, 1], ray[i, k, 2], ray[i, k, 3] = dx, dy, dz, _SHORT
            weight[i, k] = larger(cosine, 0.0) / square * range_window(square, inverse_range)


@kernel
def multiply_by_cone(direction, outer, scale, ray, weight):  # type: ignore[no-untyped-def]
    """Multiply the weights by the angular fall-off of a spot light.

    direction : (3,) float64, unit axis of the cone, world
    outer, scale : float, cosine of the outer angle, and 1 / (cosine of the inner angle - `outer`), at
        most 1000
    ray : (n, 16, 4) float32, see `FillRays`; read
    weight : (n, 16) float32, see `FillRays`; changed in place
    """
    for i in range(ray.shape[0]):
        for k in range(ray.shape[1]):
            dx, dy, dz = ray[i, k, 0], ray[i, k, 1], ray[i, k, 2]
            length = math.sqrt(larger(dx * dx + dy * dy + dz * dz, 1.0e-20))
            cosine = -(dx * direction[0] + dy * direction[1] + dz * direction[2]) / length
            share = smaller(larger((cosine - outer) * scale, 0.0), 1.0)
            weight[i, k] *= share * share


@kernel
def fill_parallel(direction, normal, ray, weight):  # type: ignore[no-untyped-def]
    """Write shadow rays towards a directional light, and the weights cos(theta).

    direction : (3,) float64, unit vector in which the light travels, world
    normal : (n, 16, 3), ray : (n, 16, 4), weight : (n, 16) float32, see `FillRays`
    """
    for i in range(ray.shape[0]):
        for k in range(ray.shape[1]):
            for a in range(3):
                ray[i, k, a] = -direction[a]
            ray[i, k, 3] = 1.0e30
            cosine = -(
                direction[0] * normal[i, k, 0]
                + direction[1] * normal[i, k, 1]
                + direction[2] * normal[i, k, 2]
            )
            weight[i, k] = larger(cosine, 0.0)
