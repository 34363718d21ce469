"""Point light: I candela from a point without size.

    E = I cos(theta) / r^2 * clamp(1 - (r / range)^4, 0, 1)

Based on: KHR_lights_punctual, "Point" and "Range Property"; Lambert's cosine and inverse-square laws.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import LIGHT_KINDS, Distribution, LightKind
from baker.core.scene import PunctualLight
from baker.trace.jit import inner, kernel, larger

# Shadow rays end this share of their length before the light's position.
_SHORT = np.float32(0.99999)


@inner
def range_window(square, inverse_range):  # type: ignore[no-untyped-def]
    """Return clamp(1 - (r / range)^4, 0, 1) for r^2 and 1 / range^2 (0: no range)."""
    share = square * inverse_range
    return larger(1.0 - share * share, 0.0)


def point_light(
    light: PunctualLight,
    origin: NDArray[np.float32],
    normal: NDArray[np.float32],
    ray: NDArray[np.float32],
    weight: NDArray[np.float32],
) -> None:
    """Fill rays and weights of a point light (see `FillRays`)."""
    position = np.array(light.position, np.float64)
    inverse_square(position, light.inverse_range, origin, normal, ray, weight)


@kernel
def inverse_square(position, inverse_range, origin, normal, ray, weight):  # type: ignore[no-untyped-def]
    """Fill rays to a position and weights cos / r^2, faded out towards the range.

    inverse_range : float, 1 / range^2, see `PunctualLight.inverse_range`
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


def _power(light: PunctualLight, disc: float) -> float:
    return 4 * math.pi


POINT = LIGHT_KINDS.register("point")(
    LightKind(
        name="point",
        unit="cd",
        delta=True,
        distribution=Distribution.ISOTROPIC,
        gltf_type="point",
        plausible_max=1e6,
        fill=point_light,
        power=_power,
    )
)
