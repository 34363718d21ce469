"""Closed parts of meshes whose fronts point inwards although they contain nothing."""

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

# Length of the sum of area vectors over the area, above which a mesh cannot be closed.
_ROUNDING = 1e-4
# Share of a mesh's surface below which parts that are inside out are a warning only.
MOST_WRONG = 0.05
# Number of points of another object that are tested.
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

    From outside it is black and absorbs all light. The fronts of rooms point inwards by design, so parts with
    a light, a camera or other geometry inside are not reported, nor are parts that emit, the inner surfaces
    of shells, and double-sided surfaces. Less than 5 % of an object's surface is a warning only.
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
        Rows of `MeshFacts.good`, an array for each part.
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
    """Return False if no closed part can be inside out, by tests that need no edges."""
    if facts.double_sided.all():
        return False
    if len(facts.good) < 4:
        return False
    total = float(np.linalg.norm(facts.area_vector.sum(axis=0)))
    # A positive volume of the whole mesh does not rule out a part with a negative one. Rule out meshes whose
    # area vectors add up to zero and of which no front faces the centroid.
    outward = np.einsum("gx,gx->g", facts.corner[:, 0] - facts.corner.mean(axis=(0, 1)), facts.area_vector)
    return bool((outward < 0).any()) or total > _ROUNDING * float(facts.area.sum())


def _inhabited(context: CheckContext, mesh: int, rows: NDArray[np.int64], piece: int) -> bool:
    """Return whether a closed part contains anything, or is the inner surface of another part."""
    facts = context.meshes[mesh]
    corner = facts.corner[rows]
    others = [np.zeros((0, 3))]
    # Test the other parts of the same mesh.
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
    # Test lights, cameras and other objects, in the space of each instance.
    for instance in context.source.instances:
        if instance.mesh == mesh:
            inverse = np.linalg.pinv(instance.world_from_object)
            points = _things(context, instance.node)
            local = points @ inverse[:3, :3].T + inverse[:3, 3]
            if first_inside(corner, local) is not None:
                return True
    return False


def _things(context: CheckContext, node: int) -> NDArray[np.float64]:
    """Return points of lights, cameras and all objects except that of `node`, (n, 3) float64, world."""
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
