"""Checks vertex normals, and reports duplicate vertices."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.mesh_facts import MeshFacts
from baker.checks.rule import check
from baker.checks.rules.bad_faces import faces_found
from baker.core.readable import number
from baker.core.source_mesh import SourcePrimitive
from baker.topology.unique_rows import unique_rows

# Largest deviation of a normal's length from 1 that is not reported. Rounding to normalized bytes changes
# lengths by about this number.
UNIT_SLACK = 0.02


def _parts(facts: MeshFacts) -> Iterator[tuple[int, SourcePrimitive]]:
    yield from enumerate(facts.source.primitives)


def _faces_at(facts: MeshFacts, part: int, vertex: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return the faces of a primitive that have a corner at a marked vertex, (n,) int64.

    `vertex` (V,) bool marks vertices of the primitive with index `part`.
    """
    rows = np.flatnonzero((facts.primitive == part) & facts.within)
    local = facts.triangle[rows] - facts.vertex_start[part]
    touched: NDArray[np.bool_] = vertex[local].any(axis=1)
    return rows[touched]


def _length(normal: NDArray[np.float32]) -> NDArray[np.float64]:
    wide = normal.astype(np.float64)
    with np.errstate(over="ignore", invalid="ignore"):
        length: NDArray[np.float64] = np.sqrt((wide * wide).sum(axis=1))
    return length


@check(
    "missing-normals",
    group="geometry",
    severity="info",
    fix="export normals if the surface is meant to look smooth; it is baked with flat faces",
)
def missing_normals(context: CheckContext) -> Iterator[RawFinding]:
    """Meshes with primitives without vertex normals.

    glTF requires flat normals for such primitives, so light changes abruptly at every edge.
    """
    for m, facts in enumerate(context.meshes):
        lacking = [k for k, p in _parts(facts) if p.normal is None and len(p.triangle)]
        if lacking:
            faces = np.flatnonzero(np.isin(facts.primitive, lacking))
            yield faces_found(context, m, faces, "{some} without vertex normals")


@check(
    "bad-normals",
    group="geometry",
    severity="warning",
    fix="recalculate normals where the mesh was made; a bake computes these from the faces",
)
def bad_normals(context: CheckContext) -> Iterator[RawFinding]:
    """Vertex normals that are NaN, infinite or zero."""
    for m, facts in enumerate(context.meshes):
        for k, p in _parts(facts):
            if p.normal is None:
                continue
            length = _length(p.normal)
            faces = _faces_at(facts, k, ~(np.isfinite(length) & (length > 1e-12)))
            if len(faces):
                yield faces_found(context, m, faces, "{some} with a normal of no length or not finite")


@check(
    "normal-length",
    group="geometry",
    severity="warning",
    fix="normalise the normals on export; a bake does so by itself, engines may not",
)
def normal_length(context: CheckContext) -> Iterator[RawFinding]:
    """Vertex normals whose length differs from 1 by more than 2 %.

    A shader that does not normalise them shades the surface too bright or too dark.
    """
    for m, facts in enumerate(context.meshes):
        for k, p in _parts(facts):
            if p.normal is None:
                continue
            length = _length(p.normal)
            odd = np.isfinite(length) & (length > 1e-12) & (np.abs(length - 1.0) > UNIT_SLACK)
            faces = _faces_at(facts, k, odd)
            if len(faces):
                worst = length[odd][np.argmax(np.abs(length[odd] - 1.0))]
                yield faces_found(
                    context, m, faces, f"{{some}} with a normal of length {number(worst)}, not 1"
                )


@check(
    "normals-against-faces",
    group="geometry",
    severity="warning",
    fix="recalculate normals, or flip the faces: winding and normals disagree about the front",
)
def normals_against_faces(context: CheckContext) -> Iterator[RawFinding]:
    """Faces whose vertex normals all point to the back of the face.

    The winding defines the front, which is the side that receives light. A bake ignores vertex normals that
    point to the back: it uses the normal of the face, so the surface looks faceted. Engines use the vertex
    normals for dynamic lights, which then light the wrong side.
    """
    for m, facts in enumerate(context.meshes):
        for k, p in _parts(facts):
            rows = np.flatnonzero(facts.primitive[facts.good] == k)
            if p.normal is None or not len(rows):
                continue
            local = facts.triangle[facts.good[rows]] - facts.vertex_start[k]
            normal = np.nan_to_num(p.normal[local].astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
            side = np.einsum("fcx,fx->fc", normal, facts.area_vector[rows])
            against = facts.good[rows[(side < 0).all(axis=1)]]
            if len(against):
                yield faces_found(context, m, against, "{some} whose normals all point to their back")


@check(
    "duplicate-vertices",
    group="geometry",
    severity="info",
    fix="merge equal vertices on export (`fix` welds them): smaller files, the same picture",
)
def duplicate_vertices(context: CheckContext) -> Iterator[RawFinding]:
    """Vertices that equal another vertex of the same primitive in every attribute."""
    for m, facts in enumerate(context.meshes):
        double, total = 0, 0
        first: int | None = None
        at: tuple[float, float, float] | None = None
        for _, p in _parts(facts):
            if not len(p.triangle):
                continue
            further = None if p.further is None else p.further.astype(np.float32)
            columns = [p.position, p.normal, *p.texcoord.values(), p.colour, further]
            # Add 0 to make -0 equal to 0, because bits are compared.
            rows = [c + np.float32(0.0) for c in columns if c is not None]
            distinct, number = unique_rows(rows, len(p.position))
            repeats = len(number) - len(distinct)
            double, total = double + repeats, total + len(number)
            if repeats and first is None:
                first = p.index
                which = np.flatnonzero(np.bincount(number)[number] > 1)[0]
                if np.isfinite(p.position[which]).all():
                    at = context.to_world(m, p.position[which])
        if double:
            some = "1 vertex repeats" if double == 1 else f"{double} of {total} vertices repeat"
            yield RawFinding(
                f"{some} another one in every attribute",
                context.location(m),
                double,
                percent=100.0 * double / total,
                primitive=first,
                position=at,
            )
