"""Point light: a point that emits I candela in all directions.

    E = I cos(theta) / r^2 * clamp(1 - (r / range)^4, 0, 1)        r: distance

Based on: KHR_lights_punctual, "Point" and "Range Property"; Lambert's cosine and inverse-square laws.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import LIGHT_KINDS, EmissionProfile, LightJson, LightKind
from baker.core.scene import PunctualLight


def read_range(light: LightJson) -> float:
    """Read `range` of a point or spot light in a glTF file.

    Parameters
    ----------
    light : LightJson
        The light in the file.

    Returns
    -------
    float
        Range in metres; inf if the light has none.

    Raises
    ------
    InputError
        If the range is not above 0.
    """
    found = light.number("range") if "range" in light else math.inf
    if not found > 0:
        light.fail(f"the light's range is {found:g}; it must be above 0, or left out for no limit", "range")
    return found


def finite_range(light: PunctualLight) -> dict[str, float]:
    """Return the JSON entry of a light's range, for glTF and `bake.json`.

    Parameters
    ----------
    light : PunctualLight
        A point or spot light.

    Returns
    -------
    dict of str to float
        {"range": metres}; empty if the range is infinite.
    """
    return {"range": light.range} if math.isfinite(light.range) else {}


def _read(light: LightJson, world_from_light: NDArray[np.float64]) -> dict[str, Any]:
    return {"range": read_range(light)}


def _write(light: PunctualLight) -> dict[str, Any]:
    return dict(finite_range(light))


def _describe(light: PunctualLight) -> dict[str, Any]:
    return {"position": light.position, **finite_range(light)}


def _fill(
    light: PunctualLight,
    origin: NDArray[np.float32],
    normal: NDArray[np.float32],
    ray: NDArray[np.float32],
    weight: NDArray[np.float32],
) -> None:
    from baker.lights.shadow_rays import fill_inverse_square

    position = np.array(light.position, np.float64)
    fill_inverse_square(position, light.inverse_range, origin, normal, ray, weight)


def _emission(light: PunctualLight) -> EmissionProfile:
    return EmissionProfile(light.position, light.direction, inverse_range=light.inverse_range)


def _power(light: PunctualLight, disc: float) -> float:
    return 4 * math.pi


POINT = LIGHT_KINDS.register("point")(
    LightKind(
        name="point",
        unit="cd",
        has_position=True,
        has_direction=False,
        gltf_type="point",
        plausible_max=1e6,
        read=_read,
        write=_write,
        describe=_describe,
        fill=_fill,
        emission=_emission,
        power=_power,
    )
)
