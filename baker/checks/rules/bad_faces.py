"""Reports faces and vertices that a bake cannot use, and slivers."""

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
    """Return a finding about faces of a mesh.

    Parameters
    ----------
    context : CheckContext
        The scene.
    mesh : int
        Index into `context.meshes`.
    faces : (n,) int
        Indices of the faces in the mesh. The primitive of the finding is that of the first face. The position
        is the centroid of the first face, or its first usable corner if not all its corners are usable.
    what : str
        The message. `{n}` is replaced by n, and `{some}` by "1 face" or "n faces".
    whole : int or None
        The number of faces that is 100 %. By default, it is the number of all faces of the mesh.

    Returns
    -------
    RawFinding
        The finding, with count, percentage, position (if there is one) and the numbers of the first faces.
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
    """Faces that refer to a vertex that does not exist.

    The index buffer was probably made for other vertices. A bake stops with an error.
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
    """Faces with a corner that has a NaN or infinite coordinate, or one with a magnitude above 1e18.

    A bake leaves these faces out. Light leaks through the holes.
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
    """Faces without area, collapsed to a line or a point.

    Such faces are invisible, and a bake leaves them out. If the face was meant to have an area, there is a
    hole instead. A face counts as having no area if its height is at most 1e-7 times its longest side,
    because rounding errors then determine its normal.
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
    """Slivers: faces whose height is less than a fiftieth of their longest side.

    A sliver up to 50 texels long is less than one texel high. The thinner a sliver is, the larger is the
    rounding error of its normal. `repair` uses the same limit: it remeshes meshes of at least 500 faces if a
    tenth of the faces are slivers.
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
    """Faces with the same three positions as an earlier face of the mesh.

    Two surfaces at the same position shadow each other at random. A bake keeps only the first face, but
    engines keep both. Two faces with opposite winding usually are front and back of a sheet. The second of
    them is reported only if both have the same double-sided material.
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

    It is an error if the whole scene has no usable triangle, because a bake refuses such a scene.
    """
    if not any(len(facts.good) for facts in context.meshes):
        yield RawFinding("the scene holds no usable triangle: there is nothing to bake", severity="error")
        return
    for m, facts in _each(context):
        if not len(facts.good):
            yield RawFinding("the mesh has no usable triangle", context.location(m), len(facts.triangle))
