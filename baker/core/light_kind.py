"""What a kind of light without area is: one record, in a file of `baker.lights.families`, found by its name.

Whoever needs to know something about a light (its unit, whether it has a position, its irradiance at points)
asks the record and never compares names. A kind without a record is an error, so that no light is left out
without a word.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.light_limits import BRIGHTEST
from baker.core.registry import Registry
from baker.core.scene import PunctualLight, Scene


class Distribution(Enum):
    """How the emission of a light is distributed over directions."""

    # The same intensity in all directions, from a point.
    ISOTROPIC = "isotropic"
    # From a point, around an axis, between an inner and an outer angle.
    CONE = "cone"
    # One direction, from infinitely far away.
    PARALLEL = "parallel"


class FillRays(Protocol):
    """Computes, for points on surfaces, the rays towards a light and its unoccluded irradiance."""

    def __call__(
        self,
        light: PunctualLight,
        origin: NDArray[np.float32],
        normal: NDArray[np.float32],
        ray: NDArray[np.float32],
        weight: NDArray[np.float32],
    ) -> None:
        """Fill `ray` and `weight`.

        Parameters
        ----------
        light : PunctualLight
        origin, normal : (n, 16, 3) float32, metres and unit, world
        ray : (n, 16, 4) float32, output
            Direction to the light and the ray's reach in units of the direction's length.
        weight : (n, 16) float32, output
            Irradiance for an intensity of 1; 0 where the light cannot shine.
        """


@dataclass(frozen=True)
class LightKind:
    """A kind of light without area.

    Attributes
    ----------
    name : str
        As in `PunctualLight.kind` and in the manifest.
    unit : str
        Of its intensity: "cd" or "lx".
    delta : bool
        Its light reaches a point from a single direction, so that no ray meets it by chance.
    distribution : Distribution
        Whether it has a position, a direction and cone angles follows from it.
    gltf_type : str or None
        `type` in KHR_lights_punctual; None if glTF files cannot hold it.
    plausible_max : float
        Intensity above which a wrong unit is likelier than such a light.
    fill : FillRays
        Irradiance at points.
    power : callable
        Returns an upper bound of the flux, lm, of a light of intensity 1, from the light and the area, m2, of
        a disc as wide as the scene, which parallel light passes through. Paths choose lights in proportion.
    """

    name: str
    unit: str
    delta: bool
    distribution: Distribution
    gltf_type: str | None
    plausible_max: float
    fill: FillRays
    power: Callable[[PunctualLight, float], float]

    @property
    def has_position(self) -> bool:
        """Tell whether its lights are somewhere, and may have a range."""
        return self.distribution is not Distribution.PARALLEL

    @property
    def has_direction(self) -> bool:
        """Tell whether turning its lights changes what they do."""
        return self.distribution is not Distribution.ISOTROPIC

    @property
    def has_cone(self) -> bool:
        """Tell whether its lights have an inner and an outer cone angle."""
        return self.distribution is Distribution.CONE


LIGHT_KINDS: Registry[LightKind] = Registry("baker.lights.families")


def kind_of(light: PunctualLight) -> LightKind:
    """Return the record of a light's kind.

    Raises
    ------
    InputError
        If no file of `baker.lights.families` describes such lights.
    """
    kind = LIGHT_KINDS.get(light.kind)
    if kind is None:
        message = f"'{light.kind[:20]}' is no known kind of light; known are {', '.join(LIGHT_KINDS.names())}"
        raise InputError(message, object=f"light '{light.name}'")
    return kind


def kinds_by_gltf_type() -> dict[str, LightKind]:
    """Return the kinds that glTF files can hold, by their `type` there."""
    kinds = [LIGHT_KINDS.get(name) for name in LIGHT_KINDS.names()]
    return {kind.gltf_type: kind for kind in kinds if kind is not None and kind.gltf_type is not None}


def light_positions(scene: Scene) -> NDArray[np.float64]:
    """Return the positions of all lights that have one, (n, 3) float64, metres, world."""
    places = [light.position for light in scene.lights if kind_of(light).has_position]
    return np.array(places, np.float64).reshape(-1, 3)


def check_light_kinds(scene: Scene) -> None:
    """Refuse lights of a kind that nothing here describes.

    Raises
    ------
    InputError
    """
    try:
        for light in scene.lights:
            kind_of(light)
    except InputError as error:
        error.file = str(scene.path) if scene.path else None
        raise


def check_lights(scene: Scene) -> None:
    """Refuse lights of an unknown kind, and lights too bright to compute with.

    Raises
    ------
    InputError
        If no record describes a light, or an emission or an intensity is above `BRIGHTEST`.
    """
    check_light_kinds(scene)
    named = [(f"material '{m.name}'", "emission", m.emission, "cd/m2") for m in scene.materials]
    named += [
        (f"light '{light.name}'", "intensity", light.intensity, kind_of(light).unit) for light in scene.lights
    ]
    for name, what, value, unit in named:
        if max(value) > BRIGHTEST:
            message = f"{name}: its {what} of {max(value):.3g} {unit} is above {BRIGHTEST:.0e}; lower it"
            raise InputError(message, file=str(scene.path) if scene.path else None, object=name)
