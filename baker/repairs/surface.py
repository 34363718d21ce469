"""Repairs the shape of a mesh: edges of more than two faces, faces turned against others, small holes.

Faces and their vertices stay the file's own, with all attributes; patches over holes use those of the rim.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from baker.repairs import meshlab
from baker.repairs.part import Part
from baker.repairs.plan import Change, PartPlan, turn_faces
from baker.repairs.winding import count_edges, judge_winding
from baker.topology.triangle_check import usable_vertices, zero_area
from baker.topology.unique_rows import compact, first_equal
from baker.topology.weld import connected_vertices

# A hole is small up to this many edges and this share of the object's diagonal.
HOLE_EDGES = 30
HOLE_SIZE = 0.05
# Share of the object's diagonal by which a repair may move the surface, and of its area that may go.
FURTHEST = 0.01
LARGEST_LOSS = 0.01
# Cosine of the angle up to which a patch takes its rim's normals.
_SAME_SIDE = 0.7
# Share of faces without any neighbour from which a mesh is a soup.
SOUP = 0.5


@dataclass(frozen=True)
class Surface:
    """A mesh with one vertex for each place, and where its faces came from.

    Attributes
    ----------
    position : (P, 3) float32
    triangle : (T, 3) int64, places
    part : (T,) int64
    row : (T, 3) int64
        Vertex of each corner in its primitive.
    """

    position: NDArray[np.float32]
    triangle: NDArray[np.int64]
    part: NDArray[np.int64]
    row: NDArray[np.int64]

    @property
    def diagonal(self) -> float:
        """Return the diagonal of the bounding box of what the faces use."""
        used = self.position[self.triangle].reshape(-1, 3)
        return float(np.linalg.norm(used.max(axis=0) - used.min(axis=0))) if len(used) else 0.0

    def take(self, keep: NDArray[np.bool_]) -> Surface:
        """Return the surface with some of its faces."""
        return Surface(self.position, self.triangle[keep], self.part[keep], self.row[keep])


@dataclass(frozen=True)
class Repair:
    """What a repair did.

    Attributes
    ----------
    parts : tuple of PartPlan
        For `finish_part`, one for each primitive; those that were not repaired are untouched.
    before, after : Surface
    changes : tuple of Change
    left : tuple of str
    """

    parts: tuple[PartPlan, ...]
    before: Surface
    after: Surface
    changes: tuple[Change, ...]
    left: tuple[str, ...]


def join(parts: Sequence[Part]) -> Surface:
    """Return the drawn faces of all primitives as one surface."""
    start = np.cumsum([0] + [len(part.arrays.position) for part in parts])
    position = np.concatenate([part.arrays.position for part in parts])
    row = np.concatenate([part.arrays.triangle for part in parts])
    owner = np.repeat(np.arange(len(parts)), [len(part.arrays.triangle) for part in parts])
    vertex = row + start[owner][:, None]
    drawn = np.asarray(usable_vertices(position)[vertex].all(axis=1))
    drawn[drawn] = ~zero_area(position, vertex[drawn])
    kept, place = compact(first_equal([position + np.float32(0.0)], len(position)))
    return Surface(position[kept], place[vertex[drawn]], owner[drawn], row[drawn])


def repair_surface(parts: Sequence[Part]) -> Repair:
    """Repair a mesh of primitives none of which is locked.

    Parameters
    ----------
    parts : sequence of Part

    Raises
    ------
    ResourceError
        If pymeshlab is missing or gives up.
    """
    before = join(parts)
    changes: list[Change] = []
    left: list[str] = []
    surface = _manifold(before, changes, left)
    flip = _orientation(parts, surface, changes)
    turned = Surface(
        surface.position,
        np.where(flip[:, None], surface.triangle[:, [0, 2, 1]], surface.triangle),
        surface.part,
        np.where(flip[:, None], surface.row[:, [0, 2, 1]], surface.row),
    )
    after, patched = _holes(turned, changes)
    flip = np.concatenate([flip, np.zeros(len(after.triangle) - len(flip), bool)])
    touched = np.zeros(len(parts), bool)
    if changes:
        lost = np.bincount(before.part, minlength=len(parts)) != np.bincount(
            surface.part, minlength=len(parts)
        )
        touched = lost | (np.bincount(after.part, flip | patched, len(parts)) > 0)
    plans = []
    for k, part in enumerate(parts):
        own = after.part == k
        plan = turn_faces(part, after.row[own], flip[own], touched=bool(touched[k]))
        plans.append(_patch_normals(plan, patched[own], _front(after)[own]))
    return Repair(tuple(plans), before, after, tuple(changes), tuple(left))


def distance(one: Surface, two: Surface) -> float:
    """Return the Hausdorff distance of two surfaces: the furthest that a point of one is from the other.

    Faces that both have are nowhere off the other, so that only the rest has to be looked at.
    """
    furthest = 0.0
    for sampled, target in ((one, two), (two, one)):
        own = np.ones(len(sampled.triangle), bool)
        if sampled.position is target.position:
            both = np.sort(np.concatenate([target.triangle, sampled.triangle]), axis=1)
            own = first_equal([both], len(both))[len(target.triangle) :] >= len(target.triangle)
        moved = meshlab.furthest(
            (sampled.position, sampled.triangle[own]), (target.position, target.triangle)
        )
        furthest = max(furthest, moved)
    return furthest


def _manifold(surface: Surface, changes: list[Change], left: list[str]) -> Surface:
    """Take faces away until no edge belongs to more than two, unless too much would go."""
    count = count_edges(surface.triangle)
    n_bad = int((count > 2).sum())
    if not n_bad:
        return surface
    kept = surface.take(meshlab.keep_manifold(surface.position, surface.triangle))
    area = _area(surface).sum()
    loss = 1.0 - _area(kept).sum() / max(area, 1e-300)
    n_gone = len(surface.triangle) - len(kept.triangle)
    far = loss > LARGEST_LOSS or not len(kept.triangle)
    if not far:
        far = distance(surface, kept) > FURTHEST * surface.diagonal
    if far:
        left.append(
            f"{n_bad} edges belong to more than two faces; the {n_gone} faces to take away are {loss:.1%} of"
            " its area and would be missed, so they stay"
        )
        return surface
    after = int((count_edges(kept.triangle) > 2).sum())
    changes.append(Change("non-manifold-edges", "edges of more than two faces", n_bad, after))
    changes.append(Change("non-manifold-faces", "faces", len(surface.triangle), len(kept.triangle)))
    return kept


def _orientation(parts: Sequence[Part], surface: Surface, changes: list[Change]) -> NDArray[np.bool_]:
    """Return which faces to turn: towards their normals, their neighbours, or where there is most to see."""
    normal = np.zeros(surface.row.shape, np.float32)
    for k, part in enumerate(parts):
        if part.arrays.normal is not None:
            own = surface.part == k
            normal[own] = np.nan_to_num(part.arrays.normal[surface.row[own]].mean(axis=1))
    flip = judge_winding(surface.position, surface.triangle, normal, open_too=True).flip
    alone = _lonely(surface.triangle)
    if alone.mean() > SOUP:
        front = _front(surface)
        against = np.einsum("tx,tx->t", front, normal.astype(np.float64))
        if np.any(normal[alone]):
            flip = np.where(alone, against < 0, flip)
        else:
            flip = np.where(alone, meshlab.orient_by_sight(surface.position, surface.triangle), flip)
    if flip.any():
        changes.append(Change("orientation", "faces that look the wrong way", int(flip.sum()), 0))
    return np.asarray(flip)


def _holes(surface: Surface, changes: list[Change]) -> tuple[Surface, NDArray[np.bool_]]:
    """Close small holes; returns the faces that are new, too."""
    n = len(surface.triangle)
    n_open = int((count_edges(surface.triangle) == 1).sum())
    if not n_open or (count_edges(surface.triangle) > 2).any():
        return surface, np.zeros(n, bool)
    new = meshlab.close_holes(surface.position, surface.triangle, HOLE_EDGES)
    if len(new):
        new = new[_small(surface, new)]
    if not len(new):
        return surface, np.zeros(n, bool)
    # A corner of a patch takes the vertex of the face of the rim that is first at that place.
    order = np.argsort(surface.triangle.ravel(), kind="stable")
    at = order[np.searchsorted(surface.triangle.ravel()[order], new.ravel())].reshape(-1, 3)
    part = surface.part[at[:, 0] // 3]
    row = surface.row.ravel()[at]
    for k in np.flatnonzero((surface.part[at // 3] != part[:, None]).any(axis=1)):
        row[k] = _rows_in_one_part(surface, new[k], part, int(k))
    sound = (row >= 0).all(axis=1)
    new, part, row = new[sound], part[sound], row[sound]
    if not len(new):
        return surface, np.zeros(n, bool)
    after = Surface(
        surface.position,
        np.concatenate([surface.triangle, new]),
        np.concatenate([surface.part, part]),
        np.concatenate([surface.row, row]),
    )
    changes.append(Change("holes", "open edges", n_open, int((count_edges(after.triangle) == 1).sum())))
    changes.append(Change("patches", "faces", n, len(after.triangle)))
    return after, np.arange(len(after.triangle)) >= n


def _rows_in_one_part(
    surface: Surface, place: NDArray[np.int64], part: NDArray[np.int64], number: int
) -> list[int]:
    """Return rows of one primitive at three places, and note that primitive; -1 if none has all three."""
    for k in np.unique(surface.part):
        own = surface.part == k
        corner, row = surface.triangle[own].ravel(), surface.row[own].ravel()
        found = [np.flatnonzero(corner == p) for p in place]
        if all(len(f) for f in found):
            part[number] = k
            return [int(row[f[0]]) for f in found]
    return [-1, -1, -1]


def _patch_normals(plan: PartPlan, patched: NDArray[np.bool_], front: NDArray[np.float64]) -> PartPlan:
    """Give a patch its own normal where the rim's points elsewhere, as it does on a flat-shaded rim."""
    given = plan.part.arrays.normal
    if given is None or not patched.any():
        return plan
    corner = given[plan.triangle] if plan.normal is None else plan.normal
    flat = front / np.maximum(np.linalg.norm(front, axis=1, keepdims=True), 1e-300)
    apart = np.einsum("tkx,tx->tk", corner.astype(np.float64), flat) < _SAME_SIDE
    wrong = apart & patched[:, None]
    if not wrong.any():
        return plan
    made = np.where(wrong[..., None], flat[:, None, :].astype(np.float32), corner)
    return replace(plan, normal=made)


def _small(surface: Surface, new: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell which new faces belong to patches that are small against the object, (K,) bool."""
    patch = connected_vertices(new, len(surface.position))
    n = int(patch.max()) + 1
    low, high = np.full((n, 3), np.inf), np.full((n, 3), -np.inf)
    corner = surface.position[new].astype(np.float64)
    for axis in range(3):
        np.minimum.at(low[:, axis], patch, corner[..., axis].min(axis=1))
        np.maximum.at(high[:, axis], patch, corner[..., axis].max(axis=1))
    small = np.linalg.norm(high - low, axis=1) <= HOLE_SIZE * surface.diagonal
    return np.asarray(small[patch])


def _front(surface: Surface) -> NDArray[np.float64]:
    a, b, c = (surface.position[surface.triangle[:, k]].astype(np.float64) for k in range(3))
    return np.asarray(np.cross(b - a, c - a))


def _area(surface: Surface) -> NDArray[np.float64]:
    return np.asarray(0.5 * np.linalg.norm(_front(surface), axis=1))


def _lonely(triangle: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Tell which faces share no edge with another, (T,) bool."""
    start, end = triangle.ravel(), np.roll(triangle, -1, axis=1).ravel()
    key = np.minimum(start, end) * (int(triangle.max(initial=0)) + 1) + np.maximum(start, end)
    _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    return np.asarray((count[inverse].reshape(-1, 3) == 1).all(axis=1))
