"""Directional light: parallel light, such as sunlight, that causes E_light lux on a perpendicular surface.

    E = E_light cos(theta)

Based on: KHR_lights_punctual, "Directional".
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import LIGHT_KINDS, EmissionProfile, LightJson, LightKind
from baker.core.scene import PunctualLight


def _read(light: LightJson, world_from_light: NDArray[np.float64]) -> dict[str, Any]:
    return {}


def _write(light: PunctualLight) -> dict[str, Any]:
    return {}


def _describe(light: PunctualLight) -> dict[str, Any]:
    return {"direction": light.direction}


def _fill(
    light: PunctualLight,
    origin: NDArray[np.float32],
    normal: NDArray[np.float32],
    ray: NDArray[np.float32],
    weight: NDArray[np.float32],
) -> None:
    from baker.lights.shadow_rays import fill_parallel

    fill_parallel(np.array(light.direction, np.float64), normal, ray, weight)


def _emission(light: PunctualLight) -> EmissionProfile:
    return EmissionProfile(position=None, axis=light.direction)


def _power(light: PunctualLight, disc: float) -> float:
    return disc


DIRECTIONAL = LIGHT_KINDS.register("directional")(
    LightKind(
        name="directional",
        unit="lx",
        has_position=False,
        has_direction=True,
        gltf_type="directional",
        # Direct sunlight is at most about 1.2e5 lx.
        plausible_max=2e5,
        read=_read,
        write=_write,
        describe=_describe,
        fill=_fill,
        emission=_emission,
        power=_power,
    )
)
