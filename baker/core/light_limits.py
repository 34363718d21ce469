"""The largest intensity and emission that a bake computes with."""

from __future__ import annotations

from baker.core.errors import InputError
from baker.core.light_kind import check_light_kinds, kind_of
from baker.core.scene import Scene

# In cd, lx or cd/m2: the square of the light that it gives is a float32 number. The sun's disc has 2e9 cd/m2.
BRIGHTEST = 1e15


def check_brightness(scene: Scene) -> None:
    """Refuse lights of an unknown kind, and lights and materials too bright to compute with.

    Parameters
    ----------
    scene : Scene
        Its lights and materials are checked.

    Raises
    ------
    InputError
        If a light's kind has no record, or an intensity or an emission is above `BRIGHTEST`.
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
