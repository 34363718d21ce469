"""Makes the parts of game levels: slabs, sheets, walls with openings, terrain, rocks, textures."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from glb import GlbBuilder
from numpy.typing import NDArray
from shapes import FACES, Point, Surface, ball, box_faces, join, quads

# Base colours of the materials of levels, linear.
PLASTER, CONCRETE, WOOD, BLACK = (0.7, 0.7, 0.68), (0.45, 0.45, 0.45), (0.45, 0.3, 0.18), (0.0, 0.0, 0.0)


@dataclass
class Level:
    """A game level: a scene and its sky, which a glTF file cannot contain.

    Attributes
    ----------
    sky : 3 floats
        Radiance of the sky, cd/m2.
    glb : GlbBuilder
        The scene.
    emitters : list of str
        Names of the emissive materials that were added.
    """

    sky: tuple[float, float, float] = (0.0, 0.0, 0.0)
    glb: GlbBuilder = field(default_factory=GlbBuilder)
    emitters: list[str] = field(default_factory=list)

    def put(
        self, name: str, surface: Surface, material: str, at: Point = (0.0, 0.0, 0.0), **how: float
    ) -> None:
        """Add a surface as a new object."""
        self.glb.place(name, self.glb.mesh(name, [(surface, material)]), at, **how)


def slab(low: Point, high: Point, faces: tuple[str, ...] = FACES) -> Surface:
    """Return faces of the axis-aligned box between two opposite corners; fronts point outwards."""
    face = box_faces(low, high)
    return quads([face[name] for name in faces])


def inside(low: Point, high: Point, faces: tuple[str, ...] = FACES) -> Surface:
    """Return faces of the axis-aligned box between two opposite corners; fronts point inwards."""
    face = box_faces(low, high)
    return quads([face[name][::-1] for name in faces])


def sheet(corner: Point, u: Point, v: Point, cells: tuple[int, int] = (1, 1)) -> Surface:
    """Return a rectangle with uv, given by a corner and its edge vectors u and v. Its front faces u x v."""
    a, b = np.meshgrid(np.linspace(0, 1, cells[0] + 1), np.linspace(0, 1, cells[1] + 1), indexing="ij")
    share = np.stack([a.ravel(), b.ravel()], axis=1)
    position = np.array(corner) + share[:, :1] * np.array(u) + share[:, 1:] * np.array(v)
    normal = np.cross(u, v) / np.linalg.norm(np.cross(u, v))
    return Surface(position, np.tile(normal, (len(position), 1)), _grid(*cells), share * [1, -1] + [0, 1])


def _grid(n: int, m: int) -> NDArray[np.int64]:
    index = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def wall(low: Point, high: Point, *holes: tuple[float, float, float, float]) -> Surface:
    """Return a solid wall with openings, made of adjacent boxes, as in modular kits.

    Parameters
    ----------
    low, high : Point
        Opposite corners of the wall, metres. The wall runs along x or z, whichever extent is larger.
    holes : (start, bottom, end, top)
        The openings, in world metres: start and end along the wall, bottom and top along y. They are sorted
        by start.
    """
    along = 0 if high[0] - low[0] > high[2] - low[2] else 2

    def part(start: float, bottom: float, end: float, top: float) -> Surface | None:
        if end - start < 1e-6 or top - bottom < 1e-6:
            return None
        a, b = list(low), list(high)
        a[along], b[along], a[1], b[1] = start, end, bottom, top
        return slab((a[0], a[1], a[2]), (b[0], b[1], b[2]))

    parts, here = [], low[along]
    for start, bottom, end, top in holes:
        parts += [part(here, low[1], start, high[1]), part(start, low[1], end, bottom)]
        parts.append(part(start, top, end, high[1]))
        here = end
    parts.append(part(here, low[1], high[along], high[1]))
    return join(*(p for p in parts if p is not None))


def house(
    level: Level,
    name: str,
    middle: tuple[float, float],
    size: Point,
    material: str,
    *,
    thick: float = 0.2,
    foot: float = 0.0,
    holes: dict[str, tuple[float, float, float, float]] | None = None,
) -> None:
    """Add a house of four walls and a flat roof, which intersects the walls.

    The ends of the walls at -x and +x lie inside the other two walls.

    Parameters
    ----------
    middle : (x, z)
        Centre of the room, metres.
    size : Point
        Size of the room, metres.
    foot : float
        y of the lower ends of the walls, metres.
    holes : dict of str to (start, bottom, end, top)
        The opening of a wall, by its side "-x", "+x", "-z" or "+z". Start and end are relative to `middle`.
    """
    x, z = middle
    a, h, b = size[0] / 2, size[1], size[2] / 2
    t, holes = thick, holes or {}
    sides = {
        "-z": ((x - a - t, foot, z - b - t), (x + a + t, h, z - b), x),
        "+z": ((x - a - t, foot, z + b), (x + a + t, h, z + b + t), x),
        "-x": ((x - a - t, foot, z - b - t / 2), (x - a, h, z + b + t / 2), z),
        "+x": ((x + a, foot, z - b - t / 2), (x + a + t, h, z + b + t / 2), z),
    }
    for side, (low, high, at) in sides.items():
        opening = (
            [(s + at, bottom, e + at, top) for s, bottom, e, top in [holes[side]]] if side in holes else []
        )
        level.put(f"{name} wall {side}", wall(low, high, *opening), material)
    roof = slab((x - a - 2 * t, h - t / 4, z - b - 2 * t), (x + a + 2 * t, h + t, z + b + 2 * t))
    level.put(f"{name} roof", roof, material)


def terrain(size: float, cells: int) -> Surface:
    """Return a square of rolling ground around the origin. The function `height` gives its heights."""
    flat = sheet((-size / 2, 0, -size / 2), (0, 0, size), (size, 0, 0), (cells, cells))
    x, z = flat.position[:, 0], flat.position[:, 2]
    position = np.stack([x, height(x, z), z], axis=1).round(4)
    slope = np.stack([-_slope(x, z, 0), np.ones_like(x), -_slope(x, z, 2)], axis=1)
    normal = slope / np.linalg.norm(slope, axis=1, keepdims=True)
    return Surface(position, normal.round(5), flat.triangle)


def height(x: NDArray[np.float64], z: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the height of the terrain at (x, z), metres."""
    return np.asarray(0.5 * np.sin(0.45 * x) * np.cos(0.35 * z) + 0.15 * np.sin(1.1 * x + 0.7 * z))


def _slope(x: NDArray[np.float64], z: NDArray[np.float64], axis: int) -> NDArray[np.float64]:
    step = 1e-4
    ahead = height(x + step, z) if axis == 0 else height(x, z + step)
    return np.asarray((ahead - height(x, z)) / step)


def rock(radius: float, seed: int, subdivisions: int = 2) -> Surface:
    """Return a rock: a sphere whose radius is modulated by five random waves."""
    rng = np.random.default_rng(seed)
    sphere = ball(1.0, subdivisions)
    far = np.ones(len(sphere.position))
    for _ in range(5):
        wave, phase = rng.normal(0, 1.8, 3), rng.random() * 2 * math.pi
        far += 0.11 * np.sin(sphere.position @ wave + phase)
    return smooth((radius * far[:, None] * sphere.position).round(4), sphere.triangle)


def smooth(position: NDArray[np.float64], triangle: NDArray[np.int64]) -> Surface:
    """Return a surface whose vertex normals are the area-weighted means of face normals."""
    corner = position[triangle]
    face = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal = np.zeros_like(position)
    for k in range(3):
        np.add.at(normal, triangle[:, k], face)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    return Surface(position, normal.round(5), triangle)


def crossed(width: float, high: float, cards: int) -> Surface:
    """Return upright rectangles (billboards) that intersect each other in the y axis. They have uv."""
    parts = []
    for k in range(cards):
        c, s = round(math.cos(math.pi * k / cards), 7), round(math.sin(math.pi * k / cards), 7)
        parts.append(sheet((-c * width / 2, 0, -s * width / 2), (c * width, 0, s * width), (0, high, 0)))
    return join(*parts)


def leaf_picture(size: int = 32) -> NDArray[np.uint8]:
    """Return a texture of leaves, (size, size, 4) uint8: opaque discs, transparent between them."""
    row, column = np.mgrid[:size, :size]
    there = ((row % 8 - 3.5) ** 2 + (column % 8 - 3.5 + (row // 8 % 2) * 0.5) ** 2) < 11
    picture = np.zeros((size, size, 4), np.uint8)
    picture[..., :3] = (90, 140, 60)
    picture[..., 3] = np.where(there, 255, 0)
    return picture


def glass_picture(size: int = 16) -> NDArray[np.uint8]:
    """Return a texture of stained glass, (size, size, 4) uint8: coloured squares between opaque lead."""
    colours = np.array([(230, 60, 40), (50, 90, 220), (240, 200, 60), (60, 180, 90)], np.uint8)
    row, column = np.mgrid[:size, :size]
    picture = np.zeros((size, size, 4), np.uint8)
    picture[..., :3] = colours[(row // 4 + 2 * (column // 4)) % 4]
    picture[..., 3] = 140
    lead = (row % 4 == 0) | (column % 4 == 0)
    picture[lead] = (40, 40, 40, 255)
    return picture


def led_picture(size: int = 64, step: int = 16) -> NDArray[np.uint8]:
    """Return a black texture, (size, size, 3) uint8, with one white pixel in each step x step pixels."""
    picture = np.zeros((size, size, 3), np.uint8)
    picture[step // 2 :: step, step // 2 :: step] = 255
    return picture
