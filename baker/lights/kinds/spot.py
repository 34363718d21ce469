"""Spot light: a point light of I candela whose intensity falls off between an inner and an outer cone.

    E = I cos(theta) / r^2 * clamp((cos a - cos outer) / max(cos inner - cos outer, 0.001), 0, 1)^2
        * clamp(1 - (r / range)^4, 0, 1)

r is the distance, and a the angle between the spot's axis and the direction from the light to the point.

Based on: KHR_lights_punctual, "Inner and Outer Cone Angles" and "Range Property".
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import LIGHT_KINDS, EmissionProfile, LightJson, LightKind
from baker.core.scene import PunctualLight
from baker.lights.kinds.point import finite_range, read_range


def _read(light: LightJson, world_from_light: NDArray[np.float64]) -> dict[str, Any]:
    fields: dict[str, Any] = {"range": read_range(light)}
    spot = light.child_or_empty("spot")
    # Accept slightly more than pi / 2, because exporters write pi / 2 rounded to single precision.
    outer = spot.number("outerConeAngle", math.pi / 4, low=0.0, high=math.pi / 2 + 1e-3)
    inner = spot.number("innerConeAngle", 0.0, low=0.0)
    if inner > outer * (1 + 1e-6):
        spot.fail(f"the inner angle {inner:g} is larger than the outer angle {outer:g}", "innerConeAngle")
    return fields | {"inner_cone": min(inner, outer), "outer_cone": min(outer, math.pi / 2)}


def _write(light: PunctualLight) -> dict[str, Any]:
    cone = {"innerConeAngle": light.inner_cone, "outerConeAngle": light.outer_cone}
    return {**finite_range(light), "spot": cone}


def _describe(light: PunctualLight) -> dict[str, Any]:
    return {
        "position": light.position,
        **finite_range(light),
        "direction": light.direction,
        "inner_cone": light.inner_cone,
        "outer_cone": light.outer_cone,
    }


def _cone_scale(light: PunctualLight) -> float:
    """Return 1 / (cos inner - cos outer), limited to 1000."""
    return 1.0 / max(0.001, math.cos(light.inner_cone) - math.cos(light.outer_cone))


def _fill(
    light: PunctualLight,
    origin: NDArray[np.float32],
    normal: NDArray[np.float32],
    ray: NDArray[np.float32],
    weight: NDArray[np.float32],
) -> None:
    from baker.lights.shadow_rays import fill_inverse_square, multiply_by_cone

    position = np.array(light.position, np.float64)
    fill_inverse_square(position, light.inverse_range, origin, normal, ray, weight)
    direction = np.array(light.direction, np.float64)
    multiply_by_cone(direction, math.cos(light.outer_cone), _cone_scale(light), ray, weight)


def _emission(light: PunctualLight) -> EmissionProfile:
    return EmissionProfile(
        light.position,
        light.direction,
        min_cosine=math.cos(light.outer_cone),
        cone_scale=_cone_scale(light),
        inverse_range=light.inverse_range,
    )


def _power(light: PunctualLight, disc: float) -> float:
    return 2 * math.pi * (1 - math.cos(light.outer_cone))


SPOT = LIGHT_KINDS.register("spot")(
    LightKind(
        name="spot",
        unit="cd",
        has_position=True,
        has_direction=True,
        gltf_type="spot",
        plausible_max=1e7,
        read=_read,
        write=_write,
        describe=_describe,
        fill=_fill,
        emission=_emission,
        power=_power,
    )
)
