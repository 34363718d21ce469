"""Checks the scales of nodes, the precision of positions, and the size of the scene."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from baker.checks.context import CheckContext
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check
from baker.checks.rules.cost import estimate_cost
from baker.core.precision import coarse_objects
from baker.core.readable import number

# Ratio of the smallest to the largest singular value of an instance's transform. Up to this ratio, a bake
# leaves the instance out.
FLATTEST = 1e-7
# Smallest and largest plausible diagonal of a scene, metres. Outside of this range the unit is probably
# wrong.
SMALLEST, LARGEST = 0.05, 5000.0


def _stretches(
    context: CheckContext,
) -> Iterator[tuple[Location, np.ndarray, float, tuple[float, float, float]]]:
    instances = context.source.instances
    # One call for all matrices: a call for each takes 0.1 ms.
    matrices = np.array([instance.world_from_object[:3, :3] for instance in instances]).reshape(-1, 3, 3)
    stretches, turns = np.linalg.svd(matrices, compute_uv=False), np.linalg.det(matrices)
    for instance, stretch, turn in zip(instances, stretches, turns.tolist(), strict=True):
        x, y, z = (float(v) for v in instance.world_from_object[:3, 3])
        location = Location(instance.name or context.source.meshes[instance.mesh].name, instance.node)
        yield location, stretch, turn, (x, y, z)


@check(
    "flat-instance",
    group="geometry",
    severity="warning",
    fix="give the node a scale other than zero, or delete it; a bake leaves it out",
)
def flat_instance(context: CheckContext) -> Iterator[RawFinding]:
    """Nodes with a mesh whose scale is zero along an axis, which flattens the object."""
    for location, stretch, _, at in _stretches(context):
        if not stretch[2] > FLATTEST * stretch[0]:
            yield RawFinding("the node's scale is zero along an axis", location, position=at)


@check(
    "negative-scale",
    group="geometry",
    severity="info",
    fix="apply the scale to the mesh and recalculate its normals, if an engine shows it inside out",
)
def negative_scale(context: CheckContext) -> Iterator[RawFinding]:
    """Nodes that mirror their mesh, by a negative scale.

    glTF reverses the winding of such meshes, and so does a bake. Some engines and exporters do not.
    """
    for location, stretch, turn, at in _stretches(context):
        if turn < 0 and stretch[2] > FLATTEST * stretch[0]:
            yield RawFinding("the node mirrors its mesh (negative scale)", location, position=at)


@check(
    "non-uniform-scale",
    group="geometry",
    severity="info",
    fix="apply the scale to the mesh, so that texels stay square in engines that share its lightmap UVs",
)
def non_uniform_scale(context: CheckContext) -> Iterator[RawFinding]:
    """Nodes whose largest scale exceeds their smallest scale by more than 1 %.

    A lightmap uv that was made for the mesh is stretched in world space. The unwrapper of a bake avoids this
    stretch, because it measures texel density in world space.
    """
    for location, stretch, _, at in _stretches(context):
        if stretch[2] > FLATTEST * stretch[0] and stretch[0] > 1.01 * stretch[2]:
            ratio = float(stretch[0] / stretch[2])
            yield RawFinding(
                f"the node stretches its mesh {number(ratio)} times more along one axis than along another",
                location,
                position=at,
            )


@check(
    "coarse-positions",
    group="geometry",
    severity="warning",
    fix="keep vertices near their own origin and far-apart places in scenes of their own",
)
def coarse_positions(context: CheckContext) -> Iterator[RawFinding]:
    """Objects whose float32 positions are spaced by more than a tenth of a texel.

    Files store vertices in single precision. 100 km from the origin of the mesh, neighbouring float32 numbers
    differ by 8 mm. Translations of nodes have no such rounding, so a level may be far from the world's origin
    if its nodes place it there. But a bake traces float32 positions relative to a point near most of the
    objects, so an object that is very far from the others is reported as well. A texel is assumed to have the
    mean size of all texels.
    """
    scene, world = context.scene, context.world
    area = float(world.area.sum())
    if not area > 0:
        return
    texels = estimate_cost(context).texels
    found = coarse_objects(scene, np.full(len(scene.instances), np.sqrt(area / max(texels, 1))))
    if found is not None:
        worst = scene.instances[found.worst]
        x, y, z = (float(v) for v in worst.world_from_object[:3, 3])
        text = f"{found.text}; {found.fix}"
        yield RawFinding(text, Location(worst.name, worst.node), count=found.count, position=(x, y, z))


@check(
    "scene-size",
    group="geometry",
    severity="warning",
    fix="export in metres (`scale` for formats without units)",
)
def scene_size(context: CheckContext) -> Iterator[RawFinding]:
    """A scene with a diagonal below 5 cm or above 5 km, which suggests a wrong unit.

    The unit of length must be metres: it determines the falloff of light, the maximum distance of ambient
    occlusion, and the texels per metre of `density`.
    """
    diagonal = context.diagonal
    if diagonal > 0 and not SMALLEST <= diagonal <= LARGEST:
        how = "small" if diagonal < SMALLEST else "large"
        yield RawFinding(
            f"the scene is {number(diagonal)} m from corner to corner: very {how}, likely a wrong unit"
        )
