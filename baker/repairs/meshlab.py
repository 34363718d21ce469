"""Repairs of surfaces with filters of MeshLab.

This is the only module that uses pymeshlab. pymeshlab is licensed under the GPL and is not a dependency of
baker, so it is imported only if a repair runs. The meshes have one vertex for each position, except those
that are passed to `transfer`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import ResourceError

# Approximate smallest number of points on a surface at which its distance from another surface is measured.
_DISTANCE_SAMPLES = 20000


def require_meshlab() -> None:
    """Check that repairs are possible.

    Raises
    ------
    ResourceError
        If pymeshlab is not installed.
    """
    _library()


def keep_manifold(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Choose faces to keep, so that no edge belongs to more than two faces.

    At an edge with more than two faces, the smallest faces are removed.

    Parameters
    ----------
    position : (P, 3) float32
        Vertices of the mesh.
    triangle : (T, 3) int64
        Faces of the mesh.

    Returns
    -------
    (T,) bool
        The faces to keep.
    """
    _, _, origin = _apply(position, triangle, "meshing_repair_non_manifold_edges", method="Remove Faces")
    keep = np.zeros(len(triangle), bool)
    keep[origin] = True
    return keep


def orient_by_visibility(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return (T,) bool: the faces to flip so that every front is on the side that is less occluded."""
    _, new, origin = _apply(position, triangle, "meshing_re_orient_faces_by_geometry", rays=64)
    flip = np.zeros(len(triangle), bool)
    old = triangle[origin]
    # Start both windings at the same vertex, because the filter may also change which corner comes first.
    start = np.argmax(new == old[:, :1], axis=1)
    flip[origin] = np.take_along_axis(new, ((start + 1) % 3)[:, None], axis=1)[:, 0] != old[:, 1]
    return flip


def close_holes(
    position: NDArray[np.float32], triangle: NDArray[np.int64], most_edges: int
) -> NDArray[np.int64]:
    """Return new faces (K, 3) int64 that close all holes of at most `most_edges` edges.

    The new faces use existing vertices.
    """
    _, face, origin = _apply(
        position, triangle, "meshing_close_holes", maxholesize=most_edges, refinehole=False
    )
    return face[origin < 0]


def remesh(
    position: NDArray[np.float32], triangle: NDArray[np.int64], edge_length: float
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Remesh a surface into nearly equilateral triangles. Edges sharper than 30 degrees are kept.

    Parameters
    ----------
    position : (P, 3) float32
        Vertices of the mesh.
    triangle : (T, 3) int64
        Faces of the mesh.
    edge_length : float
        Target length of the edges, in the unit of the positions.

    Returns
    -------
    position : (P', 3) float32
        New vertices.
    triangle : (T', 3) int64
        New faces.

    Notes
    -----
    Based on: Hoppe, DeRose, Duchamp, McDonald, Stuetzle, Mesh Optimization, 1993.
    """
    library = _library()
    vertex, face, _ = _apply(
        position,
        triangle,
        "meshing_isotropic_explicit_remeshing",
        iterations=6,
        targetlen=library.PureValue(edge_length),
        featuredeg=30.0,
        checksurfdist=True,
        maxsurfdist=library.PercentageValue(0.5),
    )
    return vertex, face


def largest_distance(
    sampled: tuple[NDArray[np.float32], NDArray[np.int64]],
    target: tuple[NDArray[np.float32], NDArray[np.int64]],
) -> float:
    """Return the largest distance from points on one surface to another surface.

    This is the one-sided Hausdorff distance. It is measured at all vertices of the sampled faces and at
    points of regular grids on these faces, in total at about `_DISTANCE_SAMPLES` points or more.

    Parameters
    ----------
    sampled, target : (position (P, 3) float32, triangle (T, 3) int64)
        The surface on which the points lie, and the surface to which distances are measured.

    Returns
    -------
    float
        The distance, in the unit of the positions; 0 without sampled faces.
    """
    if not len(sampled[1]):
        return 0.0
    library = _library()
    meshes = library.MeshSet()
    points = _points_on(*sampled)
    meshes.add_mesh(library.Mesh(vertex_matrix=points))
    meshes.add_mesh(_mesh(library, *target))
    found = meshes.apply_filter(
        "get_hausdorff_distance",
        sampledmesh=0,
        targetmesh=1,
        samplevert=True,
        samplenum=len(points),
        maxdist=library.PercentageValue(100),
    )
    return float(found["max"])


def transfer(
    position: NDArray[np.float32],
    triangle: NDArray[np.int64],
    value: NDArray[np.float32],
    point: NDArray[np.float32],
) -> NDArray[np.float32]:
    """Transfer vertex values of a mesh to other points, each from the nearest point on the mesh.

    Parameters
    ----------
    position : (P, 3) float32
        Vertices of the mesh.
    triangle : (T, 3) int64
        Faces of the mesh.
    value : (P, C) float32
        Values at the vertices.
    point : (Q, 3) float32
        The other points.

    Returns
    -------
    (Q, C) float32
        Interpolated values at the points.
    """
    library = _library()
    out = np.zeros((len(point), value.shape[1]), np.float32)
    for channel in range(value.shape[1]):
        meshes = library.MeshSet()
        meshes.add_mesh(
            library.Mesh(
                vertex_matrix=position.astype(np.float64),
                face_matrix=triangle.astype(np.int32),
                v_scalar_array=value[:, channel].astype(np.float64),
            )
        )
        meshes.add_mesh(library.Mesh(vertex_matrix=point.astype(np.float64)))
        meshes.apply_filter(
            "transfer_attributes_per_vertex",
            sourcemesh=0,
            targetmesh=1,
            colortransfer=False,
            qualitytransfer=True,
            upperbound=library.PercentageValue(100),
        )
        out[:, channel] = meshes.mesh(1).vertex_scalar_array()
    return out


def _points_on(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return (N, 3) float64: points of regular grids on the faces `triangle`, including all corners.

    The number of points on a face grows with its area; it is at least six.
    """
    corner = position[triangle].astype(np.float64)
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    # Choose the number n of steps along each side; a triangular grid with n steps has about n^2 / 2 points.
    steps = np.sqrt(2.0 * _DISTANCE_SAMPLES * area / max(float(area.sum()), 1e-300))
    steps = 2 ** np.ceil(np.log2(np.maximum(steps, 2.0))).astype(np.int64)
    points = []
    for n in np.unique(steps).tolist():
        i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
        inside = i + j <= n
        u, v = i[inside] / n, j[inside] / n
        weight = np.stack([1.0 - u - v, u, v], axis=1)
        points.append(np.einsum("kc,tcx->tkx", weight, corner[steps == n]).reshape(-1, 3))
    return np.concatenate(points)


def _library() -> Any:
    try:
        import pymeshlab
    except ImportError:
        message = "repairs are done by pymeshlab, which is not installed; run: pip install pymeshlab"
        raise ResourceError(message, object="pymeshlab") from None
    return pymeshlab


def _mesh(library: Any, position: NDArray[np.float32], triangle: NDArray[np.int64]) -> Any:
    """Return a mesh of pymeshlab. Face k has the scalar k + 1; faces that a filter adds have 0."""
    return library.Mesh(
        vertex_matrix=position.astype(np.float64),
        face_matrix=triangle.astype(np.int32),
        f_scalar_array=np.arange(1, len(triangle) + 1, dtype=np.float64),
    )


def _apply(
    position: NDArray[np.float32], triangle: NDArray[np.int64], filter_name: str, **parameters: Any
) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.int64]]:
    """Run one filter of MeshLab on a mesh.

    Returns the new vertices (P', 3), the new faces (T', 3), and for each new face the index of the face from
    which it was made, -1 for additional faces.
    """
    library = _library()
    meshes = library.MeshSet()
    meshes.add_mesh(_mesh(library, position, triangle))
    try:
        meshes.apply_filter(filter_name, **parameters)
    except library.PyMeshLabException as error:
        raise ResourceError(f"MeshLab's {filter_name} gave up: {error}", object="pymeshlab") from None
    # Copy the arrays, because the mesh is freed together with its mesh set.
    mesh = meshes.current_mesh()
    mesh.compact()
    return (
        np.array(mesh.vertex_matrix(), np.float32),
        np.array(mesh.face_matrix(), np.int64),
        np.rint(np.array(mesh.face_scalar_array())).astype(np.int64) - 1,
    )
