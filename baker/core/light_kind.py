"""Defines the interface of kinds of lights without area; each file of `baker.lights.kinds` registers one.

A `LightKind` contains everything that differs between kinds: the unit, the glTF representation, the
irradiance at points for the bake, the emission for the path tracer, and the power. Other code reads the
`LightKind` of a light and never compares names of kinds. A light of an unregistered kind is refused.

The bake calls `fill`, which writes shadow rays and the unoccluded irradiance. The path tracer calls
`emission`, which returns an `EmissionProfile`, and evaluates and samples the profile in its own kernels. A
profile is data, so the kernels of the path tracer are the same for all kinds. The angular fall-off may be any
function, given as a table. If these kernels called a function of each kind instead, their loops over eight
paths would not vectorize, and each new kind would compile them again, which takes about a minute.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn, Protocol

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import InputError
from baker.core.names import unknown_name
from baker.core.registry import Registry
from baker.core.scene import PunctualLight, Scene

# Largest number of characters of an unknown kind's name that an error quotes.
_QUOTED = 20

Vector = tuple[float, float, float]


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
            Its position is relative to `Scene.origin`, as are the points.
        origin, normal : (n, 16, 3) float32
            The 16 points of n texels, metres, and their unit normals, world.
        ray : (n, 16, 4) float32, output
            Columns 0 to 2: direction to the light, of any length. Column 3: length of the shadow ray, as a
            multiple of the direction's length. For a light with a position, the shadow ray must end just
            before the light. For example, if the direction is the vector to the light, column 3 is 0.99999.
            For parallel light, column 3 is 1e30. All values are finite, even for a point at the light.
        weight : (n, 16) float32, output
            Unoccluded irradiance, lx, for an intensity of 1; 0 if the light is below the horizon. A surface
            that faces parallel light has 1 lx. A surface that faces a point light without a range at a
            distance of 1 m has 1 lx as well.
        """


class LightJson(Protocol):
    """The JSON object of a light in KHR_lights_punctual, the argument of `read`.

    `baker.io.gltf.json.JsonObject` implements this interface.
    """

    def __contains__(self, key: str) -> bool:
        """Return whether the object has the member `key`."""

    def number(self, key: str, default: float | None = None, *, low: float = ..., high: float = ...) -> float:
        """Return the member `key`, or `default` if it is missing.

        Raises InputError if the member is missing and there is no default, or if it is not a finite number
        from `low` to `high`.
        """

    def child_or_empty(self, key: str) -> LightJson:
        """Return the object that is the member `key`, or an empty object if there is none."""

    def fail(self, message: str, key: str = "") -> NoReturn:
        """Raise InputError about the member `key`."""


class EmissionProfile(NamedTuple):
    """The emission of a light without area, as data that the path tracer evaluates and samples.

    A light with a position has the intensity I(w) in the unit direction w from the light. A surface that
    faces the light at distance r has the irradiance E, with

        I(w) = intensity f(w)        E = clamp(1 - (r / range)^4, 0, 1) I(w) / r^2

    The fall-off f depends on c = w . axis. If both `cone_scale` and `table` are None, f(w) = 1 for all w, and
    `min_cosine` is ignored. Otherwise f(w) = 0 for c < min_cosine, and for c >= min_cosine

        f(w) = clamp((c - min_cosine) cone_scale, 0, 1)^2       if `cone_scale` is set
        f(w) = bilinear lookup of (c, azimuth around the axis)  if `table` is set

    A light without a position is parallel, and a surface that faces it has E = intensity.

    Attributes
    ----------
    position : tuple of 3 float, or None
        Position of the light, metres; None for parallel light.
    axis : tuple of 3 float
        Unit direction in which the light shines, world.
    min_cosine : float
        Smallest cosine of the angle to the axis at which the light emits.
    cone_scale : float or None
        1 / (cosine of the inner angle - cosine of the outer angle), as for spot lights of glTF.
    table : (n, m) float32, or None
        Values of f at n >= 2 equidistant values of c from `min_cosine` to 1, and at m >= 1 azimuths
        2 pi k / m, k = 0 to m - 1. With m = 1, f does not depend on the azimuth. n and m must be so large
        that the error of the interpolation is at most 3e-5. For example, f = c^8 with `min_cosine` = -1 needs
        about n = 1000.
    tangent : tuple of 3 float
        Unit direction of azimuth 0, perpendicular to the axis. Azimuths increase from it towards
        axis x tangent.
    inverse_range : float
        1 / range^2, in 1 / m^2; 0 without a range.
    """

    position: Vector | None
    axis: Vector
    min_cosine: float = -1.0
    cone_scale: float | None = None
    table: NDArray[np.float32] | None = None
    tangent: Vector = (0.0, 0.0, 0.0)
    inverse_range: float = 0.0


@dataclass(frozen=True)
class LightKind:
    """A kind of light without area.

    Attributes
    ----------
    name : str
        Name of the kind in `PunctualLight.kind` and in the manifest.
    unit : str
        Unit of the intensity: "cd" or "lx".
    has_position : bool
        Whether the irradiance depends on the light's position.
    has_direction : bool
        Whether the irradiance depends on the light's direction. If so, a light is left out if its node's
        transform makes the direction undefined.
    gltf_type : str or None
        `type` in KHR_lights_punctual; None if glTF files cannot contain such lights.
    plausible_max : float
        Largest intensity that is plausible, in `unit`. Above it, the file probably uses another unit.
    read : callable
        read(json, linear) takes the light's JSON, and the linear part, (3, 3) float64, of its node's world
        transform. It returns fields of `PunctualLight` by name, without those that the importer sets: name,
        node, intensity, position and direction. It raises InputError for invalid members.
    write : callable
        write(light) returns the members of the light's JSON that `read` reads.
    describe : callable
        describe(light) returns position, direction and parameters by name, for the manifest.
    fill : FillRays
        Computes shadow rays and unoccluded irradiance at points, for the bake.
    emission : callable or None
        emission(light) returns its `EmissionProfile`. If `emission` is None, the path tracer refuses lights
        of this kind.
    power : callable
        power(light, disc) returns an upper bound of the flux, lm, of the light at intensity 1. For parallel
        light, this is the flux through a disc of area `disc`, m2, whose diameter is the diagonal of the
        scene. The probability with which a path chooses a light depends on power, see
        `baker.pathtracer.light_table`.
    delta : bool
        Whether the light reaches each point from a single direction, so that no random ray hits it. If it is
        False, the path tracer refuses lights of this kind.
    """

    name: str
    unit: str
    has_position: bool
    has_direction: bool
    gltf_type: str | None
    plausible_max: float
    read: Callable[[LightJson, NDArray[np.float64]], Mapping[str, Any]]
    write: Callable[[PunctualLight], dict[str, Any]]
    describe: Callable[[PunctualLight], dict[str, Any]]
    fill: FillRays
    emission: Callable[[PunctualLight], EmissionProfile] | None
    power: Callable[[PunctualLight, float], float]
    delta: bool = True


LIGHT_KINDS: Registry[LightKind] = Registry("baker.lights.kinds")


def kind_of(light: PunctualLight) -> LightKind:
    """Return the `LightKind` of a light.

    Parameters
    ----------
    light : PunctualLight
        Its `kind` is looked up.

    Returns
    -------
    LightKind
        The kind that is registered under that name.

    Raises
    ------
    InputError
        If no file of `baker.lights.kinds` registers that kind.
    """
    kind = LIGHT_KINDS.get(light.kind)
    if kind is None:
        raise unknown_name(
            "kind of light",
            light.kind[:_QUOTED],
            LIGHT_KINDS.names(),
            object=f"light '{light.name}'",
            error=InputError,
        )
    return kind


def kinds_by_gltf_type() -> dict[str, LightKind]:
    """Return the kinds of light that glTF files can contain.

    Returns
    -------
    dict of str to LightKind
        Kinds by `gltf_type`, without those whose `gltf_type` is None.
    """
    kinds = [LIGHT_KINDS.get(name) for name in LIGHT_KINDS.names()]
    return {kind.gltf_type: kind for kind in kinds if kind is not None and kind.gltf_type is not None}


def light_positions(scene: Scene) -> NDArray[np.float64]:
    """Return the positions of all lights whose kind has a position.

    Parameters
    ----------
    scene : Scene
        All its lights must be of registered kinds.

    Returns
    -------
    (n, 3) float64
        Metres, world.
    """
    found = [light.position for light in scene.lights if kind_of(light).has_position]
    return np.array(found, np.float64).reshape(-1, 3)


def check_light_kinds(scene: Scene) -> None:
    """Raise an error if the scene has a light of an unregistered kind.

    Parameters
    ----------
    scene : Scene
        Its lights are checked.

    Raises
    ------
    InputError
        For the first such light; the error has the scene's file and the light's name.
    """
    try:
        for light in scene.lights:
            kind_of(light)
    except InputError as error:
        error.file = str(scene.path) if scene.path else None
        raise
