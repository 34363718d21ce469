"""Checks lights, emissive surfaces and albedo."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check
from baker.core.colour import linear_from_srgb
from baker.core.light_kind import kind_of, light_positions
from baker.core.readable import amount
from baker.topology.winding_number import first_inside

# Albedo above which a material is reported.
MOST_REFLECTED = 0.95
# Albedo above which paths are traced to find trapped light.
NEARLY_WHITE = 0.98
# Radiance of a material above which its unit is probably wrong, cd/m2. The limit for the intensity of lights
# without area is `LightKind.plausible_max`.
ABSURD_EMISSION = 1e8
# y component of the unit normal above which a face counts as a floor.
FLOOR = 0.5


@check(
    "no-light",
    group="light",
    severity="warning",
    fix="add a light or an emissive material, or bake with `sky`; for AO alone use `channels='ao'`",
)
def no_light(context: CheckContext) -> Iterator[RawFinding]:
    """A scene without any light, emissive surface or sky.

    A bake then writes ambient occlusion only. If `channels` names channels of light, their maps are black.
    """
    if context.bakes_light and not context.lit and not context.emits:
        given = context.settings.is_given("channels")
        effect = "the maps of light will be black" if given else "a bake writes ambient occlusion only"
        yield RawFinding(f"nothing emits light: {effect}")


@check(
    "flat-light",
    group="light",
    severity="warning",
    fix="give the light's node and its parents a scale other than zero; a bake leaves the light out",
)
def flat_light(context: CheckContext) -> Iterator[RawFinding]:
    """Spot and directional lights whose direction is undefined, because a node has a scale of zero.

    The light's node or a parent scales the axis of the light by practically zero. The transformed direction
    is then zero or consists of rounding errors. Point lights have no direction, so they are not affected.
    """
    for warning in context.scene.warnings:
        if warning.code == "flat-light":
            yield RawFinding(warning.message, Location(warning.object))


@check(
    "light-range",
    group="light",
    severity="info",
    fix="raise or remove the range, if surfaces farther away are to be lit",
)
def light_range(context: CheckContext) -> Iterator[RawFinding]:
    """Lights whose `range` is smaller than the distance to the farthest corner of the scene.

    Light fades to zero at the range, as KHR_lights_punctual specifies. Engines may use another falloff or
    ignore the range. One finding counts all such lights and describes the light with the smallest range.
    """
    lights = [
        light for light in context.scene.lights if math.isfinite(light.range) and max(light.intensity) > 0
    ]
    if not lights:
        return
    low, high = context.box
    position = np.array([light.position for light in lights])
    farthest = np.linalg.norm(np.maximum(np.abs(position - low), np.abs(position - high)), axis=1)
    ends = [k for k, light in enumerate(lights) if light.range < farthest[k]]
    if ends:
        k = min(ends, key=lambda k: lights[k].range)
        light = lights[k]
        text = (
            f"the {light.kind} light ends at its range of {amount(light.range)} m; the scene reaches "
            f"{amount(farthest[k])} m from it, and what lies beyond the range gets none of its light"
        )
        text += f" (so do {len(ends) - 1} further lights with ranges of their own)" if len(ends) > 1 else ""
        yield RawFinding(text, Location(light.name, light.node), count=len(ends), position=light.position)


@check(
    "light-inside",
    group="light",
    severity="warning",
    fix="move the light out of the geometry, or make the shade emissive or see-through",
)
def light_inside(context: CheckContext) -> Iterator[RawFinding]:
    """A light inside a closed solid, such as a light inside the mesh of its bulb.

    Every surface blocks light from both sides, so no light leaves the solid. Closed parts whose fronts point
    inwards are rooms, and are not reported. Parts with a material that may let light pass (MASK, BLEND) are
    not reported either.
    """
    solids = None
    for light in context.scene.lights:
        if not kind_of(light).has_position:
            continue
        solids = list(_solids(context)) if solids is None else solids
        for name, corner in solids:
            if first_inside(corner, np.array([light.position])) is not None:
                location = Location(light.name, light.node)
                text = f"the {light.kind} light is inside the closed surface of '{name}'"
                yield RawFinding(text, location, position=light.position)
                break


def _solids(context: CheckContext) -> Iterator[tuple[str, NDArray[np.float64]]]:
    """Yield the instance name and the face corners (n, 3, 3), metres, world, of each opaque closed part.

    Parts whose fronts point inwards, and instances whose bounding box contains no light, are left out.
    """
    materials = context.scene.materials
    opaque = np.array([material.alpha_mode == "OPAQUE" for material in materials], bool)
    position = light_positions(context.scene)
    for instance in context.source.instances:
        facts = context.meshes[instance.mesh]
        if not len(facts.good):
            continue
        matrix = instance.world_from_object
        inverse = np.linalg.pinv(matrix)
        local = position @ inverse[:3, :3].T + inverse[:3, 3]
        low, high = facts.bounds
        if not ((local > low) & (local < high)).all(axis=1).any():
            continue
        for piece in np.flatnonzero(facts.closed & (facts.volume > 0)):
            rows = facts.sheet[facts.piece == piece]
            if opaque[facts.material[facts.good[rows]]].all():
                yield instance.name, facts.corner[rows] @ matrix[:3, :3].T + matrix[:3, 3]


@check(
    "light-intensity",
    group="light",
    severity="warning",
    fix="set the intensity in cd (lights with a position), lx (parallel light) or cd/m2 (emission)",
)
def light_intensity(context: CheckContext) -> Iterator[RawFinding]:
    """Lights with a negative, zero or implausibly high intensity, and surfaces with implausible emission.

    A negative intensity is an error, because a bake refuses it. The highest plausible numbers are 1e6 cd for
    point lights, 1e7 cd for spot lights, 2e5 lx for directional lights (the sun gives 1.2e5 lx) and 1e8 cd/m2
    for surfaces. Higher numbers are often watts or lumens that were exported as candela. Some exporters
    multiply watts by 683 lm/W. Blender does so in the lighting mode Standard, and exports the numbers
    unchanged in the mode Unitless.
    """
    for light in context.scene.lights:
        location = Location(light.name, light.node)
        kind = kind_of(light)
        at, unit = light.position if kind.has_position else None, kind.unit
        if min(light.intensity) < 0:
            yield RawFinding(f"the {light.kind} light is negative", location, position=at, severity="error")
        elif max(light.intensity) == 0:
            yield RawFinding(f"the {light.kind} light has no intensity", location, position=at)
        elif max(light.intensity) > kind.plausible_max:
            most = max(light.intensity)
            text = f"the {light.kind} light has {amount(most)} {unit}; if watts were multiplied by 683 lm/W "
            text += f"(Blender's lighting mode Standard), export it as Unitless: {amount(most / 683)} {unit}"
            yield RawFinding(text, location, position=at)
    for k in context.used_materials:
        material = context.scene.materials[k]
        if max(material.emission) > ABSURD_EMISSION:
            yield RawFinding(
                f"the material emits {amount(max(material.emission))} cd/m2", Location(material.name)
            )


@check(
    "albedo",
    group="light",
    severity="warning",
    fix="lower the base colour to 0.9 or less: fresh snow has 0.9, white paint 0.8",
)
def albedo(context: CheckContext) -> Iterator[RawFinding]:
    """Materials that reflect more than 95 % of the light.

    No natural material reflects as much. Light decays very slowly between such surfaces, and closed rooms
    with such surfaces become extremely bright. A glTF material without a base colour is white: its albedo is
    1. If an albedo exceeds 0.98, paths of 20 reflections measure the factor by which all reflections together
    multiply the light. This factor is reported if it exceeds 20. A bake warns of it as well.
    """
    gain = None
    reflected = albedos(context)
    for k in context.used_materials:
        material, value = context.scene.materials[k], float(reflected[k])
        if value > MOST_REFLECTED:
            mesh = context.mesh_with[k]
            what = f"material '{material.name}'" if material.name else "the default material"
            text = f"{what} has an albedo of {amount(value)}"
            if value > NEARLY_WHITE:
                from baker.checks.trapped_light import MOST_GAIN, trapped_gain

                gain = trapped_gain(context, reflected) if gain is None else gain
                if gain > MOST_GAIN:
                    text += f": all bounces together multiply light by about {amount(gain)}"
            yield RawFinding(text, context.location(mesh), more={"material": k})


def albedos(context: CheckContext) -> NDArray[np.float64]:
    """Return the albedo of each material, (M,) float64: its largest colour component, 0 if it is not used.

    The albedo is estimated as base colour factor times brightest vertex colour component. If this product
    exceeds `MOST_REFLECTED` and the material has a texture, the factor is multiplied by the mean texture
    colour.
    """
    out = np.zeros(len(context.scene.materials))
    brightest = _brightest_vertex_colours(context)
    for k in context.used_materials:
        material = context.scene.materials[k]
        painted = brightest.get(k, 1.0)
        out[k] = max(material.base_colour[:3]) * painted
        if material.base_colour_texture is not None and out[k] > MOST_REFLECTED:
            mean = image_mean(material.base_colour_texture.image)
            out[k] = max(a * b for a, b in zip(material.base_colour[:3], mean, strict=True)) * painted
    return out


def _brightest_vertex_colours(context: CheckContext) -> dict[int, float]:
    """Return, by material index, the largest vertex colour component of primitives with this material.

    It is 1 for a material with a primitive without vertex colours. Primitives without good faces are ignored.
    """
    brightest: dict[int, float] = {}
    uncoloured: set[int] = set()
    for facts in context.meshes:
        for k in np.unique(facts.primitive[facts.good]).tolist():
            primitive = facts.source.primitives[k]
            material = primitive.material
            if primitive.colour is None:
                uncoloured.add(material)
            elif material not in uncoloured:
                value = float(np.nan_to_num(primitive.colour[:, :3], nan=1.0).max(initial=0.0))
                brightest[material] = max(brightest.get(material, 0.0), value)
    return {**brightest, **dict.fromkeys(uncoloured, 1.0)}


def image_mean(image: NDArray[np.generic]) -> NDArray[np.float64]:
    """Return the mean linear colour of an image, (3,) float64. uint8 images are decoded from sRGB."""
    if image.dtype != np.uint8:
        return np.asarray(image[..., :3].reshape(-1, 3).mean(axis=0), np.float64)
    table = linear_from_srgb(np.arange(256, dtype=np.float64) / 255.0)
    counts = [np.bincount(image[..., c].reshape(-1), minlength=256) for c in range(3)]
    return np.array([count @ table / count.sum() for count in counts])


@check(
    "emissive-black",
    group="light",
    severity="warning",
    fix="paint the emissive texture, or give the material an emissiveFactor",
)
def emissive_black(context: CheckContext) -> Iterator[RawFinding]:
    """Materials with an emissive texture that emit nothing.

    The emissive texture is black on all surfaces that use the material, or the texture is not black but the
    emissive factor is zero.
    """
    for k in context.used_materials:
        material = context.scene.materials[k]
        if material.emission_texture is None:
            continue
        image = material.emission_texture.image
        if max(material.emission) > 0 and not image[..., :3].any():
            text = f"the emissive texture of material '{material.name}' is all black"
            yield RawFinding(text, Location(material.name))
        elif not max(material.emission) > 0 and image[..., :3].any():
            text = f"material '{material.name}' has an emissive texture, but its emissiveFactor is zero"
            yield RawFinding(text, Location(material.name), severity="info")
        elif max(material.emission) > 0 and k not in context.world.material[context.emission.triangle]:
            text = f"all surfaces of material '{material.name}' lie where its emissive texture is black"
            yield RawFinding(text, Location(material.name))


@check(
    "sun-below",
    group="light",
    severity="warning",
    fix="turn the light: it shines along its node's -Z",
)
def sun_below(context: CheckContext) -> Iterator[RawFinding]:
    """A directional light that comes from below every floor of the scene.

    Floors are faces whose normal has a y component above 0.5. Scenes without floors are not tested.
    """
    for light in context.scene.lights:
        if kind_of(light).has_position or not max(light.intensity) > 0:
            continue
        world = context.world
        floor = world.normal[:, 1] > FLOOR
        lit = world.normal @ -np.array(light.direction) > 1e-6
        if floor.any() and not (floor & lit).any():
            yield RawFinding("the sun shines from below every floor", Location(light.name, light.node))
