# mypy: disable-error-code="no-untyped-def"
"""Defines the table of split texels, and finds the side of a split texel on which a hit lies.

Another surface divides a split texel into sides, and each of the texel's 16 points lies on one side
(`radiosity.sides`). A hit gets the side of the nearest point that is visible from a position on the ray
shortly before the hit. If no point is visible from there, visibility is tested from just above the hit.
`radiosity.kernels.sides` defines the height of the segments that test visibility.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import set_blend_rule
from baker.kernels.triangle_lookup import FACE_NORMAL
from baker.trace.jit import inner, scratch, smaller
from baker.trace.packets import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    ORG_X,
    ORG_Y,
    ORG_Z,
    PACKET_WIDTH,
    SOLID,
    TFAR,
    trace_lanes,
)  # fmt: skip

_f = np.float32
# Start of a segment, in texel sides: _BACK before the hit on the ray, or _ABOVE above the hit along the face
# normal.
_BACK, _ABOVE = 0.25, 0.02
# Rows of `hits` for `find_side`: ray origin (3), direction (3), distance (1), normal of the hit face (3).
HIT_ORIGIN, HIT_DIRECTION, HIT_DISTANCE, HIT_NORMAL = 0, 3, 6, 7
HIT_ROWS = 10
# Column of `SeenLight.image` after RGB. For a split texel, 1 + its row in the `SideTable`; else 0.
SIDE_ROW = 3
# Working memory of the kernels.
new_hits, _saved = scratch((HIT_ROWS * PACKET_WIDTH,), np.float32), scratch((3 * PACKET_WIDTH,), np.float32)


class SideTable(NamedTuple):
    """The S split texel entries and their points.

    An entry with a single side is included if a corner of its surface is visible from none of its points. For
    a hit near that corner, no visible point is found, so the hit contributes no light.

    Attributes
    ----------
    point, normal : (S, 16, 3) float32
        Ray origins, metres and unit vectors, world shading normals.
    height : (S, 16) float32
        Height of segments from each point, metres, see `radiosity.kernels.sides`.
    member : (S, 16) int32
        Row of each point's side in `SeenLight.value` or `SeenPatch.value`, -1 for points inside geometry.
    side : (S,) float32
        Side length of the texel, metres.
    """

    point: NDArray[np.float32]
    normal: NDArray[np.float32]
    height: NDArray[np.float32]
    member: NDArray[np.int32]
    side: NDArray[np.float32]


def no_sides() -> SideTable:
    """Return the table of a scene without split texels."""
    return SideTable(
        np.zeros((0, N_POINTS, 3), _f),
        np.zeros((0, N_POINTS, 3), _f),
        np.zeros((0, N_POINTS), _f),
        np.zeros((0, N_POINTS), np.int32),
        np.zeros(0, _f),
    )


class SeenLight(NamedTuple):
    """Light that texels reflect, which final-gather rays read at their hits.

    Attributes
    ----------
    image : (P * H * W, 4) or (2 * P * H * W, 4) float32
        RGB radiosity, lx: first of the fronts of all pixels, then, if there are backs, of the backs. Column
        SIDE_ROW is 1 + row of the texel in `sides`, 0 if it is not split. (0, 4) if nothing reflects.
    value : (K, 4) float32
        RGB radiosity, lx, of each side of the split texels. Column SIDE_ROW is unused.
    sides : SideTable
        The split texels.
    """

    image: NDArray[np.float32]
    value: NDArray[np.float32]
    sides: SideTable


def nothing_seen() -> SeenLight:
    """Return the table of a scene in which no texel reflects light.

    Returns
    -------
    SeenLight
        All arrays have length 0.
    """
    return SeenLight(np.zeros((0, 4), _f), np.zeros((0, 4), _f), no_sides())


class SeenPatch(NamedTuple):
    """The patch of each texel, which form-factor rays read at their hits.

    Attributes
    ----------
    image : (P * H * W,) or (2 * P * H * W,) int32
        First the patches of the fronts of all pixels, then, if there are backs, of the backs; -1 for none.
        For a split texel in row s of `sides`, `form_factor.SPLIT` - s.
    value : (K,) int32
        Patch of each side of the split texels.
    sides : SideTable
        The split texels.
    """

    image: NDArray[np.int32]
    value: NDArray[np.int32]
    sides: SideTable


@inner
def segment(rays, lane, x, y, z, tx, ty, tz):
    """Write the segment from (x, y, z) to (tx, ty, tz), metres, world, into a lane of a packet.

    rays : (21 * 16,) float32, the packet
    Returns -1 if the segment's length is not 0, else 0.
    """
    dx, dy, dz = tx - x, ty - y, tz - z
    rays[ORG_X * PACKET_WIDTH + lane] = x
    rays[ORG_Y * PACKET_WIDTH + lane] = y
    rays[ORG_Z * PACKET_WIDTH + lane] = z
    rays[DIR_X * PACKET_WIDTH + lane] = dx
    rays[DIR_Y * PACKET_WIDTH + lane] = dy
    rays[DIR_Z * PACKET_WIDTH + lane] = dz
    rays[TFAR * PACKET_WIDTH + lane] = _f(1.0)
    return np.int32(-1) if dx * dx + dy * dy + dz * dz > _f(0.0) else np.int32(0)


@inner
def note_hit(hits, lane, rays, row, prim, front):
    """Copy the hit of a lane to `hits`, from which `find_side` reads it.

    hits : (10 * 16,) float32 output, rows HIT_ORIGIN to HIT_NORMAL; rays : (21 * 16,) float32, the packet
    row : (T, 16) float32, see `TriangleLookup`; prim : triangle that was hit
    front : whether the ray hit the front of the triangle
    """
    sign = _f(1.0) if front else _f(-1.0)
    for a in range(3):
        hits[(HIT_ORIGIN + a) * PACKET_WIDTH + lane] = rays[(ORG_X + a) * PACKET_WIDTH + lane]
        hits[(HIT_DIRECTION + a) * PACKET_WIDTH + lane] = rays[(DIR_X + a) * PACKET_WIDTH + lane]
        hits[(HIT_NORMAL + a) * PACKET_WIDTH + lane] = sign * row[prim, FACE_NORMAL + a]
    hits[HIT_DISTANCE * PACKET_WIDTH + lane] = rays[TFAR * PACKET_WIDTH + lane]


@inner
def find_side(point, normal, height, member, side, s, hits, lane, buffers):
    """Return the item of `member` for the side of split texel s that was hit, -1 if none is found.

    point, normal (S, 16, 3), height (S, 16), member (S, 16), side (S,) : see `SideTable`
    hits : (10 * 16,) float32, from `note_hit`; lane : lane of the hit
    buffers : PacketBuffers; its packet is overwritten, except the origins
    """
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    set_blend_rule(buffers.blend, words, SOLID)
    # Save the origins of the packet.
    saved = _saved()
    for j in range(3 * PACKET_WIDTH):
        saved[j] = rays[ORG_X * PACKET_WIDTH + j]
    distance = hits[HIT_DISTANCE * PACKET_WIDTH + lane]
    dx, dy, dz = (
        hits[HIT_DIRECTION * PACKET_WIDTH + lane], hits[(HIT_DIRECTION + 1) * PACKET_WIDTH + lane],
        hits[(HIT_DIRECTION + 2) * PACKET_WIDTH + lane],
    )  # fmt: skip
    x = hits[HIT_ORIGIN * PACKET_WIDTH + lane] + distance * dx
    y = hits[(HIT_ORIGIN + 1) * PACKET_WIDTH + lane] + distance * dy
    z = hits[(HIT_ORIGIN + 2) * PACKET_WIDTH + lane] + distance * dz
    found = np.int32(-1)
    for turn in range(2):
        # Start on the ray before the hit, because rounding may place the hit behind the surface that divides
        # the texel. If no point is visible from there, start above the hit.
        step = smaller(_f(_BACK) * side[s], _f(0.5) * distance)
        vx, vy, vz = -dx, -dy, -dz
        if turn == 1:
            step = _f(_ABOVE) * side[s]
            vx, vy, vz = (
                hits[HIT_NORMAL * PACKET_WIDTH + lane], hits[(HIT_NORMAL + 1) * PACKET_WIDTH + lane],
                hits[(HIT_NORMAL + 2) * PACKET_WIDTH + lane],
            )  # fmt: skip
        # Trace a segment to each point.
        for k in range(N_POINTS):
            on[k] = 0
            if member[s, k] >= 0:
                h = height[s, k]
                on[k] = segment(
                    rays, k, x + step * vx, y + step * vy, z + step * vz,
                    point[s, k, 0] + h * normal[s, k, 0], point[s, k, 1] + h * normal[s, k, 1],
                    point[s, k, 2] + h * normal[s, k, 2],
                )  # fmt: skip
        trace_lanes(
            buffers.occluded, buffers.scene, buffers.width, buffers.query, on, rays, buffers.valid,
            buffers.floats,
        )  # fmt: skip
        # Choose the visible point that is nearest to the hit.
        nearest = _f(np.inf)
        for k in range(N_POINTS):
            if on[k] != 0 and rays[TFAR * PACKET_WIDTH + k] >= _f(0.0):
                px, py, pz = point[s, k, 0] - x, point[s, k, 1] - y, point[s, k, 2] - z
                square = px * px + py * py + pz * pz
                if square < nearest:
                    nearest, found = square, member[s, k]
        if found >= 0:
            break
    # Restore the origins.
    for j in range(3 * PACKET_WIDTH):
        rays[ORG_X * PACKET_WIDTH + j] = saved[j]
    set_blend_rule(buffers.blend, words, np.uint32(0))
    return found
