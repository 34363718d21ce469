"""Rules about the connections of faces: edges, vertices, holes, winding."""

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

# A piece is treated as closed if its holes have less than this share of its area.
MOST_OPEN = 0.05


def _files(facts: MeshFacts, rows: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the sorted unique face numbers of rows of `MeshFacts.sheet`, (n,) int64."""
    return facts.good[facts.sheet[np.unique(rows)]]


@check(
    "non-manifold-edges",
    group="geometry",
    severity="warning",
    fix="split the mesh there, or delete the inner faces (`repair` can)",
)
def non_manifold_edges(context: CheckContext) -> Iterator[RawFinding]:
    """Edges at which more than two faces meet.

    Inside and outside are not defined there. Causes are walls inside walls and faces left over from boolean
    operations. Faces back to back at the same position are not counted, since they are two sheets.
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
    """Vertices at which parts of a mesh touch only in a point.

    Harmless for light, but subdivision, simplification and some unwrappers fail at them.
    """
    for m, facts in enumerate(context.meshes):
        edges, welded = facts.edges, facts.welded[facts.sheet]
        if not len(welded):
            continue
        fan = _fans(facts)
        n = int(welded.max()) + 1
        pairs = np.unique(welded.reshape(-1) * (int(fan.max()) + 1) + fan)
        fans = np.bincount(pairs // (int(fan.max()) + 1), minlength=n)
        # Fans are not defined at an edge of more than two faces; `non-manifold-edges` reports its vertices.
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
    """Return the fan of faces around its vertex of each corner of `sheet`, (3S,) int64."""
    edges = facts.edges
    one, two = edges.pairs(edges.count == 2)
    face, corner = edges.face, edges.corner
    same_way = edges.balance[edges.count == 2] != 0
    start = [face[k] * 3 + corner[k] for k in (one, two)]
    end = [face[k] * 3 + (corner[k] + 1) % 3 for k in (one, two)]
    # Consistently wound neighbours run along their edge in opposite directions.
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

    Light leaks through cracks. A part counts if its holes have less than 5 % of its surface; a box without a
    lid or a sheet of terrain is open on purpose.
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
        chosen = leaky[piece]
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
    """Return the hole at each open edge, (n,) int64, and the number of holes.

    `low` and `high` are the (n,) vertices of the edges, `piece` the (n,) pieces of their faces.
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
    """Return the area of each hole, (n_holes,) float64: of the fan from its border to the centroid."""
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


@check(
    "flipped-neighbours",
    group="geometry",
    severity="warning",
    fix="recalculate normals outside (`fix` does, in closed meshes)",
)
def flipped_neighbours(context: CheckContext) -> Iterator[RawFinding]:
    """Neighbouring faces wound in opposite directions.

    One of them shows its back where the other shows its front. The back of a one-sided surface is black: it
    neither receives nor reflects light, and points near it count as inside geometry.
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
    """Return a finding with a count of edges or vertices instead of faces, `whole` of which are 100 %."""
    return replace(found, count=count, percent=100.0 * count / max(whole, 1))
