"""Repairs of surfaces by MeshLab's filters; the only file that imports pymeshlab.

pymeshlab is under the GPL and no dependency of baker; it is imported only when a repair runs. All meshes in
this file have one vertex for each position.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from baker.core.errors import ResourceError

# Number of points on a surface at which its distance from another is measured.
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
    """Choose faces so that no edge has more than two; at an edge with more, the smallest faces are removed.

    Parameters
    ----------
    position : (P, 3) float32
    triangle : (T, 3) int64

    Returns
    -------
    (T,) bool
        The faces that stay.
    """
    _, _, origin = _apply(position, triangle, "meshing_repair_non_manifold_edges", method="Remove Faces")
    keep = np.zeros(len(triangle), bool)
    keep[origin] = True
    return keep


def orient_by_visibility(position: NDArray[np.float32], triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return the faces to flip so that fronts are on the side with the larger visibility, (T,) bool."""
    _, new, origin = _apply(position, triangle, "meshing_re_orient_faces_by_geometry", rays=64)
    flip = np.zeros(len(triangle), bool)
    old = triangle[origin]
    # Flipped faces may also start at another corner.
    start = np.argmax(new == old[:, :1], axis=1)
    flip[origin] = np.take_along_axis(new, ((start + 1) % 3)[:, None], axis=1)[:, 0] != old[:, 1]
    return flip


def close_holes(
    position: NDArray[np.float32], triangle: NDArray[np.int64], most_edges: int
) -> NDArray[np.int64]:
    """Return (K, 3) int64 new faces, of existing vertices, over holes of at most `most_edges` edges."""
    _, face, origin = _apply(
        position, triangle, "meshing_close_holes", maxholesize=most_edges, refinehole=False
    )
    return face[origin < 0]


def remesh(
    position: NDArray[np.float32], triangle: NDArray[np.int64], edge_length: float
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Return vertices and faces of the same surface in triangles of about equal sides.

    Parameters
    ----------
    position : (P, 3) float32
    triangle : (T, 3) int64
    edge_length : float
        Target length, in units of the positions.

    Returns
    -------
    position : (P', 3) float32
    triangle : (T', 3) int64

    Notes
    -----
    Hoppe, DeRose, Duchamp, McDonald, Stuetzle, Mesh Optimization, 1993; edges sharper than 30 degrees stay.
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
    """Return the largest distance of a point of one surface from another: a one-sided Hausdorff distance.

    Parameters
    ----------
    sampled, target : (position (P, 3) float32, triangle (T, 3) int64)
        Measured at all vertices of the sampled faces and at about 20 000 points of a fixed grid on them.

    Returns
    -------
    float
        In units of the positions; 0 without sampled faces.
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
    """Return values at points near a surface, from the nearest points of its faces.

    Parameters
    ----------
    position : (P, 3) float32
    triangle : (T, 3) int64
    value : (P, C) float32
    point : (Q, 3) float32

    Returns
    -------
    (Q, C) float32
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
    """Return points on (T, 3) faces, in proportion to area, corners included, (N, 3) float64."""
    corner = position[triangle].astype(np.float64)
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    # A grid of n steps along each side has about n^2 / 2 points.
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
    """Return a mesh whose face scalars are the face number plus one, so that new faces have 0."""
    return library.Mesh(
        vertex_matrix=position.astype(np.float64),
        face_matrix=triangle.astype(np.int32),
        f_scalar_array=np.arange(1, len(triangle) + 1, dtype=np.float64),
    )


def _apply(
    position: NDArray[np.float32], triangle: NDArray[np.int64], filter_name: str, **parameters: Any
) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[np.int64]]:
    """Run one filter; return vertices, faces, and the old number of each face (-1 for new ones)."""
    library = _library()
    meshes = library.MeshSet()
    meshes.add_mesh(_mesh(library, position, triangle))
    try:
        meshes.apply_filter(filter_name, **parameters)
    except library.PyMeshLabException as error:
        raise ResourceError(f"MeshLab's {filter_name} gave up: {error}", object="pymeshlab") from None
    # Copy the arrays: the mesh is freed with its set.
    mesh = meshes.current_mesh()
    mesh.compact()
    return (
        np.array(mesh.vertex_matrix(), np.float32),
        np.array(mesh.face_matrix(), np.int64),
        np.rint(np.array(mesh.face_scalar_array())).astype(np.int64) - 1,
    )
