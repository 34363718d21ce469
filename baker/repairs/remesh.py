"""Remeshes scans full of slivers into triangles of about equal sides."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baker.io.gltf.edited_primitive import ReplacedPrimitive
from baker.repairs import meshlab
from baker.repairs.primitive_edit import PrimitiveEdit
from baker.repairs.welded_mesh import WeldedMesh
from baker.topology.slivers import find_slivers

# Least share of slivers and least number of faces of a mesh to remesh: a scan, not a wall of two triangles.
MOST_SLIVERS = 0.1
FEWEST_FACES = 500


@dataclass(frozen=True)
class Remeshing:
    """A remeshed primitive.

    Attributes
    ----------
    made : ReplacedPrimitive
    n_before, n_after : int
        Slivers.
    lost : tuple of str
        Attributes that the new vertices do not have.
    """

    made: ReplacedPrimitive
    n_before: int
    n_after: int
    lost: tuple[str, ...]


def needs_remeshing(mesh: WeldedMesh) -> bool:
    """Return whether a mesh has so large a share of slivers that it is remeshed."""
    if len(mesh.triangle) < FEWEST_FACES:
        return False
    return bool(find_slivers(mesh.corner).mean() >= MOST_SLIVERS)


def remesh_primitive(mesh: WeldedMesh, edit: PrimitiveEdit) -> Remeshing:
    """Remesh a mesh of one primitive into as many equilateral triangles as it has faces.

    Parameters
    ----------
    mesh : WeldedMesh
    edit : PrimitiveEdit
        Of its only primitive, with the mesh's faces in their order. Normals and vertex colours are taken from
        the nearest points of the old surface.

    Returns
    -------
    Remeshing
    """
    corner = mesh.corner
    area = (
        0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum()
    )
    # An equilateral triangle of side s has the area sqrt(3) / 4 s^2.
    side = float(np.sqrt(4.0 / np.sqrt(3.0) * area / len(mesh.triangle)))
    position, triangle = meshlab.remesh(mesh.position, mesh.triangle, side)
    # Transfer from unshared vertices: at a crease one position has several normals.
    arrays = edit.primitive.arrays
    unshared = mesh.position[mesh.triangle].reshape(-1, 3)
    own = np.arange(len(unshared)).reshape(-1, 3)
    normal = colour = None
    if arrays.normal is not None:
        value = arrays.normal[edit.triangle] if edit.normal is None else edit.normal
        normal = meshlab.transfer(unshared, own, np.nan_to_num(value).reshape(-1, 3), position)
        normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), np.float32(1e-20))
    if arrays.colour is not None:
        value = arrays.colour[edit.triangle].reshape(-1, 4)
        colour = np.clip(meshlab.transfer(unshared, own, value, position), 0.0, 1.0)
    kept = {"POSITION", "NORMAL", "COLOR_0"}
    return Remeshing(
        ReplacedPrimitive(position, triangle, normal, colour),
        int(find_slivers(corner).sum()),
        int(find_slivers(position[triangle].astype(np.float64)).sum()),
        tuple(sorted(set(edit.primitive.column) - kept)),
    )
