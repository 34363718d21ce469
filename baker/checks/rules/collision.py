"""Reports meshes that engines use only for collision, recognised by their names."""

from __future__ import annotations

import re
from collections.abc import Iterator

from baker.checks.context import CheckContext
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check

# Line 1: prefixes of Unreal and suffixes of Godot. Line 2: words at the end of a name, with or without a
# number.
_NAME = re.compile(
    r"^(ucx|ubx|usp|ucp|mcdcx)_|-(colonly|convcolonly|navmesh|occonly)\b"
    r"|(^|[_.\- ])(collision|collider|hitbox)([_.\- ]?\d*)$",
    re.IGNORECASE,
)


@check(
    "collision-hull",
    group="geometry",
    severity="warning",
    fix="leave it out with `exclude`, or rename it if it is to be seen",
    in_bake=True,
)
def collision_hull(context: CheckContext) -> Iterator[RawFinding]:
    """An object with the name of a collision hull.

    Engines do not show collision hulls. In a bake they block light like all other meshes, so surfaces inside
    them are black. A hull is recognised by the name of its node or mesh: Unreal's prefixes UCX_, UBX_, USP_,
    UCP_ and MCDCX_; Godot's suffixes -colonly, -convcolonly, -navmesh and -occonly; the words collision,
    collider and hitbox at the end, also with a number. Case is ignored.
    """
    for instance in context.source.instances:
        name = next(
            (n for n in (instance.name, context.source.meshes[instance.mesh].name) if _NAME.search(n)), None
        )
        if name is not None and len(context.meshes[instance.mesh].good):
            location = Location(instance.name, instance.node)
            yield RawFinding(
                f"'{name}' is named like a collision hull, but blocks light as any object", location
            )
