"""Remeshes scans that consist largely of slivers into nearly equilateral triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from baker.io.gltf.edited_primitive import ReplacedPrimitive
from baker.repairs import meshlab
from baker.repairs.primitive_edit import PrimitiveEdit
from baker.repairs.welded_mesh import WeldedMesh
from baker.topology.slivers import find_slivers

# A mesh is remeshed if at least this share of its faces are slivers, and if it has at least this number of
# faces. The minimum number keeps modelled objects, such as a wall of two triangles, from being remeshed.
MOST_SLIVERS = 0.1
FEWEST_FACES = 500


@dataclass(frozen=True)
class Remeshing:
    """A remeshed primitive.

    Attributes
    ----------
    made : ReplacedPrimitive
        The new primitive.
    n_before, n_after : int
        Number of slivers before and after.
    lost : tuple of str
        Names of the vertex attributes that the new vertices lack.
    """

    made: ReplacedPrimitive
    n_before: int
    n_after: int
    lost: tuple[str, ...]


def needs_remeshing(mesh: WeldedMesh) -> bool:
    """Return whether a mesh has enough faces, and a large enough share of slivers, to be remeshed."""
    if len(mesh.triangle) < FEWEST_FACES:
        return False
    return bool(find_slivers(mesh.corner).mean() >= MOST_SLIVERS)


def remesh_primitive(mesh: WeldedMesh, edit: PrimitiveEdit) -> Remeshing:
    """Remesh a mesh that has one primitive.

    The target edge length is that of equilateral triangles with the same total area and number of faces.
    Normals and vertex colours are interpolated at the nearest points of the old surface.

    Parameters
    ----------
    mesh : WeldedMesh
        The mesh.
    edit : PrimitiveEdit
        The edit of the primitive. It has the same faces as the mesh, in the same order.

    Returns
    -------
    Remeshing
        The new primitive, and the attributes that it lacks.
    """
    corner = mesh.corner
    area = (
        0.5 * np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1).sum()
    )
    # Solve area / n_faces = sqrt(3) / 4 side^2, the area of an equilateral triangle.
    side = float(np.sqrt(4.0 / np.sqrt(3.0) * area / len(mesh.triangle)))
    position, triangle = meshlab.remesh(mesh.position, mesh.triangle, side)
    # Transfer from a mesh with one vertex for each corner, because a position at a crease has several
    # normals.
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
