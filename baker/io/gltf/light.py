"""Reads KHR_lights_punctual: lights without area, positioned by their nodes.

A light shines along the -Z axis of its node. Its intensity is in candela (point, spot) or lux (directional).
The scale of the node changes neither intensity nor range.

Based on: Khronos Group, KHR_lights_punctual.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import kinds_by_gltf_type
from baker.core.scene import PunctualLight, SceneWarning
from baker.io.gltf.json import JsonObject
from baker.io.gltf.node import Placed

# Length of the node's -Z axis in world space, divided by the largest singular value of the node's matrix.
# Spot and directional lights whose ratio does not exceed this number are left out. Their direction would
# consist of rounding errors, because exporters write single precision.
_FLATTEST = 1e-6
_TINY = float(np.finfo(np.float64).tiny)


def read_light(
    light: JsonObject, node: Placed, warnings: list[SceneWarning], *, lenient: bool = False
) -> PunctualLight | None:
    """Read a light.

    Parameters
    ----------
    light : JsonObject
        An entry of the extension's list of lights.
    node : Placed
        The node that refers to the light.
    warnings : list of SceneWarning
        A warning is added for a light that is left out.
    lenient : bool
        Accept negative colours and intensities.

    Returns
    -------
    PunctualLight or None
        The light in world space; None for a spot or directional light without a direction, see `_FLATTEST`.

    Raises
    ------
    InputError
        For an unknown kind, a negative colour or intensity, cone angles out of range, or a range not above 0.
    """
    known, wanted = kinds_by_gltf_type(), light.string("type")
    if wanted not in known:
        light.fail(f"'{wanted[:20]}' is none of {', '.join(known)}", "type")
    kind = known[wanted]
    name = node.json.string("name", light.string("name", f"light_{node.index}"))
    strength = light.number("intensity", 1.0, low=-math.inf if lenient else 0.0)
    colour = light.numbers("color", 3, (1.0, 1.0, 1.0))
    if min(colour) < 0 and not lenient:
        light.fail("a colour is negative", "color")
    fields = kind.read(light, node.matrix[:3, :3])
    axis, share = _axis(node)
    if kind.has_direction and not share > _FLATTEST:
        message = (
            f"the scale of the node or its parents leaves the {kind.name} light no direction: the axis it "
            f"shines along has {share:.1g} of the largest stretch; the light is left out"
        )
        warnings.append(SceneWarning("flat-light", message, name))
        return None
    x, y, z = (float(v) for v in axis)
    px, py, pz = (float(v) for v in node.matrix[:3, 3])
    return PunctualLight(
        kind=kind.name,
        name=name,
        node=node.index,
        intensity=(colour[0] * strength, colour[1] * strength, colour[2] * strength),
        position=(px, py, pz),
        direction=(x, y, z),
        **fields,
    )


def _axis(node: Placed) -> tuple[NDArray[np.float64], float]:
    """Return the node's unit -Z axis in world space, and its unnormalised length / largest singular value.

    If this ratio does not exceed `_FLATTEST`, the axis is (0, 0, -1).
    """
    linear = node.matrix[:3, :3]
    # Divide by the largest element, so that squares neither overflow nor underflow.
    linear = linear / max(float(np.abs(linear).max()), _TINY)
    axis = -linear[:, 2]
    length = float(np.linalg.norm(axis))
    stretch = float(np.linalg.norm(linear, ord=2))
    if not length > _FLATTEST * stretch:
        return np.array([0.0, 0.0, -1.0]), length / max(stretch, _TINY)
    return axis / length, length / stretch
