"""Spot light: a point light inside a cone with glTF's fall-off.

    E = I cos(theta) / r^2 * clamp((cos a - cos outer) / (cos inner - cos outer), 0, 1)^2
        * clamp(1 - (r / range)^4, 0, 1)

Based on: KHR_lights_punctual, "Inner and Outer Cone Angles" and "Range Property".
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import LIGHT_KINDS, Distribution, LightKind
from baker.core.scene import PunctualLight
from baker.lights.families.point import inverse_square
from baker.trace.jit import kernel, larger, smaller


def spot_light(
    light: PunctualLight,
    origin: NDArray[np.float32],
    normal: NDArray[np.float32],
    ray: NDArray[np.float32],
    weight: NDArray[np.float32],
) -> None:
    """Fill rays and weights of a spot light (see `FillRays`)."""
    position = np.array(light.position, np.float64)
    inverse_square(position, light.inverse_range, origin, normal, ray, weight)
    outer = math.cos(light.outer_cone)
    scale = 1.0 / max(0.001, math.cos(light.inner_cone) - outer)
    _cone(np.array(light.direction, np.float64), outer, scale, ray, weight)


@kernel
def _cone(direction, outer, scale, ray, weight):  # type: ignore[no-untyped-def]
    """Multiply weights by the cone's fall-off."""
    for i in range(ray.shape[0]):
        for k in range(ray.shape[1]):
            dx, dy, dz = ray[i, k, 0], ray[i, k, 1], ray[i, k, 2]
            length = math.sqrt(larger(dx * dx + dy * dy + dz * dz, 1.0e-20))
            cosine = -(dx * direction[0] + dy * direction[1] + dz * direction[2]) / length
            share = smaller(larger((cosine - outer) * scale, 0.0), 1.0)
            weight[i, k] *= share * share


def _power(light: PunctualLight, disc: float) -> float:
    return 2 * math.pi * (1 - math.cos(light.outer_cone))


SPOT = LIGHT_KINDS.register("spot")(
    LightKind(
        name="spot",
        unit="cd",
        delta=True,
        distribution=Distribution.CONE,
        gltf_type="spot",
        plausible_max=1e7,
        fill=spot_light,
        power=_power,
    )
)
