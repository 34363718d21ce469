"""Directional light: E lux from one direction, as the sun.

    E = E_light cos(theta)

Based on: KHR_lights_punctual, "Directional".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import LIGHT_KINDS, Distribution, LightKind
from baker.core.scene import PunctualLight
from baker.trace.jit import kernel, larger


def directional_light(
    light: PunctualLight,
    origin: NDArray[np.float32],
    normal: NDArray[np.float32],
    ray: NDArray[np.float32],
    weight: NDArray[np.float32],
) -> None:
    """Fill rays and weights of a directional light (see `FillRays`)."""
    _parallel(np.array(light.direction, np.float64), normal, ray, weight)


@kernel
def _parallel(direction, normal, ray, weight):  # type: ignore[no-untyped-def]
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


def _power(light: PunctualLight, disc: float) -> float:
    return disc


DIRECTIONAL = LIGHT_KINDS.register("directional")(
    LightKind(
        name="directional",
        unit="lx",
        delta=True,
        distribution=Distribution.PARALLEL,
        gltf_type="directional",
        # The sun at its highest gives 1.2e5 lx.
        plausible_max=2e5,
        fill=directional_light,
        power=_power,
    )
)
