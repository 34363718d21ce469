"""Which closed parts are solids, so that nobody ever sees their inside, and which are rooms.

The rule does not ask whether materials are double-sided where the shape tells enough:

- An opaque closed part whose normals mostly point outwards is a solid (a crate, a slab, a wall, a rock).
- It is a room all the same if a lamp, a camera or an object that emits light lies inside, if it glows on both
  sides and has anything inside, if it has small holes and anything inside, or if most of the scene is inside
  (sky spheres).
- One whose normals mostly point inwards is the hollow of the solid around it (a room with thick walls), else
  a room. If it has nothing inside and does not glow, it is a solid wound the wrong way.
- An open part that a flat lid would close, wound outwards and with nothing inside (a crate without a bottom),
  is a cover: what sees nothing but its inside is hidden, for something else is the lid.

A solid has no light inside and lets none in, so what a wrong guess can hide is dark in any case.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.light_kind import light_positions
from baker.core.scene import Scene
from baker.topology.closed_parts import ClosedParts, face_areas, find_closed_parts
from baker.topology.winding_number import MANY, Enclosure

# Where the inside of a solid is, seen from a triangle.
NOWHERE, BEHIND, BEFORE = 0, 1, 2
# A part is inside another one if most of so many of its triangles' centres are and none is outside.
_WITNESSES = 8
# Winding numbers above and below which a point is inside or outside.
_INSIDE, _WITHOUT_LID, _OUTSIDE = 0.75, 0.5, 0.25
# A part that holds more than this share of the other parts' area is a room.
_MOST_OF_SCENE = 0.5
# At most so many parts are examined as holding most of the scene, and so many as being held.
_LARGEST, _HELD = 32, 64
# Faces of a part times parts that are asked whether they are in it: a second of work.
_MOST_WORK = 200_000_000


class Surfaces(NamedTuple):
    """The world's triangles.

    position (V, 3) float32, metres; triangle (T, 3) int; instance (T,) int; opaque, double_sided, glows (T,)
    bool: nothing passes, the back reflects, emits light.
    """

    position: NDArray[np.float32]
    triangle: NDArray[np.integer]
    instance: NDArray[np.integer]
    opaque: NDArray[np.bool_]
    double_sided: NDArray[np.bool_]
    glows: NDArray[np.bool_]


class Solids(NamedTuple):
    """What is solid in the world.

    Attributes
    ----------
    inside : (T,) uint8
        `BEHIND` if the inside of a solid lies behind the triangle, `BEFORE` if it lies in front of it
        (wound the wrong way), else `NOWHERE`.
    sealed : (T,) bool
        The triangle belongs to a solid without any hole.
    room : (T,) bool
        The triangle belongs to a closed part that is a room.
    cover : (T,) bool
        The triangle belongs to a cover.
    part : (T,) int32
        Part of each triangle, -1 for those that let light through.
    parts : ClosedParts
    """

    inside: NDArray[np.uint8]
    sealed: NDArray[np.bool_]
    room: NDArray[np.bool_]
    cover: NDArray[np.bool_]
    part: NDArray[np.int32]
    parts: ClosedParts


def lights_and_cameras(scene: Scene) -> NDArray[np.float64]:
    """Return where lamps and cameras are, (N, 3) float64, metres, relative to the scene's origin."""
    cameras = np.array([camera.position for camera in scene.cameras], np.float64).reshape(-1, 3)
    return np.concatenate([light_positions(scene), cameras]) - scene.origin


def find_solids(surfaces: Surfaces, places: NDArray[np.float64]) -> Solids:
    """Tell solids from rooms.

    Parameters
    ----------
    surfaces : Surfaces
    places : (N, 3) float64, metres
        Lamps and cameras, relative to the same origin as the surfaces: where one is, somebody sees.
    """
    parts = find_closed_parts(
        surfaces.position, surfaces.triangle, surfaces.instance, surfaces.opaque & (surfaces.instance >= 0)
    )
    n = len(surfaces.triangle)
    if not parts.closed.any() and not parts.lidless.any():
        none = np.zeros(n, bool)
        return Solids(np.zeros(n, np.uint8), none, none, none, parts.part, parts)
    judge = _Judge(surfaces, parts, places)
    room = judge.rooms()
    known = parts.part >= 0
    is_room, is_cover = np.zeros(n, bool), np.zeros(n, bool)
    is_room[known] = room[parts.part[known]]
    is_cover[known] = judge.covers()[parts.part[known]]
    solid = np.zeros(n, bool)
    solid[known] = (parts.closed & ~room)[parts.part[known]]
    outward = np.where(solid, parts.outward, 0)
    # A hollow is wound as a solid's surface is: its normals point out of the material.
    outward[np.isin(parts.part, judge.hollows()) & known] *= -1
    inside = np.where(outward > 0, BEHIND, np.where(outward < 0, BEFORE, NOWHERE)).astype(np.uint8)
    sealed = (inside != NOWHERE) & parts.exact[parts.part]
    return Solids(inside, sealed, is_room, is_cover, parts.part, parts)


class _Judge:
    """Decides part by part."""

    def __init__(self, surfaces: Surfaces, parts: ClosedParts, places: NDArray[np.float64]) -> None:
        self.surfaces, self.parts, self.places = surfaces, parts, places
        n = len(parts.area)
        known = np.flatnonzero(parts.part >= 0)
        of = parts.part[known]
        self.order = known[np.argsort(of, kind="stable")]
        self.start = np.searchsorted(parts.part[self.order], np.arange(n + 1))
        weight = self._areas(known)
        area = np.maximum(parts.area, 1e-300)
        # Slivers may have been left out of the area.
        self.inward = np.bincount(of, weight * (parts.outward[known] < 0), minlength=n) > 0.5 * area
        self.two_sided = np.bincount(of, weight * surfaces.double_sided[known], minlength=n) > 0.5 * area
        self.glows = np.bincount(of, surfaces.glows[known], minlength=n) > 0
        glows_behind = surfaces.glows & surfaces.double_sided
        self.glows_behind = np.bincount(of, glows_behind[known], minlength=n) > 0
        # Boxes are compared but for rounding, which follows the coordinates of each part.
        self.slack = 1e-6 * np.maximum(np.abs(parts.low), np.abs(parts.high)).max(axis=1, initial=0.0)
        self.around: dict[int, int] = {}

    def _areas(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        corner = self.surfaces.position[self.surfaces.triangle[rows]].astype(np.float64)
        return face_areas(corner)

    def hollows(self) -> NDArray[np.int64]:
        """Return the parts that are hollows of solids, known after `rooms`."""
        return np.array(sorted(self.around), np.int64)

    def rooms(self) -> NDArray[np.bool_]:
        """Return (P,) bool: closed parts that are rooms."""
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
        """Return (P,) bool: parts without a lid that hide what is under them."""
        parts = self.parts
        cover = parts.lidless & ~self.inward
        for part in np.flatnonzero(cover):
            # Black backs hide what is under them anyway.
            few = self.start[part + 1] - self.start[part] <= MANY
            cover[part] = (
                bool(self.two_sided[part] and few)
                and not self._holds_place(int(part))
                and not self._holds(int(part), None, mostly=True)
            )
        return cover

    def _outward_room(self, part: int, large: bool) -> bool:
        # A lamp may stick in the ceiling of a room, whose back would shine. Black backs make no room.
        mostly = bool(self.two_sided[part])
        if self._holds_place(part) or self._holds(part, self.glows, mostly=mostly):
            return True
        if (self.glows_behind[part] or not self.parts.exact[part]) and self._holds(part, None):
            return True
        return large and self._holds_most(part)

    def _inward_room(self, part: int) -> bool:
        if self.glows[part] or len(self.parts.area) == 1:
            return True
        return self._holds_place(part) or self._holds(part, None, mostly=True)

    def _largest(self) -> set[int]:
        """Return the few closed parts whose boxes may hold most of the scene."""
        parts = self.parts
        closed = np.flatnonzero(parts.closed & ~self.inward)
        size = np.prod(parts.high[closed] - parts.low[closed], axis=1)
        return set(closed[np.argsort(-size, kind="stable")][:_LARGEST].tolist())

    def _surface(self, part: int) -> Enclosure:
        """Return a part and its hollows, wound so that a solid counts 1."""
        corners = []
        for one in (part, *(hollow for hollow, shell in self.around.items() if shell == part)):
            rows = self.order[self.start[one] : self.start[one + 1]]
            corner = self.surfaces.position[self.surfaces.triangle[rows]].astype(np.float64)
            outward = self.parts.outward[rows] * (1 if one == part else -1)
            # Twins of the other winding would cancel the face they lie on.
            keep = outward != 0
            turned = np.where((outward < 0)[:, None, None], corner[:, ::-1], corner)
            corners.append(turned[keep])
        return Enclosure(np.concatenate(corners))

    def _holds_place(self, part: int) -> bool:
        """Tell whether a lamp or camera is inside."""
        low, high = self.parts.low[part], self.parts.high[part]
        near = self.places[((self.places > low) & (self.places < high)).all(axis=1)]
        if not len(near):
            return False
        surface, inside = self._surface(part), self._inside_from(part)
        return any(surface.winding(place) > inside for place in near)

    def _inside_from(self, part: int) -> float:
        """Return the winding number above which points are inside: 1/2 in the plane of a missing lid."""
        return _WITHOUT_LID if self.parts.lidless[part] else _INSIDE

    def _boxes_around(self, part: int, shells: NDArray[np.int64]) -> NDArray[np.bool_]:
        low, high = self.parts.low, self.parts.high
        slack = self.slack[part]
        inside = (low[shells] <= low[part] + slack) & (high[shells] >= high[part] - slack)
        found: NDArray[np.bool_] = inside.all(axis=1) & (shells != part)
        return found

    def _held_boxes(self, part: int, wanted: NDArray[np.bool_] | None, share: bool) -> NDArray[np.int64]:
        """Return parts whose boxes lie within that of a part, or share space with it."""
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
        """Tell whether another part (one of the wanted ones) is inside, at least mostly."""
        held = self._held_boxes(part, wanted, mostly)
        if not len(held):
            return False
        most = max(_HELD, _MOST_WORK // int(self.start[part + 1] - self.start[part]))
        if len(held) > most:
            held = held[np.linspace(0, len(held) - 1, most).round().astype(np.int64)]
        surface = self._surface(part)
        return any(self._is_inside(int(other), part, surface, mostly=mostly) for other in held)

    def _holds_most(self, part: int) -> bool:
        """Tell whether most of the other parts' area is inside."""
        area = self.parts.area
        others = float(area.sum() - area[part])
        held = self._held_boxes(part, None, False)
        if area[held].sum() <= _MOST_OF_SCENE * others:
            return False
        # The largest are asked, and speak for the rest.
        held = held[np.argsort(-area[held], kind="stable")][:_HELD]
        found, open_ = 0.0, float(area[held].sum())
        enough = _MOST_OF_SCENE * open_
        surface = self._surface(part)
        for other in held:
            if found > enough or found + open_ <= enough:
                break
            open_ -= float(area[other])
            found += float(area[other]) * self._is_inside(int(other), part, surface)
        return found > enough

    def _is_inside(self, part: int, shell: int, surface: Enclosure, *, mostly: bool = False) -> bool:
        """Tell whether a part lies inside another one, possibly touching it, or whether most of it does."""
        rows = self.order[self.start[part] : self.start[part + 1]]
        if mostly and self.glows[part]:
            rows = rows[self.surfaces.glows[rows]]
        chosen = rows[np.linspace(0, len(rows) - 1, min(_WITNESSES, len(rows))).round().astype(int)]
        points = self.surfaces.position[self.surfaces.triangle[chosen]].astype(np.float64).mean(axis=1)
        found, inside = 0, self._inside_from(shell)
        for point in points:
            number = surface.winding(point)
            if not mostly and number < _OUTSIDE:
                return False
            found += number > inside
        return 2 * found > len(points) if mostly else 2 * found >= len(points)
