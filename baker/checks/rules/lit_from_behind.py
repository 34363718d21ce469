"""Reports open one-sided surfaces whose back receives nearly all of the light."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.direct_light import side_light
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check
from baker.core.light_kind import kind_of
from baker.core.readable import percent

# An object is reported only if it has at least _FEWEST sample points, and if its front gets at most the share
# _FRONT of the light that arrives at its front and its back together.
_FEWEST, _FRONT = 8, 0.02


@check(
    "lit-from-behind",
    group="light",
    severity="warning",
    fix="flip its faces, or make its material double-sided, if it should show this light",
)
def lit_from_behind(context: CheckContext) -> Iterator[RawFinding]:
    """A one-sided object that gets at least 98 % of its direct light on its back.

    The back of a one-sided surface is black, so the object is dark although light arrives at it. Usually its
    faces are wound the wrong way. The direct light of emitters and of lights with a position is compared on
    both sides, at 2048 random points of the scene. Parallel light and the sky are ignored, because they reach
    the backs of the walls of every room from outside. Closed meshes are not reported here, but by the rule
    `inside-out`. An object is reported only if light arrives at the back at more than half of its points, and
    none of its points is on a double-sided face.
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
            text = f"{percent(share)} of the direct light that arrives at it hits its black back"
            yield RawFinding(
                text,
                Location(instance.name, instance.node),
                int(mine.sum()),
                percent=100.0 * share,
                position=(x, y, z),
            )
