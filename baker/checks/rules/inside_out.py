"""Reports closed parts of meshes whose fronts point inwards and that contain nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.mesh_facts import MeshFacts
from baker.checks.rule import check
from baker.checks.rules.bad_faces import faces_found
from baker.checks.sorted_points import SortedPoints
from baker.topology.winding_number import first_inside

# Length of the sum of a mesh's area vectors, divided by its area, up to which the sum counts as zero. It is 0
# for a closed mesh except for rounding.
_ROUNDING = 1e-4
# Share of a mesh's area. If the inside-out parts have a smaller share, the finding is a warning.
MOST_WRONG = 0.05
# Largest number of test points of a part. They are corners 0 of its faces.
_WITNESSES = 8
# Condition number of an object's transform above which the object counts as flattened.
_FLATTENED = 1e6


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
    Parts with a light, a camera or other geometry inside are therefore not reported. Parts with an emitting
    face, parts inside another closed part of the mesh, and parts of which all faces are double-sided are not
    reported either. If the reported parts make up less than 5 % of the mesh's surface, the finding is a
    warning instead of an error.
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
    if not len(suspect):
        return []
    parts = _Parts(facts)
    emits = facts.flag(facts.material[facts.good], lambda m: max(m.emission) > 0)
    for piece in suspect:
        rows = parts.faces(int(piece))
        if facts.double_sided[rows].all() or emits[rows].any():
            continue
        if not _inhabited(context, mesh, parts, int(piece)):
            wrong.append(rows)
    return wrong


def _may_be(facts: MeshFacts) -> bool:
    """Return False if fast tests, which need no edges, show that no closed part is inside out."""
    if facts.double_sided.all():
        return False
    if len(facts.good) < 4:
        return False
    total = float(np.linalg.norm(facts.area_vector.sum(axis=0)))
    # The sign of the volume of the whole mesh is not a sufficient test, because the mesh may have a part with
    # negative volume and a larger part with positive volume. If the area vectors add up to zero and no front
    # faces the centroid, no part is inside out.
    outward = np.einsum("gx,gx->g", facts.corner[:, 0] - facts.corner.mean(axis=(0, 1)), facts.area_vector)
    return bool((outward < 0).any()) or total > _ROUNDING * float(facts.area.sum())


class _Parts:
    """The parts of a mesh, with their faces, bounding boxes and test points.

    A part is a set of faces that are connected by edges, see `MeshFacts.piece`.
    """

    def __init__(self, facts: MeshFacts) -> None:
        self.facts = facts
        order = np.argsort(facts.piece, kind="stable")
        self.count = np.bincount(facts.piece, minlength=facts.n_pieces)
        self.start = np.cumsum(self.count) - self.count
        self.face = facts.sheet[order]
        corner = facts.corner[self.face]
        low, high = corner.min(axis=1), corner.max(axis=1)
        self.low = np.minimum.reduceat(low, self.start, axis=0)
        self.high = np.maximum.reduceat(high, self.start, axis=0)
        number = np.arange(len(order)) - np.repeat(self.start, self.count)
        tested = number < _WITNESSES
        self.points = SortedPoints(corner[tested, 0], facts.piece[order][tested].astype(np.int64))
        self.hollow = facts.closed & (facts.volume > 0)

    def faces(self, piece: int) -> NDArray[np.int64]:
        """Return the faces of a part, (n,) int64, indices into `MeshFacts.good`."""
        return self.face[self.start[piece] : self.start[piece] + self.count[piece]]


def _inhabited(context: CheckContext, mesh: int, parts: _Parts, piece: int) -> bool:
    """Return whether part number `piece` contains something, or lies in another closed part of the mesh.

    Only test points are tested: lights, cameras, and some vertices of other parts and objects.
    """
    facts = parts.facts
    corner = facts.corner[parts.faces(piece)]
    # Test whether another closed part contains this part, and whether this part contains test points of other
    # parts.
    own = corner[:_WITNESSES, 0]
    around = (
        parts.hollow & (parts.low < own.max(axis=0)).all(axis=1) & (parts.high > own.min(axis=0)).all(axis=1)
    )
    for other in np.flatnonzero(around):
        if other != piece and first_inside(facts.corner[parts.faces(int(other))], own) is not None:
            return True
    if first_inside(corner, parts.points.within(parts.low[piece], parts.high[piece], piece)) is not None:
        return True
    # Test lights, cameras and points of other objects, in the object space of each instance.
    box = np.array(list(product(*zip(parts.low[piece], parts.high[piece], strict=True))))
    for instance in context.instances_of.get(mesh, ()):
        matrix = instance.world_from_object
        world = box @ matrix[:3, :3].T + matrix[:3, 3]
        low, high = world.min(axis=0), world.max(axis=0)
        margin = 1e-6 * (np.abs(world).max() + (high - low).max())
        if np.linalg.cond(matrix[:3, :3]) > _FLATTENED:
            # Points far from a flattened object are mapped into its box, too.
            low, high = np.full(3, -np.inf), np.full(3, np.inf)
        points = context.test_points.within(low - margin, high + margin, instance.node)
        inverse = np.linalg.pinv(matrix)
        if first_inside(corner, points @ inverse[:3, :3].T + inverse[:3, 3]) is not None:
            return True
    return False
