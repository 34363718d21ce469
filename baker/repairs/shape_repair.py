"""Repairs the shape of a mesh: edges of more than two faces, inconsistent winding, and small holes.

Faces and vertices keep all attributes of the file. The faces that close a hole are called its patch. Patch
faces use the vertices at the border of the hole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.repairs import meshlab
from baker.repairs.mesh_plan import Change
from baker.repairs.primitive_edit import EditablePrimitive, PrimitiveEdit, edit_with_flips
from baker.repairs.welded_mesh import WeldedMesh, distance, weld_primitives
from baker.repairs.winding import count_edges, find_wrong_winding
from baker.topology.weld import connected_vertices

# Largest hole that is closed: its number of edges, and its diagonal as a share of the mesh's diagonal.
HOLE_EDGES = 30
HOLE_SIZE = 0.05
# Largest distance by which a repair may move the surface, as a share of the mesh's diagonal.
FURTHEST = 0.01
# Largest area that may be removed, as a share of the mesh's area.
LARGEST_LOSS = 0.01
# Limit of the cosine between the normal of a patch face and a vertex normal at the border of the hole. If the
# cosine is smaller, this corner of the face gets the face normal instead of the vertex normal.
_SAME_SIDE = 0.7
# Share of faces without any neighbour above which a mesh counts as a triangle soup.
SOUP = 0.5


@dataclass(frozen=True)
class ShapeRepair:
    """The result of repairing a mesh's shape.

    Attributes
    ----------
    edits : tuple of PrimitiveEdit
        One for each primitive. `touched` is False in the edits of primitives that were not repaired.
    before, after : WeldedMesh
        The mesh before and after the repair.
    changes : tuple of Change
    left : tuple of str
        One sentence for each defect that is not repaired, with the reason.
    """

    edits: tuple[PrimitiveEdit, ...]
    before: WeldedMesh
    after: WeldedMesh
    changes: tuple[Change, ...]
    left: tuple[str, ...]


def repair_shape(primitives: Sequence[EditablePrimitive]) -> ShapeRepair:
    """Repair the shape of a mesh.

    Parameters
    ----------
    primitives : sequence of EditablePrimitive
        The primitives of the mesh. None of them may be locked.

    Returns
    -------
    ShapeRepair
        The edits, and the defects that remain.

    Raises
    ------
    ResourceError
        If pymeshlab is missing or one of its filters fails.
    """
    n = len(primitives)
    before = weld_primitives(primitives)
    changes: list[Change] = []
    left: list[str] = []
    mesh = _make_manifold(before, changes, left)
    flip = _choose_flips(primitives, mesh, changes)
    flipped = WeldedMesh(
        mesh.position,
        np.where(flip[:, None], mesh.triangle[:, [0, 2, 1]], mesh.triangle),
        mesh.owner,
        np.where(flip[:, None], mesh.row[:, [0, 2, 1]], mesh.row),
    )
    after, patched = _close_holes(flipped, changes)
    flip = np.concatenate([flip, np.zeros(len(after.triangle) - len(flip), bool)])
    touched = np.zeros(n, bool)
    if changes:
        lost = np.bincount(before.owner, minlength=n) != np.bincount(mesh.owner, minlength=n)
        touched = lost | (np.bincount(after.owner, flip | patched, n) > 0)
    edits = []
    for k, primitive in enumerate(primitives):
        own = after.owner == k
        edit = edit_with_flips(primitive, after.row[own], flip[own], touched=bool(touched[k]))
        edits.append(_patch_normals(edit, patched[own], _area_vector(after)[own]))
    return ShapeRepair(tuple(edits), before, after, tuple(changes), tuple(left))


def _make_manifold(mesh: WeldedMesh, changes: list[Change], left: list[str]) -> WeldedMesh:
    """Remove faces so that no edge belongs to more than two faces.

    The mesh is returned unchanged if this would remove too much area or move the surface too far.
    """
    count = count_edges(mesh.triangle)
    n_bad = int((count > 2).sum())
    if not n_bad:
        return mesh
    kept = mesh.take(meshlab.keep_manifold(mesh.position, mesh.triangle))
    area = _area(mesh).sum()
    loss = 1.0 - _area(kept).sum() / max(area, 1e-300)
    n_gone = len(mesh.triangle) - len(kept.triangle)
    far = loss > LARGEST_LOSS or not len(kept.triangle)
    if not far:
        far = distance(mesh, kept) > FURTHEST * mesh.diagonal
    if far:
        left.append(
            f"{n_bad} edges belong to more than two faces; the {n_gone} faces to take away are {loss:.1%} of"
            " its area and would be missed, so they stay"
        )
        return mesh
    after = int((count_edges(kept.triangle) > 2).sum())
    changes.append(Change("non-manifold-edges", "edges of more than two faces", n_bad, after))
    changes.append(Change("non-manifold-faces", "faces", len(mesh.triangle), len(kept.triangle)))
    return kept


def _choose_flips(
    primitives: Sequence[EditablePrimitive], mesh: WeldedMesh, changes: list[Change]
) -> NDArray[np.bool_]:
    """Return (T,) bool: the faces to flip.

    Connected faces are wound consistently. In a triangle soup, faces without neighbours are wound to agree
    with their vertex normals. If these faces have no normals, their fronts are put on the less occluded side.
    """
    normal = np.zeros(mesh.row.shape, np.float32)
    for k, primitive in enumerate(primitives):
        if primitive.arrays.normal is not None:
            own = mesh.owner == k
            normal[own] = np.nan_to_num(primitive.arrays.normal[mesh.row[own]].mean(axis=1))
    flip = find_wrong_winding(mesh.position, mesh.triangle, normal, open_too=True).flip
    alone = _without_neighbour(mesh.triangle)
    if alone.mean() > SOUP:
        front = _area_vector(mesh)
        against = np.einsum("tx,tx->t", front, normal.astype(np.float64))
        if np.any(normal[alone]):
            flip = np.where(alone, against < 0, flip)
        else:
            flip = np.where(alone, meshlab.orient_by_visibility(mesh.position, mesh.triangle), flip)
    if flip.any():
        changes.append(Change("orientation", "faces that look the wrong way", int(flip.sum()), 0))
    return np.asarray(flip)


def _close_holes(mesh: WeldedMesh, changes: list[Change]) -> tuple[WeldedMesh, NDArray[np.bool_]]:
    """Close small holes. Return the new mesh, and the mask (T,) of the added faces at its end."""
    n = len(mesh.triangle)
    n_open = int((count_edges(mesh.triangle) == 1).sum())
    if not n_open or (count_edges(mesh.triangle) > 2).any():
        return mesh, np.zeros(n, bool)
    new = meshlab.close_holes(mesh.position, mesh.triangle, HOLE_EDGES)
    if len(new):
        new = new[_small(mesh, new)]
    if not len(new):
        return mesh, np.zeros(n, bool)
    # For each corner of a patch, use the vertex of the first face that has a corner at the same position.
    order = np.argsort(mesh.triangle.ravel(), kind="stable")
    at = order[np.searchsorted(mesh.triangle.ravel()[order], new.ravel())].reshape(-1, 3)
    owner = mesh.owner[at[:, 0] // 3]
    row = mesh.row.ravel()[at]
    # If the three vertices of a face are of different primitives, find a primitive with all three positions.
    for k in np.flatnonzero((mesh.owner[at // 3] != owner[:, None]).any(axis=1)):
        owner[k], row[k] = _rows_of_one_primitive(mesh, new[k], int(owner[k]))
    sound = (row >= 0).all(axis=1)
    new, owner, row = new[sound], owner[sound], row[sound]
    if not len(new):
        return mesh, np.zeros(n, bool)
    after = WeldedMesh(
        mesh.position,
        np.concatenate([mesh.triangle, new]),
        np.concatenate([mesh.owner, owner]),
        np.concatenate([mesh.row, row]),
    )
    changes.append(Change("holes", "open edges", n_open, int((count_edges(after.triangle) == 1).sum())))
    changes.append(Change("patches", "faces", n, len(after.triangle)))
    return after, np.arange(len(after.triangle)) >= n


def _rows_of_one_primitive(
    mesh: WeldedMesh, vertex: NDArray[np.int64], owner: int
) -> tuple[int, tuple[int, ...]]:
    """Return the first primitive that has vertices at three positions, and the indices of these vertices.

    `vertex` (3,) are welded vertices. Without such a primitive, `owner` and three times -1 are returned.
    """
    for k in np.unique(mesh.owner):
        own = mesh.owner == k
        corner, row = mesh.triangle[own].ravel(), mesh.row[own].ravel()
        found = [np.flatnonzero(corner == v) for v in vertex]
        if all(len(f) for f in found):
            return int(k), tuple(int(row[f[0]]) for f in found)
    return owner, (-1, -1, -1)


def _patch_normals(
    edit: PrimitiveEdit, patched: NDArray[np.bool_], front: NDArray[np.float64]
) -> PrimitiveEdit:
    """Replace vertex normals of patch faces by the face normal, if the angle between them is too large.

    `patched` (T,) marks the patch faces, and `front` (T, 3) are the area vectors of all faces.
    """
    given = edit.primitive.arrays.normal
    if given is None or not patched.any():
        return edit
    corner = given[edit.triangle] if edit.normal is None else edit.normal
    flat = front / np.maximum(np.linalg.norm(front, axis=1, keepdims=True), 1e-300)
    apart = np.einsum("tkx,tx->tk", corner.astype(np.float64), flat) < _SAME_SIDE
    wrong = apart & patched[:, None]
    if not wrong.any():
        return edit
    made = np.where(wrong[..., None], flat[:, None, :].astype(np.float32), corner)
    return replace(edit, normal=made)


def _small(mesh: WeldedMesh, new: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return (K,) bool: the new faces (K, 3) of patches that are small enough, see `HOLE_SIZE`."""
    patch = connected_vertices(new, len(mesh.position))
    n = int(patch.max()) + 1
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    corner = mesh.position[new].astype(np.float64)
    for axis in range(3):
        np.minimum.at(low[:, axis], patch, corner[..., axis].min(axis=1))
        np.maximum.at(high[:, axis], patch, corner[..., axis].max(axis=1))
    small = np.linalg.norm(high - low, axis=1) <= HOLE_SIZE * mesh.diagonal
    return np.asarray(small[patch])


def _area_vector(mesh: WeldedMesh) -> NDArray[np.float64]:
    """Return the face normals, scaled by twice the area, (T, 3) float64."""
    a, b, c = (mesh.position[mesh.triangle[:, k]].astype(np.float64) for k in range(3))
    return np.asarray(np.cross(b - a, c - a))


def _area(mesh: WeldedMesh) -> NDArray[np.float64]:
    return np.asarray(0.5 * np.linalg.norm(_area_vector(mesh), axis=1))


def _without_neighbour(triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return (T,) bool: the faces (T, 3) that share no edge with another face."""
    start, end = triangle.ravel(), np.roll(triangle, -1, axis=1).ravel()
    key = np.minimum(start, end) * (int(triangle.max(initial=0)) + 1) + np.maximum(start, end)
    _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    return np.asarray((count[inverse].reshape(-1, 3) == 1).all(axis=1))
