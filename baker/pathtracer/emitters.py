"""Finds the emissive triangles of a scene, for the path tracer.

This module does not use `lights.emissive.build_emitters`. So if `build_emitters` misses an emitter by
mistake, the reference still contains this emitter. From the resolved materials, this module computes which
triangles emit, and their area, radiance, sides and power. `lights.emissive_texture.cut` divides triangles
with an emissive texture into parts. The parts affect sampling densities only, because the radiance of a point
is looked up in the material.

    power = pi area L, twice that if two-sided

L is the luminance of the radiance; for a part of a textured triangle it is the mean of R, G and B.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import LUMINANCE_WEIGHTS
from baker.core.geometry import Geometry
from baker.kernels.shading import Shading
from baker.lights.emissive_texture import EmissiveTextures, Parts, brightness, cut

# Columns of an emitter, which is a triangle of the scene or a part of one:
#
#     EMITTER_CORNER      positions of the three corners, metres (9)
#     EMITTER_NORMAL      unit face normal (3)
#     EMITTER_AREA        m2
#     EMITTER_TWO_SIDED   1 if both sides emit, else 0
#     EMITTER_CHANCE      probability with which the emitter is chosen
#     EMITTER_RADIANCE    radiance without texture, cd/m2 (3)
#     EMITTER_TEXTURED    1 if its emission has a texture, else 0
#     EMITTER_PART        position in the scene's triangle (3): barycentrics b1, b2 of the emitter's corner 0;
#                         edge length divided by the triangle's edge length, negative if the part is
#                         rotated by 180 degrees. (0, 0, 1) for a whole triangle
EMITTER_CORNER, EMITTER_NORMAL, EMITTER_AREA, EMITTER_TWO_SIDED, EMITTER_CHANCE = 0, 9, 12, 13, 14
EMITTER_RADIANCE, EMITTER_TEXTURED, EMITTER_PART = 15, 18, 19
EMITTER_COLUMNS = 24
# Largest number of parts of all textured triangles, minus the number of textured triangles. Four times the
# limit of bakes, `lights.emissive.MOST_PARTS`.
MAX_PARTS = 131072
# Longest edge of a part, as a share of the scene's diagonal. Parts up to this size that are at most one texel
# of the texture wide are not cut further.
_SMALL = 1.0 / 128.0
# Number of cells minus one, along the longest axis of the grid of `_spatial_order`.
_CELLS = 1023.0
_LUMINANCE = np.array(LUMINANCE_WEIGHTS)


class FoundEmitters(NamedTuple):
    """E emitters of a scene of T triangles, ordered along a Morton curve.

    Attributes
    ----------
    row : (E, 24) float64
        Columns: `EMITTER_CORNER` to `EMITTER_PART`. EMITTER_CHANCE is still 0.
    triangle : (E,) int32
        Triangle of the scene that contains each emitter.
    power : (E,) float64
        Power of each emitter, lm.
    code : (T,) int32
        For each triangle of the scene: m >= 0 if it is emitter m; -1 if it emits nothing; -2 - k if it is
        divided into the parts `node[k]`.
    node : (K, 4) int32
        For each division, the codes of its four parts, see `kernels.emitters.emitter_at`.
    """

    row: NDArray[np.float64]
    triangle: NDArray[np.int32]
    power: NDArray[np.float64]
    code: NDArray[np.int32]
    node: NDArray[np.int32]


def find_emitters(geometry: Geometry, shading: Shading, max_parts: int = MAX_PARTS) -> FoundEmitters:
    """Find the triangles that emit, and divide textured triangles into parts.

    Parameters
    ----------
    geometry : Geometry
        The scene's triangles.
    shading : Shading
        The materials of the triangles.
    max_parts : int
        Largest number of parts of all textured triangles, minus the number of textured triangles.

    Returns
    -------
    FoundEmitters
        The emitters; their positions are relative to the geometry's origin.
    """
    emits = (shading.emission.max(axis=1, initial=0.0) > 0)[geometry.material] & (geometry.area > 0)
    has_texture = (shading.emission_texture >= 0)[geometry.material]
    whole, image = np.flatnonzero(emits & ~has_texture), np.flatnonzero(emits & has_texture)
    parts = _cut(geometry, shading, image, max_parts)
    triangle = np.concatenate([whole, image[parts.owner]])
    part = np.concatenate([np.tile([0.0, 0.0, 1.0], (len(whole), 1)), parts.inside])
    radiance = shading.emission[geometry.material[whole]].astype(np.float64)
    level = np.concatenate([radiance @ _LUMINANCE, brightness(parts.mean)])
    # Number untextured triangles first, then the parts of textured ones.
    code = np.full(len(geometry.triangle), -1, np.int32)
    code[whole] = np.arange(len(whole))
    code[image] = np.where(parts.root >= 0, parts.root + len(whole), parts.root)
    node = np.where(parts.node >= 0, parts.node + len(whole), parts.node)

    area = (geometry.area[triangle] * part[:, 2] ** 2).astype(np.float32)
    power = np.pi * area * level * np.where(geometry.double_sided[triangle], 2.0, 1.0)
    corner = _corners(geometry, triangle, part)
    order = _spatial_order(corner.mean(axis=1).astype(np.float64))
    order = order[power[order] > 0]

    row = np.zeros((len(order), EMITTER_COLUMNS))
    triangle = triangle[order]
    material = geometry.material[triangle]
    row[:, EMITTER_CORNER : EMITTER_CORNER + 9] = corner[order].reshape(-1, 9)
    row[:, EMITTER_NORMAL : EMITTER_NORMAL + 3] = geometry.face_normal[triangle]
    row[:, EMITTER_AREA] = area[order]
    row[:, EMITTER_TWO_SIDED] = geometry.double_sided[triangle]
    row[:, EMITTER_RADIANCE : EMITTER_RADIANCE + 3] = shading.emission[material]
    row[:, EMITTER_TEXTURED] = shading.emission_texture[material] >= 0
    row[:, EMITTER_PART : EMITTER_PART + 3] = part[order]
    # Replace each emitter's number by its row after sorting; emitters without power get -1.
    rank = np.full(len(power) + 1, -1, np.int32)
    rank[order] = np.arange(len(order))
    code, node = (
        np.where(numbers >= 0, rank[np.maximum(numbers, -1)], numbers).astype(np.int32)
        for numbers in (code, node)
    )
    # Round power to float32, the precision of the triangles.
    power = power[order].astype(np.float32).astype(np.float64)
    return FoundEmitters(row, triangle.astype(np.int32), power, code, node.reshape(-1, 4))


def _cut(geometry: Geometry, shading: Shading, image: NDArray[np.int64], max_parts: int) -> Parts:
    """Divide the textured triangles with indices `image` (n,) into parts."""
    if not len(image):
        none = np.zeros(0, np.int64)
        empty = np.zeros((0, 3))
        return Parts(none, empty, empty, np.zeros(0), np.zeros((0, 4), np.int32), np.zeros(0, np.int32))
    corner = geometry.position[geometry.triangle[image]]
    edge = corner.astype(np.float64) - corner[:, [1, 2, 0]]
    longest = np.maximum(np.linalg.norm(edge, axis=2).max(axis=1), 1e-300)
    finest = _SMALL * geometry.diagonal / longest
    area = geometry.area[image].astype(np.float64)
    return cut(EmissiveTextures.of(shading, image), area, finest, max_parts)


def _corners(
    geometry: Geometry, triangle: NDArray[np.int64], part: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return the corners (m, 3, 3) float32, metres, of m parts.

    triangle : (m,) int64, the scene's triangle of each part; part : (m, 3) float64, see `EMITTER_PART`
    """
    corner = geometry.position[geometry.triangle[triangle]].copy()
    cut_off = np.flatnonzero(part[:, 2] != 1.0)
    whole, inside = corner[cut_off].astype(np.float64), part[cut_off]
    first, second = whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0]
    b1, b2, size = inside[:, 0, None], inside[:, 1, None], inside[:, 2, None]
    start = whole[:, 0] + (b1 * first + b2 * second)
    corner[cut_off] = np.stack([start, start + size * first, start + size * second], axis=1)
    return corner


def _spatial_order(centre: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the order (n,) of points (n, 3) along a Morton curve; points of one cell keep their order."""
    if not len(centre):
        return np.zeros(0, np.int64)
    cell = (centre - centre.min(axis=0)) / max(float(np.ptp(centre, axis=0).max()), 1e-12)
    digit = (cell * _CELLS).astype(np.int64)
    bit = np.arange(10)
    key = (((digit[:, :, None] >> bit) & 1) << (3 * bit + np.arange(3)[:, None])).sum(axis=(1, 2))
    return np.argsort(key, kind="stable")
