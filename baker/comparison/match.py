"""Finds the points on the surface of bake b that match given points on the surface of bake a.

`baker.comparison.pairs` pairs the objects of both bakes. If the two objects of a pair have equal meshes, the
matching point is in the triangle with the same number and has the same barycentric weights. So the difference
of a bake from itself is exactly 0, and objects that were moved between the bakes are still compared. If the
meshes differ, or the object has no partner, the nearest surface of b is searched along the normal. It must be
within a small distance in world space, and its face must have a similar normal.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from baker.comparison.pairs import ObjectPairs
from baker.core.geometry import Geometry
from baker.core.scene import Scene
from baker.kernels.cast import first_hits
from baker.trace.embree import RayScene
from baker.trace.packets import new_packet_buffers

# Largest distance between matched points, as a share of the diagonal of the object's bounding box. For
# objects without a partner, it is the box of all such objects together.
_MAX_DISTANCE = 1.0e-3
# Distance by which triangles of b are moved along their normals, as a share of the largest distance. If two
# faces are back to back, a ray then hits the front-facing one first.
_LIFT = 0.01
# The cosine of the angle between the normals of matched faces is above this number.
_ALIKE = 0.5
# Largest number of hits that are tested along a ray.
_LAYERS = 4
# An object is reported as missing in the other bake if less than this share of its area has matching points
# there. Only objects without a partner (`baker.comparison.pairs`) are tested, and only against objects of the
# other bake that have no partner.
_PRESENT = 0.5


@dataclass(frozen=True)
class TrianglePoints:
    """n points on the triangles of a geometry.

    Attributes
    ----------
    triangle : (n,) int64
        Triangle of each point, -1 if the point does not exist.
    weight : (n, 3) float64
        Barycentric weights of the triangle's corners.
    """

    triangle: NDArray[np.int64]
    weight: NDArray[np.float64]

    def __getitem__(self, which: NDArray[np.bool_]) -> TrianglePoints:
        """Return the points that the mask `which` (n,) selects."""
        return TrianglePoints(self.triangle[which], self.weight[which])

    def at(self, geometry: Geometry, name: str) -> NDArray[np.float64]:
        """Return a vertex attribute at the points, (n, k) float64; `name` is "position" or "uv"."""
        corner = getattr(geometry, name)[geometry.triangle[self.triangle]].astype(np.float64)
        return np.asarray((corner * self.weight[..., None]).sum(axis=1))


@dataclass(frozen=True)
class ComparedSurfaces:
    """The surfaces of bakes a and b, with A and B instances, and the pairs of their objects.

    Attributes
    ----------
    a, b : Geometry
    mirrored_a, mirrored_b : (A,) and (B,) bool
        Instances whose transform mirrors the mesh. The corners of their triangles have the reverse order of
        the corners in the mesh.
    pairs : ObjectPairs
    missing_a, missing_b : (A,) and (B,) bool
        Instances whose surface is missing in the other bake, see `_PRESENT`.
    """

    a: Geometry
    b: Geometry
    mirrored_a: NDArray[np.bool_]
    mirrored_b: NDArray[np.bool_]
    pairs: ObjectPairs
    missing_a: NDArray[np.bool_]
    missing_b: NDArray[np.bool_]


def make_sides(
    a: Geometry, b: Geometry, scene_a: Scene, scene_b: Scene, pairs: ObjectPairs
) -> ComparedSurfaces:
    """Find the objects that exist in one bake only, and return them with both surfaces."""
    return ComparedSurfaces(
        a,
        b,
        _mirrored(scene_a),
        _mirrored(scene_b),
        pairs,
        _missing(a, pairs.rest_a, len(scene_a.instances), b, pairs.rest_b),
        _missing(b, pairs.rest_b, len(scene_b.instances), a, pairs.rest_a),
    )


def match(sides: ComparedSurfaces, points: TrianglePoints) -> TrianglePoints:
    """Return the points on the surface of b that match `points`, which lie on the surface of a.

    The triangle of a result is -1 if b has no matching surface.
    """
    a, pairs = sides.a, sides.pairs
    triangle, weight = np.full(len(points.triangle), -1, np.int64), np.zeros((len(points.triangle), 3))
    owner = a.instance[points.triangle]
    partner = pairs.partner[owner]
    equal = pairs.same[owner]
    # Match points on equal meshes by triangle number. The triangles of an instance are consecutive, in the
    # order of its mesh.
    first_a, first_b = (_first(geometry) for geometry in (a, sides.b))
    mine, theirs = owner[equal], partner[equal]
    triangle[equal] = points.triangle[equal] - first_a[mine] + first_b[theirs]
    turned = (sides.mirrored_a[mine] != sides.mirrored_b[theirs])[:, None]
    weight[equal] = np.where(turned, points.weight[equal][:, ::-1], points.weight[equal])
    for number in np.unique(owner[~equal & (partner >= 0)]):
        some = owner == number
        wanted = np.flatnonzero(sides.b.instance == pairs.partner[number])
        found = _near(sides.b, wanted, *_ray_starts(a, points[some]), _max_distance(a, a.instance == number))
        triangle[some], weight[some] = found.triangle, found.weight
    some = (partner < 0) & ~sides.missing_a[owner]
    if some.any():
        wanted = np.flatnonzero(np.isin(sides.b.instance, pairs.rest_b))
        max_distance = _max_distance(a, np.isin(a.instance, pairs.rest_a))
        found = _near(sides.b, wanted, *_ray_starts(a, points[some]), max_distance)
        triangle[some], weight[some] = found.triangle, found.weight
    return TrianglePoints(triangle, weight)


def _mirrored(scene: Scene) -> NDArray[np.bool_]:
    return np.array([np.linalg.det(i.world_from_object[:3, :3]) < 0 for i in scene.instances], bool)


def _first(geometry: Geometry) -> NDArray[np.int64]:
    count = int(geometry.instance.max(initial=-1)) + 1
    return np.searchsorted(geometry.instance, np.arange(count)).astype(np.int64)


def _ray_starts(
    geometry: Geometry, points: TrianglePoints
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    normal = geometry.face_normal[points.triangle].astype(np.float64)
    return points.at(geometry, "position"), normal


def _max_distance(geometry: Geometry, chosen: NDArray[np.bool_]) -> float:
    corner = geometry.position[geometry.triangle[chosen]].reshape(-1, 3).astype(np.float64)
    return _MAX_DISTANCE * float(np.linalg.norm(corner.max(axis=0) - corner.min(axis=0)))


def _missing(
    geometry: Geometry,
    rest: NDArray[np.int64],
    n_instances: int,
    other: Geometry,
    other_rest: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Return (I,) bool: the instances of `rest` whose surface is missing among `other_rest`.

    `rest` contains the instances of `geometry` without a partner, and `other_rest` the instances of `other`
    without a partner. The surface of an instance is missing if less than the share `_PRESENT` of its area has
    matching points on `other_rest`. The centroid of each triangle is tested, and represents the area of the
    triangle.
    """
    missing = np.zeros(n_instances, bool)
    missing[rest] = True
    mine = np.flatnonzero(np.isin(geometry.instance, rest))
    wanted = np.flatnonzero(np.isin(other.instance, other_rest))
    if not len(mine) or not len(wanted):
        return missing
    centroid = TrianglePoints(mine, np.full((len(mine), 3), 1 / 3))
    found = _near(
        other,
        wanted,
        *_ray_starts(geometry, centroid),
        _max_distance(geometry, np.isin(geometry.instance, rest)),
    )
    area = geometry.area[mine].astype(np.float64)
    whole = np.bincount(geometry.instance[mine], area, n_instances)
    there = np.bincount(geometry.instance[mine], area * (found.triangle >= 0), n_instances)
    return missing & (there < _PRESENT * whole)


def _near(
    geometry: Geometry,
    wanted: NDArray[np.int64],
    position: NDArray[np.float64],
    normal: NDArray[np.float64],
    max_distance: float,
) -> TrianglePoints:
    """Return, for n points, the nearest points on triangles along the points' normals.

    A ray passes through each point, from `max_distance` in front of the point to `max_distance` behind it.
    Its first `_LAYERS` hits are tested. Of the hits on faces with similar normals, the hit nearest to the
    point is returned. The triangle is -1 if there is no such hit.

    Parameters
    ----------
    geometry : Geometry
    wanted : (m,) int64
        The triangles that are searched.
    position, normal : (n, 3) float64
        The points and the unit normals of their faces.
    max_distance : float, metres
    """
    n = len(position)
    triangle, offset = np.full(n, -1, np.int64), np.full(n, np.inf)
    if not len(wanted) or max_distance <= 0:
        return TrianglePoints(triangle, np.zeros((n, 3)))
    face = geometry.face_normal[wanted].astype(np.float64)
    corner = geometry.position[geometry.triangle[wanted]].astype(np.float64)
    # Make positions relative to the mean of the triangles' corners, because float32 is most accurate near 0.
    centre = corner.reshape(-1, 3).mean(axis=0)
    lifted = corner - centre + _LIFT * max_distance * face[:, None]
    index = np.arange(3 * len(wanted), dtype=np.int32).reshape(-1, 3)
    rays = RayScene(lifted.reshape(-1, 3).astype(np.float32), index, threads=1)
    origin = (position - centre + max_distance * normal).astype(np.float32)
    direction, far = (-normal).astype(np.float32), np.full(n, 2 * max_distance, np.float32)
    near = np.zeros(n, np.float32)
    active = np.arange(n)
    try:
        for _ in range(_LAYERS):
            hit, distance = np.full(len(active), -1, np.int32), np.zeros(len(active), np.float32)
            first_hits(
                new_packet_buffers(rays.tracer),
                origin[active],
                direction[active],
                near[active],
                far[active],
                hit,
                distance,
            )
            active, hit, distance = active[hit >= 0], hit[hit >= 0], distance[hit >= 0]
            off = np.abs(distance.astype(np.float64) - max_distance)
            better = ((face[hit] * normal[active]).sum(axis=1) > _ALIKE) & (off < offset[active])
            triangle[active[better]], offset[active[better]] = hit[better], off[better]
            near[active] = distance + np.float32(1e-3 * max_distance)
    finally:
        rays.close()
    met = triangle >= 0
    weight = np.zeros((n, 3))
    weight[met] = _weights(corner[triangle[met]], position[met])
    return TrianglePoints(np.where(met, wanted[triangle], -1), weight)


def _weights(corner: NDArray[np.float64], position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return barycentric weights (n, 3) of positions (n, 3), clamped to the triangles `corner` (n, 3, 3)."""
    u, v, p = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0], position - corner[:, 0]
    uu, uv, vv = (u * u).sum(axis=1), (u * v).sum(axis=1), (v * v).sum(axis=1)
    pu, pv = (p * u).sum(axis=1), (p * v).sum(axis=1)
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    second, third = (vv * pu - uv * pv) / det, (uu * pv - uv * pu) / det
    weight = np.maximum(np.stack([1 - second - third, second, third], axis=1), 0.0)
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))
