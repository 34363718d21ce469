"""Reports lights with a position that light a scene like daylight."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check
from baker.core.light_kind import kind_of
from baker.core.readable import number

# Median of the direct irradiance from lights at sample points above which the lights are reported, lx.
# Offices have 500 lx, an overcast day has 10 000 lx.
DAYLIGHT = 10_000.0
# Luminous efficacy with which exporters convert watts to lumens, lm/W.
EFFICACY = 683.0


@check(
    "daylight-levels",
    group="light",
    severity="warning",
    fix="divide the lights by 683 (Blender's glTF export: lighting mode Unitless), or lower them",
)
def daylight_levels(context: CheckContext) -> Iterator[RawFinding]:
    """Point and spot lights that give more than 10 000 lx at half of the surface, as daylight does.

    Offices have 500 lx. Blender's lighting mode Standard multiplies watts by 683 lm/W, the efficacy of a
    perfectly efficient green light. Real lights have 10 to 200 lm/W, so the converted lights are 3 to 70
    times too bright. Scenes with sun or sky are left out. The irradiance is direct and does not include the
    light of emissive surfaces.
    """
    lights = [light for light in context.scene.local_lights if max(light.intensity) > 0]
    placed = [light for light in lights if kind_of(light).has_position]
    levels = context.levels
    if not placed or len(placed) < len(lights) or any(context.settings.sky_radiance) or levels is None:
        return
    middle = float(np.median(levels.from_lights))
    if middle > DAYLIGHT:
        most = max(placed, key=lambda light: max(light.intensity))
        value = max(most.intensity)
        text = (
            f"half of the surface gets more than {number(middle)} lx from lights, as in daylight, and"
            f" {number(middle / EFFICACY)} lx after division by 683 lm/W; '{most.name}' has"
            f" {number(value)} cd, which is {number(value * 4 * math.pi / EFFICACY)} W x 683 / (4 pi)"
        )
        yield RawFinding(text, Location(most.name, most.node), len(placed), position=most.position)
