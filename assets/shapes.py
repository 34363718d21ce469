"""Solids as triangles with normals: boxes, rounded boxes, surfaces of revolution, balls, tori, rooms.

Positions are in metres, +Y is up, and triangles are counter-clockwise seen from outside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Point = tuple[float, float, float]

# Angle between neighbouring segments of a profile, degrees. Below it, the corner between them is shaded
# smooth.
CREASE = 35.0


@dataclass(frozen=True)
class Surface:
    """Triangles with one normal for each vertex.

    Attributes
    ----------
    position, normal : (V, 3) float64
    triangle : (T, 3) int64
        Indices of vertices.
    uv : (V, 2) float64 or None
    """

    position: NDArray[np.float64]
    normal: NDArray[np.float64]
    triangle: NDArray[np.int64]
    uv: NDArray[np.float64] | None = None

    def moved(self, by: Point) -> Surface:
        """Return the surface translated by `by`, metres."""
        return Surface(self.position + np.array(by), self.normal, self.triangle, self.uv)


def join(*parts: Surface) -> Surface:
    """Return several surfaces as one surface. It has uv if all of them have uv."""
    offset = np.cumsum([0, *(len(part.position) for part in parts)])
    uvs = [part.uv for part in parts if part.uv is not None]
    return Surface(
        np.concatenate([part.position for part in parts]),
        np.concatenate([part.normal for part in parts]),
        np.concatenate([part.triangle + start for part, start in zip(parts, offset, strict=False)]),
        np.concatenate(uvs) if len(uvs) == len(parts) else None,
    )


def quads(corner: list[list[Point]], *, uv_scale: float | None = None) -> Surface:
    """Return flat quadrilaterals, each given by four corners, counter-clockwise.

    With `uv_scale`, the uv are world coordinates in metres times `uv_scale`.
    """
    position = np.array(corner, float)
    along, across = position[:, 1] - position[:, 0], position[:, 3] - position[:, 0]
    normal = np.cross(along, across)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    first = 4 * np.arange(len(position))[:, None]
    triangle = (first + np.array([0, 1, 2, 0, 2, 3])).reshape(-1, 3)
    uv = None
    if uv_scale is not None:
        # Project along the axis of the normal's largest component. The uv of neighbouring quads then match.
        axis = np.abs(normal).argmax(axis=1)
        plane = np.array([[2, 1], [0, 2], [0, 1]])[axis]
        uv = (
            np.take_along_axis(position, plane[:, None, :].repeat(4, axis=1), axis=2).reshape(-1, 2)
            * uv_scale
        )
    return Surface(position.reshape(-1, 3), normal.repeat(4, axis=0), triangle, uv)


FACES = ("-x", "+x", "-y", "+y", "-z", "+z")


def box_faces(low: Point, high: Point) -> dict[str, list[Point]]:
    """Return the corners of the six faces of a box, by the direction that each face points to."""
    (a, b, c), (d, e, f) = low, high
    return {
        "-x": [(a, b, c), (a, b, f), (a, e, f), (a, e, c)],
        "+x": [(d, b, f), (d, b, c), (d, e, c), (d, e, f)],
        "-y": [(a, b, c), (d, b, c), (d, b, f), (a, b, f)],
        "+y": [(a, e, f), (d, e, f), (d, e, c), (a, e, c)],
        "-z": [(d, b, c), (a, b, c), (a, e, c), (d, e, c)],
        "+z": [(a, b, f), (d, b, f), (d, e, f), (a, e, f)],
    }


def box(size: Point, *, faces: tuple[str, ...] = FACES, uv_scale: float | None = None) -> Surface:
    """Return faces of a box that stands on the plane y = 0, centred on the y axis."""
    x, y, z = size
    face = box_faces((-x / 2, 0.0, -z / 2), (x / 2, y, z / 2))
    return quads([face[name] for name in faces], uv_scale=uv_scale)


def rounded_box(size: Point, radius: float, steps: int = 6) -> Surface:
    """Return a box with rounded edges that stands on the plane y = 0.

    Each face is a grid whose vertices are projected onto the rounded surface.
    """
    half = np.array(size) / 2
    core = half - radius
    parts = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            ticks = [_ticks(core[k], radius, steps) for k in (u, v)]
            grid_u, grid_v = np.meshgrid(*ticks, indexing="ij")
            flat = np.zeros((*grid_u.shape, 3))
            flat[..., axis], flat[..., u], flat[..., v] = sign * half[axis], grid_u, grid_v
            inner = np.clip(flat, -core, core)
            normal = flat - inner
            normal /= np.linalg.norm(normal, axis=2, keepdims=True)
            parts.append(_sheet(inner + radius * normal, normal, flip=sign > 0))
    return join(*parts).moved((0.0, size[1] / 2, 0.0))


def _ticks(core: float, radius: float, steps: int) -> NDArray[np.float64]:
    # Each face contains one half of the quarter circles at its edges. Space the grid lines by equal angles.
    angle = [math.tan(math.radians(45.0) * k / steps) for k in range(steps + 1)]
    arc = radius * np.array(angle)
    return np.concatenate([-core - arc[::-1], core + arc])


def lathe(profile: list[tuple[float, float]], segments: int) -> Surface:
    """Return the surface of revolution of a profile around the y axis.

    Parameters
    ----------
    profile : list of (radius, y)
        Points of the profile, which runs upwards on the outside. The solid is closed if the radius is 0 at
        both ends.
    segments : int
        Number of sides that approximate the circle.
    """
    point = np.array(profile, float)
    step = np.diff(point, axis=0)
    # Compute the outward normals of the segments. If a segment runs upwards, its normal points away from the
    # axis.
    side = np.stack([step[:, 1], -step[:, 0]], axis=1)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    smooth = (side[1:] * side[:-1]).sum(axis=1) > math.cos(math.radians(CREASE))
    turn = np.array(
        [[math.cos(t), math.sin(t)] for t in (2 * math.pi * k / segments for k in range(segments + 1))]
    )
    turn[-1] = turn[0]
    parts = []
    for k in range(len(step)):
        start = side[k] + side[k - 1] if k > 0 and smooth[k - 1] else side[k]
        end = side[k] + side[k + 1] if k + 1 < len(step) and smooth[k] else side[k]
        pair = np.array([start / np.linalg.norm(start), end / np.linalg.norm(end)])
        position = _spin(point[k : k + 2], turn)
        sheet = _sheet(position, _spin(pair, turn), flip=False)
        # Drop triangles without area. At the axis, one of the two triangles of every quad has no area.
        corner = sheet.position[sheet.triangle]
        area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
        parts.append(Surface(sheet.position, sheet.normal, sheet.triangle[area > 1e-12]))
    return join(*parts)


def ball(radius: float, subdivisions: int = 3) -> Surface:
    """Return a sphere around the origin, made by subdividing an icosahedron."""
    golden = (1 + math.sqrt(5)) / 2
    point = [
        *[(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)],
        *[(0, -1, golden), (0, 1, golden), (0, -1, -golden), (0, 1, -golden)],
        *[(golden, 0, -1), (golden, 0, 1), (-golden, 0, -1), (-golden, 0, 1)],
    ]
    fans = "0 11 5 0 5 1 0 1 7 0 7 10 0 10 11 1 5 9 5 11 4 11 10 2 10 7 6 7 1 8 3 9 4 3 4 2 3 2 6 3 6 8 3 8 9"
    triangle = np.array([*map(int, fans.split()), 4, 9, 5, 2, 4, 11, 6, 2, 10, 8, 6, 7, 9, 8, 1]).reshape(
        -1, 3
    )
    normal = np.array(point, float)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    for _ in range(subdivisions):
        edge = np.sort(triangle[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        unique, index = np.unique(edge, axis=0, return_inverse=True)
        middle = normal[unique].sum(axis=1)
        middle /= np.linalg.norm(middle, axis=1, keepdims=True)
        m = len(normal) + index.reshape(-1, 3)
        a, b, c = triangle.T
        triangle = np.concatenate(
            [
                np.stack(t, axis=1)
                for t in ((a, m[:, 0], m[:, 2]), (b, m[:, 1], m[:, 0]), (c, m[:, 2], m[:, 1]), m.T)
            ]
        )
        normal = np.concatenate([normal, middle])
    return Surface(normal * radius, normal, triangle)


def torus(radius: float, tube: float, around: int, across: int) -> Surface:
    """Return a torus around the y axis, centred at the origin."""
    circle = [(2 * math.pi * k / across) for k in range(across + 1)]
    outline = np.array([[math.cos(t), math.sin(t)] for t in circle])
    outline[-1] = outline[0]
    turn = np.array(
        [[math.cos(t), math.sin(t)] for t in (2 * math.pi * k / around for k in range(around + 1))]
    )
    turn[-1] = turn[0]
    return _sheet(_spin(outline * tube + [radius, 0.0], turn), _spin(outline, turn), flip=False)


def rooms(
    grid: tuple[list[float], list[float], list[float]],
    solid: Callable[[float, float, float], str | None],
    *,
    uv_scale: float | None = None,
) -> dict[str, Surface]:
    """Return the surface of a building made of grid cells, without faces between solid cells.

    Parameters
    ----------
    grid : three ascending lists
        Coordinates of the borders between cells along x, y and z, metres.
    solid : callable
        Takes the centre (x, y, z) of a cell and returns the name of its material, or None for air.
    uv_scale : float or None
        Number of texture repeats per metre; None: no uv.

    Returns
    -------
    dict of str to Surface
        The surface of each material. Together these surfaces are closed.
    """
    counts = [len(axis) - 1 for axis in grid]
    middle = [[(a + b) / 2 for a, b in pairwise(axis)] for axis in grid]
    name = {
        (i, j, k): solid(middle[0][i], middle[1][j], middle[2][k])
        for i in range(counts[0])
        for j in range(counts[1])
        for k in range(counts[2])
    }
    found: dict[str, list[list[Point]]] = {}
    for (i, j, k), own in name.items():
        if own is None:
            continue
        low = (grid[0][i], grid[1][j], grid[2][k])
        high = (grid[0][i + 1], grid[1][j + 1], grid[2][k + 1])
        beyond = ((i - 1, j, k), (i + 1, j, k), (i, j - 1, k), (i, j + 1, k), (i, j, k - 1), (i, j, k + 1))
        for (_, face), cell in zip(box_faces(low, high).items(), beyond, strict=True):
            if name.get(cell) is None:
                found.setdefault(own, []).append(face)
    return {label: quads(faces, uv_scale=uv_scale) for label, faces in found.items()}


def _spin(point: NDArray[np.float64], turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotate P points (radius, y) around the y axis to S angles; return (P, S, 3).

    `turn` (S, 2) are the cosines and sines of the angles.
    """
    out = np.zeros((len(point), len(turn), 3))
    out[..., 0] = point[:, None, 0] * turn[None, :, 0]
    out[..., 1] = point[:, None, 1]
    out[..., 2] = -point[:, None, 0] * turn[None, :, 1]
    return out


def _sheet(position: NDArray[np.float64], normal: NDArray[np.float64], *, flip: bool) -> Surface:
    """Return the triangles of a grid of points: `position` and `normal` are (P, Q, 3)."""
    rows, columns = position.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]
    triangle = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    if flip:
        triangle = triangle[:, ::-1]
    return Surface(position.reshape(-1, 3), normal.reshape(-1, 3), triangle)
