"""Finds points of one bake's surface on another's.

Where a pair of objects has the same mesh, a point has the same triangle and the same weights in both, so that
a bake differs from itself by nothing at all, and an object that was moved is still compared with itself.
Otherwise a point is looked for near its place in the world, on a face that looks the same way.
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

# How far off a surface may be, as a share of the diagonal of the box around the object.
_REACH = 1.0e-3
# Triangles are lifted by this share of that, so that of two faces back to back the one in front is met.
_LIFT = 0.01
_ALIKE = 0.5
_LAYERS = 4
# An object without a partner is there, too, if so much of its area lies on other surfaces without one.
_PRESENT = 0.5


@dataclass(frozen=True)
class SurfacePoints:
    """Points on triangles.

    Attributes
    ----------
    triangle : (n,) int64, -1 for none
    weight : (n, 3) float64, of the triangle's corners
    """

    triangle: NDArray[np.int64]
    weight: NDArray[np.float64]

    def __getitem__(self, which: NDArray[np.bool_]) -> SurfacePoints:
        """Return some of them."""
        return SurfacePoints(self.triangle[which], self.weight[which])

    def at(self, geometry: Geometry, name: str) -> NDArray[np.float64]:
        """Return (n, k): "position" or "uv" of the points."""
        corner = getattr(geometry, name)[geometry.triangle[self.triangle]].astype(np.float64)
        return np.asarray((corner * self.weight[..., None]).sum(axis=1))


@dataclass(frozen=True)
class Sides:
    """Both bakes' surfaces and what is paired.

    Attributes
    ----------
    a, b : Geometry
    mirrored_a, mirrored_b : (I,) bool
        Instances whose triangles' corners are in the reverse order of the mesh's.
    pairs : ObjectPairs
    missing_a, missing_b : (I,) bool
        Objects that are nowhere on the other side.
    """

    a: Geometry
    b: Geometry
    mirrored_a: NDArray[np.bool_]
    mirrored_b: NDArray[np.bool_]
    pairs: ObjectPairs
    missing_a: NDArray[np.bool_]
    missing_b: NDArray[np.bool_]


def make_sides(a: Geometry, b: Geometry, scene_a: Scene, scene_b: Scene, pairs: ObjectPairs) -> Sides:
    """Find the objects that are on one side only."""
    return Sides(
        a,
        b,
        _mirrored(scene_a),
        _mirrored(scene_b),
        pairs,
        _missing(a, pairs.rest_a, len(scene_a.instances), b, pairs.rest_b),
        _missing(b, pairs.rest_b, len(scene_b.instances), a, pairs.rest_a),
    )


def match(sides: Sides, points: SurfacePoints) -> SurfacePoints:
    """Return where points of a lie on b; triangle -1 where that surface is not there."""
    a, pairs = sides.a, sides.pairs
    triangle, weight = np.full(len(points.triangle), -1, np.int64), np.zeros((len(points.triangle), 3))
    owner = a.instance[points.triangle]
    partner = pairs.partner[owner]
    equal = pairs.same[owner]
    # The triangles of an instance are one after the other, in the order of its mesh.
    first_a, first_b = (_first(geometry) for geometry in (a, sides.b))
    mine, theirs = owner[equal], partner[equal]
    triangle[equal] = points.triangle[equal] - first_a[mine] + first_b[theirs]
    turned = (sides.mirrored_a[mine] != sides.mirrored_b[theirs])[:, None]
    weight[equal] = np.where(turned, points.weight[equal][:, ::-1], points.weight[equal])
    for number in np.unique(owner[~equal & (partner >= 0)]):
        some = owner == number
        wanted = np.flatnonzero(sides.b.instance == pairs.partner[number])
        found = _near(sides.b, wanted, *_places(a, points[some]), _reach(a, a.instance == number))
        triangle[some], weight[some] = found.triangle, found.weight
    some = (partner < 0) & ~sides.missing_a[owner]
    if some.any():
        wanted = np.flatnonzero(np.isin(sides.b.instance, pairs.rest_b))
        reach = _reach(a, np.isin(a.instance, pairs.rest_a))
        found = _near(sides.b, wanted, *_places(a, points[some]), reach)
        triangle[some], weight[some] = found.triangle, found.weight
    return SurfacePoints(triangle, weight)


def _mirrored(scene: Scene) -> NDArray[np.bool_]:
    return np.array([np.linalg.det(i.world_from_object[:3, :3]) < 0 for i in scene.instances], bool)


def _first(geometry: Geometry) -> NDArray[np.int64]:
    count = int(geometry.instance.max(initial=-1)) + 1
    return np.searchsorted(geometry.instance, np.arange(count)).astype(np.int64)


def _places(geometry: Geometry, points: SurfacePoints) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    normal = geometry.face_normal[points.triangle].astype(np.float64)
    return points.at(geometry, "position"), normal


def _reach(geometry: Geometry, chosen: NDArray[np.bool_]) -> float:
    corner = geometry.position[geometry.triangle[chosen]].reshape(-1, 3).astype(np.float64)
    return _REACH * float(np.linalg.norm(corner.max(axis=0) - corner.min(axis=0)))


def _missing(
    geometry: Geometry,
    rest: NDArray[np.int64],
    n_instances: int,
    other: Geometry,
    other_rest: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """Return (I,): instances of `rest` whose triangles' middles lie on none of the other side's rest."""
    missing = np.zeros(n_instances, bool)
    missing[rest] = True
    mine = np.flatnonzero(np.isin(geometry.instance, rest))
    wanted = np.flatnonzero(np.isin(other.instance, other_rest))
    if not len(mine) or not len(wanted):
        return missing
    middle = SurfacePoints(mine, np.full((len(mine), 3), 1 / 3))
    found = _near(
        other, wanted, *_places(geometry, middle), _reach(geometry, np.isin(geometry.instance, rest))
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
    reach: float,
) -> SurfacePoints:
    """Return the nearest points on wanted triangles along the normals (n, 3) that face the same way."""
    n = len(position)
    triangle, offset = np.full(n, -1, np.int64), np.full(n, np.inf)
    if not len(wanted) or reach <= 0:
        return SurfacePoints(triangle, np.zeros((n, 3)))
    face = geometry.face_normal[wanted].astype(np.float64)
    corner = geometry.position[geometry.triangle[wanted]].astype(np.float64)
    # Single precision is finest around 0.
    centre = corner.reshape(-1, 3).mean(axis=0)
    lifted = corner - centre + _LIFT * reach * face[:, None]
    index = np.arange(3 * len(wanted), dtype=np.int32).reshape(-1, 3)
    rays = RayScene(lifted.reshape(-1, 3).astype(np.float32), index, threads=1)
    origin = (position - centre + reach * normal).astype(np.float32)
    way, far = (-normal).astype(np.float32), np.full(n, 2 * reach, np.float32)
    near = np.zeros(n, np.float32)
    going = np.arange(n)
    try:
        for _ in range(_LAYERS):
            hit, distance = np.full(len(going), -1, np.int32), np.zeros(len(going), np.float32)
            first_hits(
                new_packet_buffers(rays.tracer),
                origin[going],
                way[going],
                near[going],
                far[going],
                hit,
                distance,
            )
            going, hit, distance = going[hit >= 0], hit[hit >= 0], distance[hit >= 0]
            off = np.abs(distance.astype(np.float64) - reach)
            better = ((face[hit] * normal[going]).sum(axis=1) > _ALIKE) & (off < offset[going])
            triangle[going[better]], offset[going[better]] = hit[better], off[better]
            near[going] = distance + np.float32(1e-3 * reach)
    finally:
        rays.close()
    met = triangle >= 0
    weight = np.zeros((n, 3))
    weight[met] = _weights(corner[triangle[met]], position[met])
    return SurfacePoints(np.where(met, wanted[triangle], -1), weight)


def _weights(corner: NDArray[np.float64], position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weights (n, 3) of corners (n, 3, 3) at positions (n, 3), put on the triangle."""
    u, v, p = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0], position - corner[:, 0]
    uu, uv, vv = (u * u).sum(axis=1), (u * v).sum(axis=1), (v * v).sum(axis=1)
    pu, pv = (p * u).sum(axis=1), (p * v).sum(axis=1)
    det = np.maximum(uu * vv - uv * uv, 1e-300)
    second, third = (vv * pu - uv * pv) / det, (uu * pv - uv * pu) / det
    weight = np.maximum(np.stack([1 - second - third, second, third], axis=1), 0.0)
    return np.asarray(weight / weight.sum(axis=1, keepdims=True))
