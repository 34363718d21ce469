"""Reports open surfaces whose back receives the light."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.direct_light import side_light
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check
from baker.core.light_kind import kind_of
from baker.core.readable import percent

# Smallest number of sample points on a reported object, and the largest share of the light on its two sides
# that its front gets.
_FEWEST, _FRONT = 8, 0.02


@check(
    "lit-from-behind",
    group="light",
    severity="warning",
    fix="flip its faces, or make its material double-sided, if it should show this light",
)
def lit_from_behind(context: CheckContext) -> Iterator[RawFinding]:
    """A one-sided surface on whose front nearly none of the light arrives, and on whose back there is light.

    The back of a one-sided surface is black, so the object is dark although a light is next to it. Usually
    its faces are wound the wrong way. The direct light of lights with a position and of emitters is compared
    on both sides, at up to 2048 points of the scene. Closed meshes, sunlight and sky are left out: walls of a
    room have their back to the sun. `inside-out` finds closed meshes that are inverted.
    """
    world = context.world
    some = any(kind_of(light).has_position for light in context.scene.local_lights)
    if not context.bakes_light or not (some or context.emits) or not world.area.sum() > 0:
        return
    found = side_light(context.scene, world, context.emission, context.settings.seed)
    owner = world.instance[found.triangle]
    for k in np.unique(owner):
        instance = context.source.instances[k]
        mine = owner == k
        facts = context.meshes[instance.mesh]
        if mine.sum() < _FEWEST or facts.closed.all() or world.double_sided[found.triangle[mine]].any():
            continue
        front, back = float(found.front[mine].sum()), float(found.back[mine].sum())
        if back > 0 and front <= _FRONT * (front + back) and (found.back[mine] > 0).mean() > 0.5:
            x, y, z = world.middle_of(int(found.triangle[mine][0]))
            share = back / (front + back)
            text = f"{percent(share)} of the light of nearby lights arrives at its black back"
            yield RawFinding(
                text,
                Location(instance.name, instance.node),
                int(mine.sum()),
                percent=100.0 * share,
                position=(x, y, z),
            )
