"""Rules about single faces and vertices that a bake cannot use, and slivers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from baker.checks.context import CheckContext
from baker.checks.finding import RawFinding
from baker.checks.mesh_facts import MeshFacts
from baker.checks.rule import check
from baker.topology.slivers import find_slivers
from baker.topology.triangle_check import usable_vertices


def faces_found(
    context: CheckContext, mesh: int, faces: NDArray[np.integer], what: str, *, whole: int | None = None
) -> RawFinding:
    """Return a finding about faces of a mesh, by their numbers over all its primitives.

    Parameters
    ----------
    context : CheckContext
    mesh : int
        Index into `context.meshes`.
    faces : (n,) int
        The first one gives primitive and position.
    what : str
        The message, with `{n}` for the count and `{some}` for "1 face" or "n faces".
    whole : int or None
        Count that is 100 %; all faces of the mesh by default.

    Returns
    -------
    RawFinding
    """
    facts = context.meshes[mesh]
    n = len(faces)
    position = None
    first = faces[:1]
    if n and facts.usable[first].all():
        position = context.to_world(mesh, facts.position[facts.triangle[first[0]]].mean(axis=0))
    elif n and facts.within[first].all():
        corner = facts.position[facts.triangle[first[0]]]
        finite = usable_vertices(corner)
        position = context.to_world(mesh, corner[finite][0]) if finite.any() else None
    return RawFinding(
        what.format(n=n, some="1 face" if n == 1 else f"{n} faces"),
        context.location(mesh),
        n,
        percent=100.0 * n / max(len(facts.triangle) if whole is None else whole, 1),
        primitive=facts.primitive_of(faces),
        faces=facts.named(faces),
        position=position,
    )


def _each(context: CheckContext) -> Iterator[tuple[int, MeshFacts]]:
    yield from enumerate(context.meshes)


@check(
    "index-range",
    group="geometry",
    severity="error",
    fix="export the mesh again: its index buffer belongs to other vertices",
)
def index_range(context: CheckContext) -> Iterator[RawFinding]:
    """Faces with the index of a vertex that does not exist.

    The index buffer was made for other vertices. A bake stops with an error.
    """
    for m, facts in _each(context):
        bad = np.flatnonzero(~facts.within)
        if len(bad):
            yield faces_found(context, m, bad, "{some} with an index beyond the last vertex")


@check(
    "bad-vertices",
    group="geometry",
    severity="error",
    fix="delete or repair these vertices where the mesh was made; a bake leaves their faces out",
)
def bad_vertices(context: CheckContext) -> Iterator[RawFinding]:
    """Faces with a corner that is NaN, infinite or further away than 1e18.

    A bake leaves them out, which opens holes that let light through.
    """
    for m, facts in _each(context):
        bad = np.flatnonzero(facts.within & ~facts.usable)
        if len(bad):
            yield faces_found(context, m, bad, "{some} with NaN, infinite or huge coordinates")


@check(
    "zero-area",
    group="geometry",
    severity="warning",
    fix="dissolve degenerate faces (`fix` drops them); a bake leaves them out",
)
def zero_area_faces(context: CheckContext) -> Iterator[RawFinding]:
    """Faces without area: a line or a point.

    They are not visible and a bake leaves them out, but a collapsed face may leave a hole where a real one
    was intended. The limit is a height of 1e-7 of the longest side, below which the plane of the face
    consists of rounding errors.
    """
    for m, facts in _each(context):
        bad = np.flatnonzero(facts.flat)
        if len(bad):
            yield faces_found(context, m, bad, "{some} without area")


@check(
    "sliver-faces",
    group="geometry",
    severity="info",
    fix="remesh or retriangulate where these faces are (`repair` can, for scans)",
)
def sliver_faces(context: CheckContext) -> Iterator[RawFinding]:
    """Faces less than a fiftieth as high as long.

    A sliver has few texels: at a length of 50 texels it is less than one texel high. The
    thinner it is, the more its normal consists of rounding. By the same limit, `repair` remeshes meshes of
    500 faces or more of which a tenth are slivers.
    """
    for m, facts in _each(context):
        if not len(facts.good):
            continue
        bad = facts.good[find_slivers(facts.corner)]
        if len(bad):
            yield faces_found(context, m, bad, "{some} less than a fiftieth as high as long")


@check(
    "duplicate-faces",
    group="geometry",
    severity="warning",
    fix="remove doubles (`fix` drops them); a bake keeps the first of each",
)
def duplicate_faces(context: CheckContext) -> Iterator[RawFinding]:
    """Faces that repeat another one of the same mesh, corner by corner.

    Two surfaces at the same position shadow each other at random. A bake keeps the first of each; engines
    keep both. A face with the opposite winding is the back of the other and no duplicate, unless their
    material is double-sided.
    """
    for m, facts in _each(context):
        bad = np.flatnonzero(facts.repeated)
        if len(bad):
            yield faces_found(context, m, bad, "{some} that repeat another face")


@check(
    "no-triangles",
    group="geometry",
    severity="warning",
    fix="delete the object, or export its faces as triangles",
)
def no_triangles(context: CheckContext) -> Iterator[RawFinding]:
    """Meshes without any usable triangle.

    An error if the whole scene holds no usable triangle: a bake then refuses it.
    """
    if not any(len(facts.good) for facts in context.meshes):
        yield RawFinding("the scene holds no usable triangle: there is nothing to bake", severity="error")
        return
    for m, facts in _each(context):
        if not len(facts.good):
            yield RawFinding("the mesh has no usable triangle", context.location(m), len(facts.triangle))
