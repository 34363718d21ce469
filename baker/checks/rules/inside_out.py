"""Rule about closed parts of meshes whose fronts point inwards although nothing is inside."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.mesh_facts import MeshFacts
from baker.checks.rule import check
from baker.checks.rules.bad_faces import faces_found
from baker.core.light_kind import light_positions
from baker.topology.winding_number import first_inside

# Largest value of |sum of area vectors| / total area for a closed mesh. It is 0 except for rounding.
_ROUNDING = 1e-4
# Share of a mesh's area. If the inside-out parts have less than this share, the finding is a warning.
MOST_WRONG = 0.05
# Number of points of each other part or object that are tested for being inside.
_WITNESSES = 8


@check(
    "inside-out",
    group="geometry",
    severity="error",
    fix="flip the normals of this part (`fix` does), or make the material double-sided",
    in_bake=True,
)
def inside_out(context: CheckContext) -> Iterator[RawFinding]:
    """A closed part whose fronts all point inwards, with nothing inside.

    From outside, such a part is black and absorbs all light. The fronts of rooms point inwards by design.
    Parts with a light, a camera or other geometry inside are therefore not reported. Parts that emit, the
    inner surfaces of shells, and double-sided surfaces are not reported either. If the reported parts make up
    less than 5 % of an object's surface, the finding is a warning instead of an error.
    """
    for m, facts in enumerate(context.meshes):
        wrong = inside_out_parts(context, m)
        if wrong:
            rows = np.concatenate(wrong)
            share = float(facts.area[rows].sum() / facts.area.sum())
            parts = "a closed part" if len(wrong) == 1 else f"{len(wrong)} closed parts"
            verb = "looks" if len(wrong) == 1 else "look"
            text = f"{parts} of {{some}} {verb} inwards, and nothing is inside"
            found = faces_found(context, m, facts.good[rows], text)
            severity = "warning" if share < MOST_WRONG else None
            yield replace(found, percent=100.0 * share, severity=severity)


def inside_out_parts(context: CheckContext, mesh: int) -> list[NDArray[np.int64]]:
    """Return the parts of a mesh that are inside out.

    Parameters
    ----------
    context : CheckContext
        The scene.
    mesh : int
        Index into `context.meshes`.

    Returns
    -------
    list of (n,) int64
        The faces of each part, as indices into `MeshFacts.good`.
    """
    facts = context.meshes[mesh]
    if not len(facts.good) or not _may_be(facts):
        return []
    wrong = []
    suspect = np.flatnonzero(facts.closed & (facts.volume < 0))
    emits = np.array([max(material.emission) > 0 for material in facts.materials], bool)
    for piece in suspect:
        rows = facts.sheet[facts.piece == piece]
        if facts.double_sided[rows].all() or emits[facts.material[facts.good[rows]]].any():
            continue
        if not _inhabited(context, mesh, rows, int(piece)):
            wrong.append(rows)
    return wrong


def _may_be(facts: MeshFacts) -> bool:
    """Return False if fast tests, which need no edges, rule out that a closed part is inside out."""
    if facts.double_sided.all():
        return False
    if len(facts.good) < 4:
        return False
    total = float(np.linalg.norm(facts.area_vector.sum(axis=0)))
    # The sign of the volume of the whole mesh is not a sufficient test, because a larger part with positive
    # volume may hide a part with negative volume. No part is inside out if the area vectors add up to zero
    # and no front faces the centroid.
    outward = np.einsum("gx,gx->g", facts.corner[:, 0] - facts.corner.mean(axis=(0, 1)), facts.area_vector)
    return bool((outward < 0).any()) or total > _ROUNDING * float(facts.area.sum())


def _inhabited(context: CheckContext, mesh: int, rows: NDArray[np.int64], piece: int) -> bool:
    """Return whether a closed part contains something, or is the inner surface of a shell.

    The part is number `piece` of the mesh, and `rows` are its faces as indices into `MeshFacts.good`.
    """
    facts = context.meshes[mesh]
    corner = facts.corner[rows]
    others = [np.zeros((0, 3))]
    # Test points of the other parts of the mesh, and whether another closed part contains this one.
    for other in range(facts.n_pieces):
        if other != piece:
            own = facts.sheet[facts.piece == other]
            others.append(facts.corner[own[:_WITNESSES], 0])
            if facts.closed[other] and facts.volume[other] > 0:
                hollow = first_inside(facts.corner[own], corner[:_WITNESSES, 0])
                if hollow is not None:
                    return True
    if first_inside(corner, np.concatenate(others)) is not None:
        return True
    # Test lights, cameras and points of other objects, in the object space of each instance.
    for instance in context.source.instances:
        if instance.mesh == mesh:
            inverse = np.linalg.pinv(instance.world_from_object)
            points = _things(context, instance.node)
            local = points @ inverse[:3, :3].T + inverse[:3, 3]
            if first_inside(corner, local) is not None:
                return True
    return False


def _things(context: CheckContext, node: int) -> NDArray[np.float64]:
    """Return positions of lights and cameras, and some vertices of all objects except that of `node`.

    The result is (n, 3) float64, metres, world.
    """
    scene = context.scene
    points = list(light_positions(scene))
    points += [np.array(camera.position) for camera in scene.cameras]
    for instance in context.source.instances:
        facts = context.meshes[instance.mesh]
        if instance.node == node or not len(facts.good):
            continue
        step = max(1, len(facts.good) // _WITNESSES)
        matrix = instance.world_from_object
        points += list(facts.corner[::step, 0][:_WITNESSES] @ matrix[:3, :3].T + matrix[:3, 3])
    return np.array(points, np.float64).reshape(-1, 3)
