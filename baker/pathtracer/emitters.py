"""The emissive triangles of a scene, for the path tracer.

This search is independent of `lights.emissive.build_emitters`, so that an emitter missed by the bake is still
in the reference. Which triangles emit, their area, radiance, sides and power are computed here from the
resolved materials. Triangles with an emissive texture are divided by `lights.emissive_texture.cut`. The parts
determine where samples are taken; the radiance of a point is looked up in the material.

    power = pi area L (twice that if two-sided)      L: luminance, or mean of RGB of a textured part
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import LUMINANCE_WEIGHTS
from baker.core.geometry import Geometry
from baker.kernels.shading import Shading
from baker.lights.emissive_texture import EmissiveTextures, Parts, brightness, cut

# Columns of an emitter, which is a triangle or a part of one: three corners, face normal, area, 1 if
# two-sided, chance to be chosen, radiance without texture, 1 if it has a texture, and its position in its
# triangle: barycentrics b1, b2 of corner 0 and size, negative if turned (0, 0, 1: all of it).
EMITTER_CORNER, EMITTER_NORMAL, EMITTER_AREA, EMITTER_TWO_SIDED, EMITTER_CHANCE = 0, 9, 12, 13, 14
EMITTER_RADIANCE, EMITTER_TEXTURED, EMITTER_PART = 15, 18, 19
EMITTER_COLUMNS = 24
# Parts that textured triangles may be cut into: four times as many as in bakes, which average each part.
MAX_PARTS = 131072
# Parts at most a texel wide and this share of the scene's diagonal are not cut further.
_SMALL = 1.0 / 128.0
# Cells along the longest axis of the grid that orders emitters in space.
_CELLS = 1023.0
_LUMINANCE = np.array(LUMINANCE_WEIGHTS)


class FoundEmitters(NamedTuple):
    """E emitters of a scene of T triangles, neighbours in space after each other.

    Attributes
    ----------
    row : (E, 24) float64
        See the column names; chances are still 0.
    triangle : (E,) int32
        The scene's triangle that each is, or is a part of.
    power : (E,) float64
        lm.
    code : (T,) int32
        Code of each triangle of the scene: its row, -1 if it emits nothing, -2 - k for the parts in
        `node[k]`.
    node : (K, 4) int32
        Codes of the four parts of each subdivision, see `kernels.emitters.emitter_at`.
    """

    row: NDArray[np.float64]
    triangle: NDArray[np.int32]
    power: NDArray[np.float64]
    code: NDArray[np.int32]
    node: NDArray[np.int32]


def find_emitters(geometry: Geometry, shading: Shading, max_parts: int = MAX_PARTS) -> FoundEmitters:
    """Find the triangles that emit.

    Parameters
    ----------
    geometry : Geometry
        Triangles, relative to its origin.
    shading : Shading
        Their materials.
    max_parts : int
        Parts that textured triangles may be cut into, beside one for each.

    Returns
    -------
    FoundEmitters
    """
    emits = (shading.emission.max(axis=1, initial=0.0) > 0)[geometry.material] & (geometry.area > 0)
    has_texture = (shading.emission_texture >= 0)[geometry.material]
    whole, image = np.flatnonzero(emits & ~has_texture), np.flatnonzero(emits & has_texture)
    parts = _cut(geometry, shading, image, max_parts)
    triangle = np.concatenate([whole, image[parts.owner]])
    part = np.concatenate([np.tile([0.0, 0.0, 1.0], (len(whole), 1)), parts.inside])
    radiance = shading.emission[geometry.material[whole]].astype(np.float64)
    level = np.concatenate([radiance @ _LUMINANCE, brightness(parts.mean)])
    # Codes of whole triangles, then of parts.
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
    # Map numbers before ordering to rows; emitters without power are left out.
    rank = np.full(len(power) + 1, -1, np.int32)
    rank[order] = np.arange(len(order))
    code, node = (
        np.where(numbers >= 0, rank[np.maximum(numbers, -1)], numbers).astype(np.int32)
        for numbers in (code, node)
    )
    # Single precision, as triangles have it.
    power = power[order].astype(np.float32).astype(np.float64)
    return FoundEmitters(row, triangle.astype(np.int32), power, code, node.reshape(-1, 4))


def _cut(geometry: Geometry, shading: Shading, image: NDArray[np.int64], max_parts: int) -> Parts:
    """Divide the textured triangles `image` (n,)."""
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
    """Return the corners (m, 3, 3), metres, of parts (m, 3) of triangles (m,)."""
    corner = geometry.position[geometry.triangle[triangle]].copy()
    cut_off = np.flatnonzero(part[:, 2] != 1.0)
    whole, inside = corner[cut_off].astype(np.float64), part[cut_off]
    first, second = whole[:, 1] - whole[:, 0], whole[:, 2] - whole[:, 0]
    b1, b2, size = inside[:, 0, None], inside[:, 1, None], inside[:, 2, None]
    start = whole[:, 0] + (b1 * first + b2 * second)
    corner[cut_off] = np.stack([start, start + size * first, start + size * second], axis=1)
    return corner


def _spatial_order(centre: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the order (n,) of points (n, 3) along a Morton curve; ties keep their order."""
    if not len(centre):
        return np.zeros(0, np.int64)
    cell = (centre - centre.min(axis=0)) / max(float(np.ptp(centre, axis=0).max()), 1e-12)
    digit = (cell * _CELLS).astype(np.int64)
    bit = np.arange(10)
    key = (((digit[:, :, None] >> bit) & 1) << (3 * bit + np.arange(3)[:, None])).sum(axis=(1, 2))
    return np.argsort(key, kind="stable")
