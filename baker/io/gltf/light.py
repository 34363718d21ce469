"""Reads KHR_lights_punctual: point, spot and directional lights placed by their nodes.

A light shines along its node's -Z; intensity is in cd (point, spot) or lx (directional); the node's scale
changes neither.

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

# Length of the light's axis, as a share of the node's largest stretch, below which rounding aims the light:
# exporters write single precision.
_FLATTEST = 1e-6
_TINY = float(np.finfo(np.float64).tiny)


def read_light(
    light: JsonObject, node: Placed, warnings: list[SceneWarning], *, lenient: bool = False
) -> PunctualLight | None:
    """Return a light in world space, or None with a warning if its node leaves it no direction.

    Parameters
    ----------
    lenient : bool
        Let negative colours and intensities pass.

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
    """Return where the node's -Z points, unit, and its length as a share of the node's largest stretch."""
    linear = node.matrix[:3, :3]
    # Scaled first: the squares of very small or large numbers are not numbers.
    linear = linear / max(float(np.abs(linear).max()), _TINY)
    axis = -linear[:, 2]
    length = float(np.linalg.norm(axis))
    stretch = float(np.linalg.norm(linear, ord=2))
    if not length > _FLATTEST * stretch:
        return np.array([0.0, 0.0, -1.0]), length / max(stretch, _TINY)
    return axis / length, length / stretch
