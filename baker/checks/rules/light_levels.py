"""Checks estimated direct irradiance at sample points (see `baker.checks.direct_light`), and emitters."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.direct_light import cosine_directions, points_inside
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check
from baker.core.encoding import ALWAYS_WRITTEN, ENCODINGS
from baker.core.readable import amount, number

# Number of rays from the fronts of the emitting faces of an object. If any of these faces is double-sided, as
# many rays are traced from the backs.
FACING_RAYS = 64


@check(
    "all-black",
    group="light",
    severity="warning",
    fix="look where the lights are and what is between them and the surfaces",
)
def all_black(context: CheckContext) -> Iterator[RawFinding]:
    """A scene with light that reaches none of 512 points on the surfaces."""
    levels = context.levels
    if levels is not None and not levels.irradiance.any():
        yield RawFinding(f"there is light, but none arrives at {len(levels.position)} points on the surfaces")


@check(
    "clips-half",
    group="light",
    severity="warning",
    fix="lower the lights, move them away from surfaces, or bake with `dtype='float'`",
)
def clips_half(context: CheckContext) -> Iterator[RawFinding]:
    """Direct light that is too bright for half floats, whose largest value is 65504.

    Direct irradiance exceeds 65504 lx at some of 512 points on the surfaces. The map stores 65504 there. The
    rule does not report anything with `dtype='float'`, because floats can store these values.
    """
    levels = context.levels
    if levels is None:
        return
    encoding = ENCODINGS.require(ALWAYS_WRITTEN, "encoding")
    highest = encoding.limits(encoding.options_of(context.settings))[1]
    over = np.flatnonzero(levels.irradiance > highest)
    if len(over):
        worst = over[levels.irradiance[over].argmax()]
        share = 100.0 * len(over) / len(levels.irradiance)
        x, y, z = (float(v) for v in levels.position[worst] + context.scene.origin)
        most = levels.irradiance[worst]
        text = f"about {number(share)}% of the surface gets more than {highest:g} lx, up to {amount(most)}"
        at = context.source.instances[context.world.instance[levels.triangle[worst]]]
        yield RawFinding(text, Location(at.name, at.node), len(over), percent=share, position=(x, y, z))


@check(
    "light-levels",
    group="light",
    severity="info",
    fix="nothing to do: this is what direct light will look like",
)
def light_levels(context: CheckContext) -> Iterator[RawFinding]:
    """The range of direct irradiance at 512 points on the surfaces, without reflected light."""
    levels = context.levels
    if levels is not None and levels.irradiance.any():
        low, middle, high = np.percentile(levels.irradiance, [0, 50, 100])
        dark = 100.0 * float((levels.irradiance == 0).mean())
        text = f"direct light is {amount(low)} to {amount(high)} lx, median {amount(middle)};"
        text += f" {number(dark)}% of the surface gets none"
        more = {"darkest": float(low), "median": float(middle), "brightest": float(high)}
        yield RawFinding(text, count=len(levels.position), percent=dark, more=more)


@check(
    "emitter-unseen",
    group="light",
    severity="warning",
    fix="turn the emitting faces towards the scene, or make their material double-sided",
)
def emitter_unseen(context: CheckContext) -> Iterator[RawFinding]:
    """An emissive object that faces away from all surfaces.

    None of 64 rays from the fronts of its emitting faces hits a surface, so it lights nothing. If any of
    these faces is double-sided, 64 rays from the backs are traced as well. One-sided surfaces emit only from
    their front. Scenes with a single object are not tested.
    """
    if not context.emits or len(context.source.instances) < 2:
        return
    world = context.world
    random = np.random.default_rng(context.settings.seed)
    emitters = np.unique(context.emission.triangle)
    for k in np.unique(world.instance[emitters]):
        own = emitters[world.instance[emitters] == k]
        share = np.cumsum(world.area[own])
        pick = (np.arange(FACING_RAYS) + 0.5) / FACING_RAYS * share[-1]
        chosen = own[np.minimum(np.searchsorted(share, pick), len(own) - 1)]
        sides = (1.0, -1.0) if world.double_sided[own].any() else (1.0,)
        met = False
        for side in sides:
            normal = side * world.normal[chosen]
            origin = world.lifted(points_inside(world, chosen, random), chosen, normal)
            direction = cosine_directions(normal, 1, random)
            hit, _ = world.first_hits(
                origin, direction, np.zeros(len(direction)), np.full(len(direction), 1e30)
            )
            met = met or bool((hit >= 0).any())
        if not met:
            instance = context.source.instances[k]
            x, y, z = world.middle_of(own[0])
            location = Location(instance.name, instance.node)
            yield RawFinding(
                "its emitting faces face away from everything", location, len(own), position=(x, y, z)
            )
