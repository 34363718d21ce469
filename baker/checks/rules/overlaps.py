"""Reports intersecting faces of a mesh, and overlapping coplanar faces of different objects."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import MOST_FACES, Location, RawFinding
from baker.checks.mesh_facts import MeshFacts
from baker.checks.rule import check
from baker.checks.rules.bad_faces import faces_found
from baker.checks.world_triangles import cast
from baker.core.parallel import thread_count

# Share of an edge's length that rays along the edge skip at both ends, because neighbouring faces touch the
# edge there. The next search for a hit skips the same length behind each hit.
_ENDS = 1e-4
# Distance from a face, as a share of the mesh's diagonal. An edge pierces the face only if both its ends are
# farther from the face's plane.
_DEPTH = 1e-5
# Largest number of hits that are tested along an edge.
_ROUNDS = 4
# Tolerance of the distance between two planes that count as the same: COPLANAR times the scene's diagonal,
# clamped to LEAST and MOST, metres.
COPLANAR, LEAST, MOST = 1e-6, 1e-6, 1e-3
# Components of plane normals are rounded to multiples of 1 / _TURN before they are compared.
_TURN = 256.0
# Number of faces of a mesh up to which all pairs of faces are compared before a ray tree is built.
_FEW_FACES = 64


@check(
    "self-intersection",
    group="geometry",
    severity="info",
    fix="join the parts with a boolean union, if light bleeds where they meet",
)
def self_intersection(context: CheckContext) -> Iterator[RawFinding]:
    """Faces of one mesh that intersect each other.

    Intersections are common where parts of a mesh overlap, and mostly harmless: texels inside the other part
    are filled from their neighbours. Rays along the edges find the intersections. At most four hits along
    each edge are tested. Parts that only touch are not reported.
    """
    for m, facts in enumerate(context.meshes):
        pierced, n = _crossings(facts, thread_count(context.settings.threads))
        if n:
            both = facts.good[pierced]
            some = "1 edge pierces" if n == 1 else f"{n} edges pierce"
            found = faces_found(context, m, np.unique(both), f"{some} another face of the mesh")
            pairs = tuple((int(a), int(b)) for a, b in facts.local[both[:MOST_FACES]])
            yield replace(found, count=n, pairs=pairs)


def _crossings(facts: MeshFacts, threads: int) -> tuple[NDArray[np.int64], int]:
    """Return pairs of intersecting faces and the number of edges that pierce a face.

    The pairs are (n, 2) int64, indices into `MeshFacts.good`.
    """
    from baker.trace.embree import RayScene

    if len(facts.sheet) < 2 or (len(facts.good) <= _FEW_FACES and not _may_cross(facts)):
        return np.zeros((0, 2), np.int64), 0
    edges = facts.edges
    face, corner = facts.sheet[edges.face[edges.first]], edges.corner[edges.first]
    begin = facts.corner[face, corner]
    end = facts.corner[face, (corner + 1) % 3]
    low, high = edges.low, edges.high
    near = np.full(len(face), _ENDS)
    low_corner, high_corner = facts.bounds
    depth = _DEPTH * float(np.linalg.norm(high_corner - low_corner))
    tree = RayScene(facts.position, facts.triangle[facts.good].astype(np.uint32), threads=threads)
    out = [np.zeros((0, 2), np.int64)]
    rows, piercing = np.arange(len(face)), np.zeros(len(face), bool)
    for _ in range(_ROUNDS):
        if not len(rows):
            break
        direction = end[rows] - begin[rows]
        far = np.full(len(rows), 1.0 - _ENDS)
        hit, distance = cast(tree.tracer, threads, begin[rows], direction, near[rows], far)
        met = hit >= 0
        rows, other, distance = rows[met], hit[met].astype(np.int64), distance[met]
        ends = facts.welded[other]
        neighbour = ((ends == low[rows, None]) | (ends == high[rows, None])).any(axis=1)
        through = ~neighbour & _pierces(facts, begin[rows], end[rows], other, depth)
        piercing[rows[through]] = True
        out.append(np.stack([face[rows[through]], other[through]], axis=1))
        near[rows] = distance + _ENDS
        rows = rows[near[rows] < 1.0 - _ENDS]
    tree.close()
    pairs = np.sort(np.concatenate(out), axis=1)
    return np.unique(pairs, axis=0), int(piercing.sum())


def _may_cross(facts: MeshFacts) -> bool:
    """Return whether two faces with at most one common welded vertex have overlapping bounding boxes.

    Faces with two common vertices need no test. Each edge of one such face ends at a vertex of the other
    face, so it does not pierce the other face.
    """
    low, high = facts.corner.min(axis=1), facts.corner.max(axis=1)
    gap = _DEPTH * float((high.max(axis=0) - low.min(axis=0)).max())
    overlap = ((low[:, None] <= high[None] + gap) & (high[:, None] >= low[None] - gap)).all(axis=2)
    common = (facts.welded[:, None, :, None] == facts.welded[None, :, None, :]).any(axis=3).sum(axis=2)
    return bool((overlap & (common < 2)).any())


def _pierces(
    facts: MeshFacts,
    begin: NDArray[np.float64],
    end: NDArray[np.float64],
    other: NDArray[np.int64],
    depth: float,
) -> NDArray[np.bool_]:
    """Return (n,) bool: the edges whose ends lie on different sides of a face's plane.

    Both ends must be farther than `depth` from the plane. `begin` and `end` are the ends of the edges,
    (n, 3), object space. `other` (n,) are the faces, as indices into `MeshFacts.good`.
    """
    normal = facts.area_vector[other] / np.maximum(facts.area[other], 1e-300)[:, None]
    at = facts.corner[other, 0]
    one = np.einsum("nx,nx->n", begin - at, normal)
    two = np.einsum("nx,nx->n", end - at, normal)
    return np.asarray((one * two < 0) & (np.minimum(np.abs(one), np.abs(two)) > depth))


@check(
    "coplanar-overlap",
    group="geometry",
    severity="warning",
    fix="move one surface by a millimetre, or cut the hidden part away",
)
def coplanar_overlap(context: CheckContext) -> Iterator[RawFinding]:
    """Coplanar surfaces of different objects that overlap and face the same direction (z-fighting).

    Engines show either surface at random, and each surface shadows the other at random. Two surfaces count as
    coplanar if the distance between their planes is less than about a millionth of the scene's diagonal. A
    box on a floor is not reported, because the fronts of the two surfaces point in opposite directions. There
    is one finding for each pair of objects.
    """
    partner = _partners(context)
    world = context.world
    mine = np.flatnonzero(partner >= 0)
    if not len(mine):
        return
    n = len(context.source.instances)
    one, two = world.instance[mine], world.instance[partner[mine]]
    key = np.minimum(one, two) * n + np.maximum(one, two)
    for k in np.unique(key):
        a, b = (context.source.instances[int(v)] for v in divmod(int(k), n))
        own = mine[(key == k) & (one == int(k) // n)]
        rest = mine[(key == k) & (one != int(k) // n)]
        chosen = own if len(own) else rest
        faces = world.face[chosen]
        shown = a if len(own) else b
        facts = context.meshes[shown.mesh]
        x, y, z = world.middle_of(chosen[0])
        some = "1 face lies" if len(chosen) == 1 else f"{len(chosen)} faces lie"
        hidden = b if len(own) else a
        yield RawFinding(
            f"{some} in the same plane as '{hidden.name}' and overlap it",
            Location(shown.name, shown.node),
            len(chosen),
            percent=100.0 * len(chosen) / max(len(facts.good), 1),
            primitive=facts.primitive_of(faces),
            faces=facts.named(faces),
            position=(x, y, z),
            more={"other": hidden.name, "other_node": hidden.node},
        )


def _partners(context: CheckContext) -> NDArray[np.int64]:
    """For each world triangle, return a coplanar triangle of another instance that overlaps it.

    The result is (T,) int64, indices of world triangles, -1 for none.
    """
    world = context.world
    partner = np.full(len(world.triangle), -1, np.int64)
    if len(context.source.instances) < 2 or not len(world.triangle):
        return partner
    tolerance = min(max(COPLANAR * context.diagonal, LEAST), MOST)
    corner = world.position[world.triangle[:, 0]].astype(np.float64)
    away = np.einsum("tx,tx->t", world.normal, corner)
    turn = np.round(world.normal * _TURN).astype(np.int64) + int(_TURN)
    direction = (turn[:, 0] * 1024 + turn[:, 1]) * 1024 + turn[:, 2]
    # Quantise plane offsets to two grids of cells of twice the tolerance, shifted by half a cell. Planes
    # closer than the tolerance share a cell in at least one grid. The shifts keep planes at round numbers
    # away from cell borders.
    for shift in (0.3137, 0.8137):
        step = np.floor(away / (2.0 * tolerance) + shift).astype(np.int64)
        _match(context, direction, step, tolerance, partner)
    return partner


def _match(
    context: CheckContext,
    direction: NDArray[np.int64],
    step: NDArray[np.int64],
    tolerance: float,
    partner: NDArray[np.int64],
) -> None:
    """Find overlaps among triangles of equal `direction` and equal `step`, and write them to `partner`.

    `direction` (T,) encodes the rounded normal of each triangle's plane, and `step` (T,) the grid cell of the
    plane's offset. Entries of `partner` (T,) are overwritten for triangles with an overlap.
    """
    from baker.checks.kernels.coplanar import coplanar_partners

    world = context.world
    step = step - step.min()
    key = direction * (int(step.max()) + 1) + step
    order = np.argsort(key, kind="stable")
    new = np.ones(len(order), bool)
    new[1:] = key[order][1:] != key[order][:-1]
    group = np.cumsum(new) - 1
    begin = np.flatnonzero(new)
    owner = world.instance[order]
    shared = np.minimum.reduceat(owner, begin) != np.maximum.reduceat(owner, begin)
    keep = shared[group] & (world.area[order] > 0)
    order, group = order[keep], group[keep]
    if not len(order):
        return
    # Project each triangle along the axis of the normal's largest component.
    drop = np.abs(world.normal[order]).argmax(axis=1)
    axes = np.array([[1, 2], [0, 2], [0, 1]])[drop]
    corner = world.position[world.triangle[order]].astype(np.float64)
    flat = np.take_along_axis(corner, np.repeat(axes[:, None, :], 3, axis=1), axis=2)
    low, high = flat.min(axis=1), flat.max(axis=1)
    by_x = np.lexsort((low[:, 0], group))
    order, group = order[by_x], group[by_x]
    first = np.append(np.flatnonzero(np.append(True, group[1:] != group[:-1])), len(group))
    found = np.full(len(order), -1, np.int64)
    coplanar_partners(
        np.ascontiguousarray(flat[by_x]), low[by_x], high[by_x], first, world.instance[order],
        10.0 * tolerance, found,
    )  # fmt: skip
    met = found >= 0
    partner[order[met]] = order[found[met]]
