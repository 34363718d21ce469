"""A kind of light without area: one record that a file of `baker.lights.kinds` registers by name.

The record holds everything that differs between kinds: the unit, how glTF stores a light, the irradiance at
points for the bake, the emission for the path tracer, the power. The rest of the program calls the record and
compares no names. A light whose kind has no record is refused.

The bake and the path tracer share a light's parameters (`PunctualLight`) and no code: `fill` computes
irradiance in a kernel of the file; `emission` describes the light as an `EmissionProfile`, which the path
tracer evaluates and samples with its own kernels. A profile is data: a light added later needs no compilation
of the path tracer, and its fall-off may be any function of direction, as a table. Functions of each kind
called from the path kernels were the alternative; the loops over eight paths would no longer vectorize, and
each new kind would compile all path kernels again, about a minute.
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

# Longest name of a kind that an error quotes.
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
            With its position relative to the same origin as `origin`.
        origin, normal : (n, 16, 3) float32
            Points, metres, and unit normals, world.
        ray : (n, 16, 4) float32, output
            Direction to the light, of any length, and the distance at which the shadow ray ends, in units of
            that length: just before a light with a position, such as at 0.99999 of the way, and 1e30 for
            parallel light. Finite also for a point at the light.
        weight : (n, 16) float32, output
            Unoccluded irradiance, lx, for an intensity of 1; 0 below the horizon. A surface that faces the
            light gets 1 lx: from parallel light, or at 1 m on the axis.
        """


class LightJson(Protocol):
    """A light of KHR_lights_punctual, the argument of `read`: see `io.gltf.json.JsonObject`."""

    def __contains__(self, key: str) -> bool:
        """Return whether the member is there."""

    def number(self, key: str, default: float | None = None, *, low: float = ..., high: float = ...) -> float:
        """Return a finite number between `low` and `high`, or raise InputError."""

    def child_or_empty(self, key: str) -> LightJson:
        """Return the object under `key`, or an empty one."""

    def fail(self, message: str, key: str = "") -> NoReturn:
        """Raise InputError about the member `key`."""


class EmissionProfile(NamedTuple):
    """The emission of a light without area, as data that the path tracer evaluates and samples.

    With a position, the radiant intensity in unit direction w, and the irradiance of a surface that faces the
    light at distance r, are

        I(w) = intensity f(w)        E = I(w) / r^2 clamp(1 - (r / range)^4, 0, 1)

    with c = w . axis and f(w) one of

        1                                                       cone_scale and table None
        clamp((c - min_cosine) cone_scale, 0, 1)^2              cone_scale
        table, bilinear in c and the azimuth around the axis    table

    and f = 0 for c < min_cosine. Without a position the light is parallel: E = intensity.

    Attributes
    ----------
    position : tuple of 3 float, or None
        Metres; None for parallel light.
    axis : tuple of 3 float
        Unit direction in which the light shines, world.
    min_cosine : float
        Nothing is emitted at larger angles to the axis; paths that start at the light are uniform inside.
    cone_scale : float or None
        1 / (cosine of the inner angle - cosine of the outer angle) of glTF's spot.
    table : (n, m) float32, or None
        Values of f, n >= 2 of them from c = min_cosine to c = 1 in even steps of c, m >= 1 azimuths in even
        steps of 2 pi / m, the first one at `tangent`. One column: the same all around. Enough of them that
        linear interpolation is within 3e-5 of f, as the contract asks: n = 1024 for the eighth power of c.
    tangent : tuple of 3 float
        Unit, at right angles to the axis; azimuths increase from it towards axis x tangent.
    inverse_range : float
        1 / range^2, 1/m2; 0 without a range.
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
        As in `PunctualLight.kind` and in the manifest.
    unit : str
        Of its intensity: "cd" or "lx".
    has_position : bool
        Moving the light changes its irradiance.
    has_direction : bool
        Turning the light changes its irradiance: one whose node leaves it no direction is left out.
    gltf_type : str or None
        `type` in KHR_lights_punctual; None if glTF files cannot hold it.
    plausible_max : float
        Intensity above which the unit is probably wrong.
    read : callable
        Takes the light's JSON and the linear part, (3, 3) float64, of its node's world transform; returns
        fields of `PunctualLight` by name, except those that all kinds have: name, node, intensity, position
        and direction. Raises InputError.
    write : callable
        Returns the members of the light's JSON that `read` reads.
    describe : callable
        Returns position, direction and parameters of a light by name, for the manifest.
    fill : FillRays
        Irradiance at points, for the bake.
    emission : callable or None
        Returns the `EmissionProfile` of a light; None if there is none: the path tracer refuses such lights.
    power : callable
        Returns an upper bound of the flux, lm, of a light of intensity 1, from the light and the area, m2, of
        a disc as wide as the scene, which parallel light passes through. Paths choose lights in proportion.
    delta : bool
        Its light reaches a point from a single direction, so that no random ray hits it. The path tracer
        refuses other lights.
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
    """Return the record of a light's kind.

    Parameters
    ----------
    light : PunctualLight
        Its `kind` is looked up.

    Returns
    -------
    LightKind
        Registered by the file of that name.

    Raises
    ------
    InputError
        If no file of `baker.lights.kinds` describes such lights.
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
    """Return the kinds that glTF files can hold, by their `type` there.

    Returns
    -------
    dict of str to LightKind
        Kinds with `gltf_type` None are not in it.
    """
    kinds = [LIGHT_KINDS.get(name) for name in LIGHT_KINDS.names()]
    return {kind.gltf_type: kind for kind in kinds if kind is not None and kind.gltf_type is not None}


def light_positions(scene: Scene) -> NDArray[np.float64]:
    """Return the positions of all lights that have one.

    Parameters
    ----------
    scene : Scene
        All its lights are of known kinds.

    Returns
    -------
    (n, 3) float64
        Metres, world.
    """
    found = [light.position for light in scene.lights if kind_of(light).has_position]
    return np.array(found, np.float64).reshape(-1, 3)


def check_light_kinds(scene: Scene) -> None:
    """Refuse lights whose kind has no record.

    Parameters
    ----------
    scene : Scene
        Its lights are checked.

    Raises
    ------
    InputError
        Naming the scene's file and the light.
    """
    try:
        for light in scene.lights:
            kind_of(light)
    except InputError as error:
        error.file = str(scene.path) if scene.path else None
        raise
