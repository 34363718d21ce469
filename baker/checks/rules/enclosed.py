"""Reports faces that lie inside solids and are therefore never visible."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import Location, RawFinding
from baker.checks.rule import check
from baker.checks.world_triangles import WorldTriangles
from baker.topology.solids import BEFORE, BEHIND, Solids, SolidSurfaces, find_solids, lights_and_cameras

# A face is tested at its centroid and at one point near each corner. This is the distance of such a point
# from its corner, as a share of the distance from the corner to the centroid.
_DRAWN_IN = 0.02
# Number of the six rays from a point that must hit the inner side of a solid for the point to count as
# inside.
_PROOF = 2
# A ray's direction is the normal of the face plus one of these unit vectors. The vectors are arbitrary, so
# that rays rarely hit edges of modelled geometry.
_DIRECTIONS = np.array(
    [
        [0.53, 0.41, 0.743],
        [-0.61, 0.37, -0.7],
        [0.29, -0.83, 0.476],
        [-0.43, -0.59, -0.684],
        [0.77, 0.19, -0.609],
        [-0.31, 0.87, 0.383],
    ]
)


@check(
    "enclosed-faces",
    group="geometry",
    severity="info",
    fix="delete the hidden faces to save their texels; a bake fills them from their neighbours",
)
def enclosed_faces(context: CheckContext) -> Iterator[RawFinding]:
    """Faces that lie completely inside a closed solid.

    Examples are the base of a crate that is sunk into a floor, the end of a wall inside another wall, and
    faces between two boxes that touch. They are never visible and receive no light. A bake marks their texels
    invalid and fills them from visible neighbours of the same chart. A closed surface with a light, an
    emitting part, a camera or most of the scene inside is a room, not a solid. A face is reported if its
    centroid and three points near its corners are inside a solid.

    The rule also reports double-sided faces that bound a solid and whose fronts point into the solid. Flip
    these faces, because their lightmap contains the light of their fronts, and there is none in the solid.
    """
    world = context.world
    if not len(world.triangle):
        return
    solids = _solids(context, world)
    if not solids.inside.any():
        return
    inverted = (solids.inside == BEFORE) & world.double_sided
    holder = _holders(world, solids)
    # `inside-out` and `flipped-neighbours` report one-sided faces whose fronts point into their own solid.
    holder[solids.inside == BEFORE] = -1
    for number in np.unique(world.instance[(holder >= 0) | inverted]):
        own = world.instance == number
        hidden, turned = np.flatnonzero(own & (holder >= 0)), np.flatnonzero(own & inverted)
        if len(hidden):
            name, count = np.unique(holder[hidden], return_counts=True)
            most = int(name[count.argmax()])
            around = f"'{context.source.instances[most].name}'" if most != number else "another part of it"
            others = "" if len(name) == 1 else f" and {len(name) - 1} more"
            yield _found(context, hidden, f"{{some}} inside of {around}{others}: nobody sees them")
        if len(turned):
            yield _found(context, turned, "{some} the wrong way round: their front is inside of a solid")


def _found(context: CheckContext, rows: NDArray[np.int64], text: str) -> RawFinding:
    world = context.world
    instance = context.source.instances[int(world.instance[rows[0]])]
    facts = context.meshes[instance.mesh]
    faces = world.face[rows]
    area = float(world.area[rows].sum())
    whole = float(world.area[world.instance == world.instance[rows[0]]].sum())
    x, y, z = world.middle_of(rows[0])
    return RawFinding(
        text.format(some="1 face lies" if len(rows) == 1 else f"{len(rows)} faces lie"),
        Location(instance.name or context.source.meshes[instance.mesh].name, instance.node),
        len(rows),
        percent=100.0 * area / max(whole, 1e-300),
        primitive=facts.primitive_of(faces),
        faces=facts.named(faces),
        position=(x, y, z),
        more={"area": round(area, 6)},
    )


def _solids(context: CheckContext, world: WorldTriangles) -> Solids:
    materials = context.scene.materials
    surfaces = SolidSurfaces(
        position=world.position,
        triangle=world.triangle,
        instance=world.instance,
        opaque=np.array([m.alpha_mode == "OPAQUE" for m in materials], bool)[world.material],
        double_sided=world.double_sided,
        emits=np.array([max(m.emission) > 0 for m in materials], bool)[world.material],
    )
    return find_solids(surfaces, lights_and_cameras(context.scene))


def _holders(world: WorldTriangles, solids: Solids) -> NDArray[np.int64]:
    """Return (T,) int64: for each face, the instance of a solid around its last test point, or -1.

    It is -1 unless each of the four test points of the face is inside a solid.
    """
    corner = world.position[world.triangle].astype(np.float64)
    middle = corner.mean(axis=1)
    rows = np.flatnonzero(world.area > 0)
    found = np.full(len(corner), -1, np.int64)
    for k in range(4):
        point = middle[rows] if k == 0 else corner[rows, k - 1]
        point = point + _DRAWN_IN * (middle[rows] - point)
        holder = _held(world, solids, world.lifted(point, rows, world.normal[rows]), world.normal[rows])
        found[rows] = holder
        rows = rows[holder >= 0]
    return found


def _held(
    world: WorldTriangles, solids: Solids, origin: NDArray[np.float64], normal: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return (n,) int64: for each point of `origin` (n, 3), the instance of a solid around it, or -1.

    `normal` (n, 3) are the unit normals of the faces on which the points lie.
    """
    count, holder = np.zeros(len(origin), np.int64), np.full(len(origin), -1, np.int64)
    near, far = np.zeros(len(origin), np.float32), np.full(len(origin), np.inf, np.float32)
    for direction in _DIRECTIONS:
        aim = normal + direction
        hit, _ = world.first_hits(origin, aim, near, far)
        met = hit >= 0
        front = np.einsum("nx,nx->n", world.normal[hit], aim) < 0
        inside = met & (solids.inside[hit] == np.where(front, BEFORE, BEHIND))
        count += inside
        holder = np.where(inside, world.instance[hit], holder)
    return np.where(count >= _PROOF, holder, -1)
