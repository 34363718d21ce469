"""Checks the connectivity of meshes: edges, vertices, holes and winding."""

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
from baker.topology.weld import connected, number_by_first

# Total area of the holes of a piece, as a share of the piece's area, from which on the holes count as
# intended.
MOST_OPEN = 0.05
# MOST_BOTTOMS: largest number of holes of a mesh that are tested for being a missing bottom.
# STEEP: largest magnitude of the vertical component of the unit normals of the faces beside a missing bottom.
# FLAT: largest height of the edges of a missing bottom above the lowest vertex of the piece, as a share of
# the piece's height.
MOST_BOTTOMS, STEEP, FLAT = 64, 0.5, 1e-3


def _files(facts: MeshFacts, rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """Convert indices into `MeshFacts.sheet` to indices of faces in the mesh, (n,) int64, without repeats."""
    return facts.good[facts.sheet[np.unique(rows)]]


@check(
    "non-manifold-edges",
    group="geometry",
    severity="warning",
    fix="split the mesh there, or delete the inner faces (`repair` can)",
)
def non_manifold_edges(context: CheckContext) -> Iterator[RawFinding]:
    """Edges at which more than two faces meet.

    Inside and outside are not defined at such an edge. Typical causes are walls inside other walls and faces
    left over from boolean operations. Faces with the same three positions as another face are not counted,
    because they are the two sides of a sheet.
    """
    for m, facts in enumerate(context.meshes):
        edges = facts.edges
        crowded = np.flatnonzero(edges.count > 2)
        if len(crowded):
            text = f"{len(crowded)} edges with more than two faces"
            faces = _files(facts, edges.face[edges.first[crowded]])
            found = faces_found(context, m, faces, text)
            yield _counted(found, len(crowded), len(edges.count))


@check(
    "non-manifold-vertices",
    group="geometry",
    severity="info",
    fix="move the touching parts apart, or into objects of their own",
)
def non_manifold_vertices(context: CheckContext) -> Iterator[RawFinding]:
    """Vertices at which two groups of faces meet that share no edge at this vertex.

    Such vertices do not affect light, but subdivision, simplification and some unwrappers fail at them.
    """
    for m, facts in enumerate(context.meshes):
        edges, welded = facts.edges, facts.welded[facts.sheet]
        if not len(welded):
            continue
        fan = _fans(facts)
        n = int(welded.max()) + 1
        pairs = np.unique(welded.reshape(-1) * (int(fan.max()) + 1) + fan)
        fans = np.bincount(pairs // (int(fan.max()) + 1), minlength=n)
        # Skip the ends of edges with more than two faces, where fans are undefined; `non-manifold-edges`
        # reports these edges.
        crowded = edges.count > 2
        fans[edges.low[crowded]] = 1
        fans[edges.high[crowded]] = 1
        touching = np.flatnonzero(fans > 1)
        if len(touching):
            first = np.flatnonzero((welded == touching[0]).any(axis=1))
            found = faces_found(
                context, m, _files(facts, first), f"{len(touching)} vertices where parts touch in a point"
            )
            yield _counted(found, len(touching), int((fans > 0).sum()))


def _fans(facts: MeshFacts) -> NDArray[np.int64]:
    """Return the number of the fan of each corner of the S sheet faces, (3 S,) int64.

    A fan consists of the faces at a vertex that are connected by edges at this vertex.
    """
    edges = facts.edges
    one, two = edges.pairs(edges.count == 2)
    face, corner = edges.face, edges.corner
    same_way = edges.balance[edges.count == 2] != 0
    start = [face[k] * 3 + corner[k] for k in (one, two)]
    end = [face[k] * 3 + (corner[k] + 1) % 3 for k in (one, two)]
    # Connect the corners at both ends of each edge. Half edges of consistently wound faces run in opposite
    # directions, so the start of one is the end of the other.
    a = np.concatenate([start[0], end[0]])
    b = np.concatenate([np.where(same_way, start[1], end[1]), np.where(same_way, end[1], start[1])])
    n = 3 * len(facts.sheet)
    return connected(a, b, n)


@check(
    "open-edges",
    group="geometry",
    severity="warning",
    fix="merge vertices by distance and fill the holes (`repair` fills small ones)",
)
def open_edges(context: CheckContext) -> Iterator[RawFinding]:
    """Open edges in a mesh that is closed except for small holes.

    Light leaks through the holes. The holes of a connected part of the mesh are reported if their total area
    is less than 5 % of the area of the part's faces. Larger holes are assumed to be intended, as in a box
    without a lid or a sheet of terrain. A missing bottom is assumed to be intended, too, as at the feet of an
    arch that stands on the ground. The edges of a missing bottom are in the lowest horizontal plane of the
    part, and the faces beside them are steep.
    """
    for m, facts in enumerate(context.meshes):
        edges = facts.edges
        border = np.flatnonzero(edges.count == 1)
        if not len(border):
            continue
        face = edges.face[edges.first[border]]
        piece = facts.piece[face]
        hole, n_holes = _loops(edges.low[border], edges.high[border], piece)
        area = _hole_area(facts, border, hole, n_holes)
        of = np.zeros(n_holes, np.int64)
        of[hole] = piece
        missing = np.bincount(of, area, facts.n_pieces)
        whole = np.bincount(facts.piece, facts.area[facts.sheet], facts.n_pieces)
        leaky = missing < MOST_OPEN * np.maximum(whole, 1e-300)
        if not leaky.any():
            continue
        shown = context.first_instance.get(m)
        up = np.array([0.0, 1.0, 0.0]) if shown is None else shown.world_from_object[1, :3]
        meant = _missing_bottoms(facts, border, hole, area, up)
        chosen = leaky[piece] & ~meant[hole]
        if chosen.any():
            n, holes = int(chosen.sum()), len(np.unique(hole[chosen]))
            some = "1 hole" if holes == 1 else f"{holes} holes"
            found = faces_found(
                context, m, _files(facts, face[chosen]), f"{n} open edges around {some} of a closed mesh"
            )
            yield _counted(found, n, len(edges.count))


def _loops(
    low: NDArray[np.int64], high: NDArray[np.int64], piece: NDArray[np.int32]
) -> tuple[NDArray[np.int64], int]:
    """Return the number of the hole of each of n open edges, (n,) int64, and the number of holes.

    A hole is a set of open edges of one piece that are connected by vertices. `low` and `high` (n,) are the
    vertices of the edges, and `piece` (n,) are the pieces of their faces.
    """
    n = int(max(low.max(), high.max())) + 1
    ends = np.concatenate([low, high]) + n * np.concatenate([piece, piece]).astype(np.int64)
    _, node = np.unique(ends, return_inverse=True)
    a, b = node[: len(low)], node[len(low) :]
    size = int(node.max()) + 1
    hole = number_by_first(connected(a, b, size)[a]).astype(np.int64)
    return hole, int(hole.max(initial=-1)) + 1


def _hole_area(
    facts: MeshFacts, border: NDArray[np.int64], hole: NDArray[np.int64], n_holes: int
) -> NDArray[np.float64]:
    """Return the area of each hole, (n_holes,) float64, in object space.

    Each open edge and the centroid of its hole form a triangle. The area of a hole is the length of the sum
    of the area vectors of its triangles. `border` (n,) are the open edges, and `hole` (n,) are their holes.
    """
    edges = facts.edges
    face, corner = edges.face[edges.first[border]], edges.corner[edges.first[border]]
    around = facts.corner[facts.sheet[face]]
    row = np.arange(len(face))
    a, b = around[row, corner], around[row, (corner + 1) % 3]
    n = np.maximum(np.bincount(hole, minlength=n_holes), 1)
    centre = np.stack([np.bincount(hole, a[:, k], n_holes) / n for k in range(3)], axis=1)
    twice = np.cross(a - centre[hole], b - centre[hole])
    total = np.stack([np.bincount(hole, twice[:, k], n_holes) for k in range(3)], axis=1)
    return np.asarray(0.5 * np.linalg.norm(total, axis=1), np.float64)


def _missing_bottoms(
    facts: MeshFacts,
    border: NDArray[np.int64],
    hole: NDArray[np.int64],
    area: NDArray[np.float64],
    up: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Return (H,) bool: the holes that are a missing bottom. Only the largest `MOST_BOTTOMS` are tested.

    `border` (n,) are the open edges, `hole` (n,) are their holes, `area` (H,) are the holes' areas, and `up`
    (3,) is the gradient of the height in object space.
    """
    edges = facts.edges
    face, corner = edges.face[edges.first[border]], edges.corner[edges.first[border]]
    around = facts.corner[facts.sheet[face]]
    row = np.arange(len(face))
    start = around[row, corner]
    up = up / max(float(np.linalg.norm(up)), 1e-300)
    vector = facts.area_vector[facts.sheet[face]]
    normal = vector / np.maximum(np.linalg.norm(vector, axis=1), 1e-300)[:, None]
    meant = np.zeros(len(area), bool)
    for k in np.argsort(-area, kind="stable")[:MOST_BOTTOMS]:
        mine = np.flatnonzero(hole == k)
        if np.abs(normal[mine] @ up).max() > STEEP:
            continue
        piece = facts.piece[face[mine[0]]]
        height = facts.corner[facts.sheet[facts.piece == piece]].reshape(-1, 3) @ up
        edge = start[mine] @ up
        meant[k] = edge.max() - height.min() <= FLAT * float(np.ptp(height))
    return meant


@check(
    "flipped-neighbours",
    group="geometry",
    severity="warning",
    fix="recalculate normals outside (`fix` does, in closed meshes)",
)
def flipped_neighbours(context: CheckContext) -> Iterator[RawFinding]:
    """Neighbouring faces that are wound in opposite directions.

    From any side, one of the two faces shows its front and the other its back. The back of a one-sided
    surface is black: it neither reflects nor emits light.
    """
    for m, facts in enumerate(context.meshes):
        edges = facts.edges
        odd = np.flatnonzero((edges.count == 2) & (edges.balance != 0))
        if len(odd):
            faces = _files(facts, edges.face[edges.first[odd]])
            some = "1 edge" if len(odd) == 1 else f"{len(odd)} edges"
            text = f"faces on both sides of {some} are wound in opposite directions"
            found = faces_found(context, m, faces, text)
            yield _counted(found, len(odd), len(edges.count))


def _counted(found: RawFinding, count: int, whole: int) -> RawFinding:
    """Return a finding whose count is a number of edges or vertices; `whole` is the number that is 100 %."""
    return replace(found, count=count, percent=100.0 * count / max(whole, 1))
