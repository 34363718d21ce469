"""Classifies parts as solids, whose inside is never visible, rooms, whose inside is visible, and covers.

A part is a set of connected triangles, see `topology.closed_parts`. Triangles that let light through are
ignored.

A closed part whose normals mostly point outwards (a crate, a slab, a wall, a rock) is a room if at least one
of these conditions holds. Otherwise it is a solid.

- A light, a camera or an emitting part is inside.
- It emits on both sides, and another part is inside.
- It has small holes, and another part is inside.
- Most of the scene is inside (the part is a sky sphere).

A closed part whose normals mostly point inwards is a hollow if it lies in a solid; the hollow is the inside
of a room with thick walls, for example. Otherwise it is a room if at least one of these conditions holds. If
none holds, it is a solid that is wound inwards.

- It emits.
- A light, a camera or another part is inside.
- It is the only part.

An open part of at most `winding_number.MANY` triangles is a cover (a crate without a bottom) if a flat lid
would close it, it is double-sided, its normals point outwards, and no light, camera or other part is inside.
If all rays of a point hit the inside of a cover, the point is hidden, because another surface closes the
opening.

No light is inside a solid, and none enters it. So if a room is classified as a solid by mistake, the error is
small: without light, the room is dark in any case.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import light_positions
from baker.core.scene import Scene
from baker.topology.closed_parts import ClosedParts, face_areas, find_closed_parts
from baker.topology.winding_number import MANY, Enclosure

# Values of `Solids.inside`: NOWHERE if the triangle is not part of a solid, BEHIND if the inside of the solid
# is at its back, BEFORE if the inside is at its front.
NOWHERE, BEHIND, BEFORE = 0, 1, 2
# Number of triangle centres of a part that are tested for being inside another part, see `_is_inside`.
_WITNESSES = 8
# Winding numbers of a point. Above _INSIDE, the point is inside a closed part. Above _WITHOUT_LID, it is
# inside a part without a lid. Below _OUTSIDE, it is outside of either.
_INSIDE, _WITHOUT_LID, _OUTSIDE = 0.75, 0.5, 0.25
# Limit of the area of the parts inside a part, as a share of the area of all other parts. Above this limit,
# the part is a room.
_MOST_OF_SCENE = 0.5
# _LARGEST: number of parts, those with the largest bounding boxes, that are tested for containing most of the
# scene.
# _HELD: number of parts within such a box that are tested for being inside.
_LARGEST, _HELD = 32, 64
# Upper limit of the number of faces of a part times the number of parts that are tested for being inside this
# part. This limit bounds the time. At least _HELD parts are tested.
_MOST_WORK = 200_000_000


class SolidSurfaces(NamedTuple):
    """All triangles of a scene.

    Attributes
    ----------
    position : (V, 3) float32
        Vertices, metres, world.
    triangle : (T, 3) int
        Indices of the triangles' vertices.
    instance : (T,) int
        Object of each triangle; negative for triangles to leave out.
    opaque : (T,) bool
        Whether no light passes through the triangle.
    double_sided : (T,) bool
        Whether the back of the triangle reflects.
    emits : (T,) bool
        Whether the triangle emits light.
    """

    position: NDArray[np.float32]
    triangle: NDArray[np.integer]
    instance: NDArray[np.integer]
    opaque: NDArray[np.bool_]
    double_sided: NDArray[np.bool_]
    emits: NDArray[np.bool_]


class Solids(NamedTuple):
    """Classification of all T triangles of a scene.

    Attributes
    ----------
    inside : (T,) uint8
        `BEHIND` if the inside of a solid is at the triangle's back, `BEFORE` if it is at its front (wound
        inwards), else `NOWHERE`.
    sealed : (T,) bool
        Whether the triangle is part of a solid without any hole.
    room : (T,) bool
        Whether the triangle is part of a room.
    cover : (T,) bool
        Whether the triangle is part of a cover.
    part : (T,) int32
        Part of each triangle, -1 for triangles that were left out, see `ClosedParts.part`.
    parts : ClosedParts
        All parts.
    """

    inside: NDArray[np.uint8]
    sealed: NDArray[np.bool_]
    room: NDArray[np.bool_]
    cover: NDArray[np.bool_]
    part: NDArray[np.int32]
    parts: ClosedParts


def lights_and_cameras(scene: Scene) -> NDArray[np.float64]:
    """Return the positions of lights and cameras. A closed part around a light or a camera is a room.

    Parameters
    ----------
    scene : Scene
        The scene. Its lights without a position are left out.

    Returns
    -------
    (N, 3) float64, metres
        Positions, relative to the scene's origin.
    """
    cameras = np.array([camera.position for camera in scene.cameras], np.float64).reshape(-1, 3)
    return np.concatenate([light_positions(scene), cameras]) - scene.origin


def find_solids(surfaces: SolidSurfaces, viewpoints: NDArray[np.float64]) -> Solids:
    """Classify parts as solids, rooms and covers.

    Parameters
    ----------
    surfaces : SolidSurfaces
        All triangles.
    viewpoints : (N, 3) float64, metres
        Positions of lights and cameras, relative to the origin of the surfaces.

    Returns
    -------
    Solids
        Classification of each triangle.
    """
    parts = find_closed_parts(
        surfaces.position, surfaces.triangle, surfaces.instance, surfaces.opaque & (surfaces.instance >= 0)
    )
    n = len(surfaces.triangle)
    if not parts.closed.any() and not parts.lidless.any():
        none = np.zeros(n, bool)
        return Solids(np.zeros(n, np.uint8), none, none, none, parts.part, parts)
    classifier = _Classifier(surfaces, parts, viewpoints)
    room = classifier.rooms()
    in_part = parts.part >= 0
    is_room, is_cover = np.zeros(n, bool), np.zeros(n, bool)
    is_room[in_part] = room[parts.part[in_part]]
    is_cover[in_part] = classifier.covers()[parts.part[in_part]]
    solid = np.zeros(n, bool)
    solid[in_part] = (parts.closed & ~room)[parts.part[in_part]]
    outward = np.where(solid, parts.outward, 0)
    # The space that a hollow encloses is outside the solid, so reverse its sign.
    outward[np.isin(parts.part, classifier.hollows()) & in_part] *= -1
    inside = np.where(outward > 0, BEHIND, np.where(outward < 0, BEFORE, NOWHERE)).astype(np.uint8)
    sealed = (inside != NOWHERE) & parts.watertight[parts.part]
    return Solids(inside, sealed, is_room, is_cover, parts.part, parts)


class _Classifier:
    """Classifies the parts of a scene one after the other.

    `order[start[p] : start[p + 1]]` are the triangles of part p. `around` maps each hollow to its solid.
    """

    def __init__(self, surfaces: SolidSurfaces, parts: ClosedParts, viewpoints: NDArray[np.float64]) -> None:
        self.surfaces, self.parts, self.viewpoints = surfaces, parts, viewpoints
        n = len(parts.area)
        in_part = np.flatnonzero(parts.part >= 0)
        of = parts.part[in_part]
        self.order = in_part[np.argsort(of, kind="stable")]
        self.start = np.searchsorted(parts.part[self.order], np.arange(n + 1))
        weight = self._areas(in_part)
        area = np.maximum(parts.area, 1e-300)
        # Compare with half of `ClosedParts.area`, in which slivers may be missing.
        self.inward = np.bincount(of, weight * (parts.outward[in_part] < 0), minlength=n) > 0.5 * area
        self.two_sided = np.bincount(of, weight * surfaces.double_sided[in_part], minlength=n) > 0.5 * area
        self.emits = np.bincount(of, surfaces.emits[in_part], minlength=n) > 0
        emits_behind = surfaces.emits & surfaces.double_sided
        self.emits_behind = np.bincount(of, emits_behind[in_part], minlength=n) > 0
        # Set the tolerance for comparing boxes. It grows with the coordinates of a part, as rounding does.
        self.slack = 1e-6 * np.maximum(np.abs(parts.low), np.abs(parts.high)).max(axis=1, initial=0.0)
        self.around: dict[int, int] = {}

    def _areas(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the areas of the triangles with indices `rows` (n,): (n,) float64, m2."""
        corner = self.surfaces.position[self.surfaces.triangle[rows]].astype(np.float64)
        return face_areas(corner)

    def hollows(self) -> NDArray[np.int64]:
        """Return the parts that are hollows of solids, which `rooms` finds first."""
        return np.array(sorted(self.around), np.int64)

    def rooms(self) -> NDArray[np.bool_]:
        """Return (P,) bool: the closed parts that are rooms. Also find hollows."""
        parts = self.parts
        room = np.zeros(len(parts.area), bool)
        outward = np.flatnonzero(parts.closed & ~self.inward)
        inward = np.flatnonzero(parts.closed & self.inward)
        for part in inward:
            shells = outward[self._boxes_around(int(part), outward)]
            shells = shells[np.argsort(np.prod(parts.high[shells] - parts.low[shells], axis=1))]
            for shell in shells:
                if self._is_inside(int(part), int(shell), self._surface(int(shell))):
                    self.around[int(part)] = int(shell)
                    break
        largest = self._largest()
        for part in outward:
            room[part] = self._outward_room(int(part), int(part) in largest)
        for part in inward:
            shell = self.around.get(int(part))
            if shell is not None and not room[shell]:
                continue
            self.around.pop(int(part), None)
            room[part] = self._inward_room(int(part))
        return room

    def covers(self) -> NDArray[np.bool_]:
        """Return (P,) bool: the parts without a lid that are covers."""
        parts = self.parts
        cover = parts.lidless & ~self.inward
        for part in np.flatnonzero(cover):
            # Exclude one-sided parts, whose backs are black in any case.
            is_small = self.start[part + 1] - self.start[part] <= MANY
            cover[part] = (
                bool(self.two_sided[part] and is_small)
                and not self._holds_viewpoint(int(part))
                and not self._holds(int(part), None, mostly=True)
            )
        return cover

    def _outward_room(self, part: int, large: bool) -> bool:
        """Return whether a closed part with normals outwards is a room.

        large : whether the part is in the result of `_largest`
        """
        # If the walls are double-sided, the part is a room if an emitter is mostly inside, because the
        # emitter may be set into the ceiling. If they are one-sided, the whole emitter must be inside.
        mostly = bool(self.two_sided[part])
        if self._holds_viewpoint(part) or self._holds(part, self.emits, mostly=mostly):
            return True
        if (self.emits_behind[part] or not self.parts.watertight[part]) and self._holds(part, None):
            return True
        return large and self._holds_most(part)

    def _inward_room(self, part: int) -> bool:
        """Return whether a closed part with normals inwards, which is not a hollow, is a room."""
        if self.emits[part] or len(self.parts.area) == 1:
            return True
        return self._holds_viewpoint(part) or self._holds(part, None, mostly=True)

    def _largest(self) -> set[int]:
        """Return those `_LARGEST` closed parts with normals outwards that have the largest bounding boxes."""
        parts = self.parts
        closed = np.flatnonzero(parts.closed & ~self.inward)
        size = np.prod(parts.high[closed] - parts.low[closed], axis=1)
        return set(closed[np.argsort(-size, kind="stable")][:_LARGEST].tolist())

    def _surface(self, part: int) -> Enclosure:
        """Return the faces of a part and of its hollows, wound so that the winding number inside is 1."""
        corners = []
        for one in (part, *(hollow for hollow, shell in self.around.items() if shell == part)):
            rows = self.order[self.start[one] : self.start[one + 1]]
            corner = self.surfaces.position[self.surfaces.triangle[rows]].astype(np.float64)
            outward = self.parts.outward[rows] * (1 if one == part else -1)
            # Leave out faces that do not bound the enclosed space, such as pairs with opposite windings.
            keep = outward != 0
            turned = np.where((outward < 0)[:, None, None], corner[:, ::-1], corner)
            corners.append(turned[keep])
        return Enclosure(np.concatenate(corners))

    def _holds_viewpoint(self, part: int) -> bool:
        """Return whether a light or camera is inside a part."""
        low, high = self.parts.low[part], self.parts.high[part]
        near = self.viewpoints[((self.viewpoints > low) & (self.viewpoints < high)).all(axis=1)]
        if not len(near):
            return False
        surface, inside = self._surface(part), self._inside_from(part)
        return any(surface.winding(viewpoint) > inside for viewpoint in near)

    def _inside_from(self, part: int) -> float:
        """Return the winding number above which points are inside a part.

        For a part without a lid, this number is 1/2, the winding number in the plane of the missing lid.
        """
        return _WITHOUT_LID if self.parts.lidless[part] else _INSIDE

    def _boxes_around(self, part: int, shells: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return which of the parts `shells` have a bounding box that contains the box of `part`."""
        low, high = self.parts.low, self.parts.high
        slack = self.slack[part]
        inside = (low[shells] <= low[part] + slack) & (high[shells] >= high[part] - slack)
        found: NDArray[np.bool_] = inside.all(axis=1) & (shells != part)
        return found

    def _held_boxes(self, part: int, wanted: NDArray[np.bool_] | None, share: bool) -> NDArray[np.int64]:
        """Return the parts whose bounding boxes lie in the box of `part` or, with `share`, overlap it.

        Hollows of `part` are left out.

        wanted : (P,) bool, parts to consider; None means all
        """
        low, high = self.parts.low, self.parts.high
        if share:
            inside = ((low < high[part]) & (high > low[part])).all(axis=1)
        else:
            slack = self.slack[:, None]
            inside = ((low >= low[part] - slack) & (high <= high[part] + slack)).all(axis=1)
        inside[part] = False
        for hollow, shell in self.around.items():
            inside[hollow] &= shell != part
        return np.flatnonzero(inside if wanted is None else inside & wanted)

    def _holds(self, part: int, wanted: NDArray[np.bool_] | None, *, mostly: bool = False) -> bool:
        """Return whether any other part is inside `part` or, with `mostly`, mostly inside.

        wanted : (P,) bool, parts to consider; None means all
        """
        held = self._held_boxes(part, wanted, mostly)
        if not len(held):
            return False
        most = max(_HELD, _MOST_WORK // int(self.start[part + 1] - self.start[part]))
        if len(held) > most:
            held = held[np.linspace(0, len(held) - 1, most).round().astype(np.int64)]
        surface = self._surface(part)
        return any(self._is_inside(int(other), part, surface, mostly=mostly) for other in held)

    def _holds_most(self, part: int) -> bool:
        """Return whether more than `_MOST_OF_SCENE` of the other parts' area is inside `part`.

        The parts whose bounding boxes lie in the box of `part` must have that share of the area. Of these
        parts, the `_HELD` largest are tested, and more than that share of their area must be inside.
        """
        area = self.parts.area
        others = float(area.sum() - area[part])
        held = self._held_boxes(part, None, False)
        if area[held].sum() <= _MOST_OF_SCENE * others:
            return False
        # Test only the parts with the largest area.
        held = held[np.argsort(-area[held], kind="stable")][:_HELD]
        found, remaining = 0.0, float(area[held].sum())
        enough = _MOST_OF_SCENE * remaining
        surface = self._surface(part)
        for other in held:
            if found > enough or found + remaining <= enough:
                break
            remaining -= float(area[other])
            found += float(area[other]) * self._is_inside(int(other), part, surface)
        return found > enough

    def _is_inside(self, part: int, shell: int, surface: Enclosure, *, mostly: bool = False) -> bool:
        """Return whether `part` is inside `shell`, which it may touch.

        Up to `_WITNESSES` triangle centres of `part` are tested. At least half of them must be inside, and
        none outside. With `mostly`, it is sufficient that more than half are inside, and if `part` emits,
        only its emitting triangles are tested.

        surface : faces of `shell`
        """
        rows = self.order[self.start[part] : self.start[part + 1]]
        if mostly and self.emits[part]:
            rows = rows[self.surfaces.emits[rows]]
        chosen = rows[np.linspace(0, len(rows) - 1, min(_WITNESSES, len(rows))).round().astype(int)]
        points = self.surfaces.position[self.surfaces.triangle[chosen]].astype(np.float64).mean(axis=1)
        found, inside = 0, self._inside_from(shell)
        for point in points:
            number = surface.winding(point)
            if not mostly and number < _OUTSIDE:
                return False
            found += number > inside
        return 2 * found > len(points) if mostly else 2 * found >= len(points)
