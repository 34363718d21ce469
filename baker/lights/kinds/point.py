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
from baker.trace.jit import inner, kernel, larger

# TFAR of shadow rays, as a share of the distance to the light: the rays end just before the light.
_SHORT = np.float32(0.99999)


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
    position = np.array(light.position, np.float64)
    fill_inverse_square(position, light.inverse_range, origin, normal, ray, weight)


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
