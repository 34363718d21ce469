"""Refuses lights and materials whose intensity or emission is too large for a bake."""

from __future__ import annotations

from baker.core.errors import InputError
from baker.core.light_kind import check_light_kinds, kind_of
from baker.core.scene import Scene

# Largest component of an intensity (cd or lx) and of an emission (cd/m2) that a bake accepts. Up to this
# limit, the square of the irradiance fits into float32, except within about 7 mm of a light with a position
# whose intensity is at the limit. For comparison, the disc of the sun has 2e9 cd/m2.
BRIGHTEST = 1e15


def check_brightness(scene: Scene) -> None:
    """Raise an error for lights of an unregistered kind, and for lights and materials above `BRIGHTEST`.

    Parameters
    ----------
    scene : Scene
        Its lights and materials are checked.

    Raises
    ------
    InputError
        If a light's kind is not registered, or a component of an intensity or emission is above `BRIGHTEST`.
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
