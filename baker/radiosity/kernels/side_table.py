"""The sides of split texels as rays look them up: which one a hit lies on.

A hit lies on the side of the nearest of the texel's points that is visible from just before the hit, or from
just above it. See `sides` for the height of such segments.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.surface import N_POINTS
from baker.kernels.transmittance import set_blend_rule
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
)

_f = np.float32
# A segment before a hit starts this far back along the ray, one above it that high, in sides of a texel.
_BACK, _ABOVE = 0.25, 0.02
# Rows of `hits` for `find_side`, by lane: ray origin, direction, distance, face normal.
HIT_ORIGIN, HIT_DIRECTION, HIT_DISTANCE, HIT_NORMAL = 0, 3, 6, 7
HIT_ROWS = 10
# Memory of the kernels.
new_hits, _saved = scratch((HIT_ROWS * PACKET_WIDTH,), np.float32), scratch((3 * PACKET_WIDTH,), np.float32)


class SideTable(NamedTuple):
    """The S texel entries that are split into sides, and their points.

    Or whose surface has a corner that none of its points sees: a ray that hits there finds nothing.

    point, normal (S, 16, 3) float32: ray origins and shading normals; height (S, 16) float32, metres;
    member (S, 16) int32: row of the values of the point's side, -1 for points inside geometry;
    side (S,) float32, metres, of the texel.
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
    """What rays of the final gather find.

    image (sides * P * H * W, 4) float32, lx: light that the texel at each pixel reflects (RGB), and the
    number of its row in `sides` plus 1, or 0; no rows if nothing reflects; value (K, 4) float32: the same
    light of each side of the split texels; sides : SideTable
    """

    image: NDArray[np.float32]
    value: NDArray[np.float32]
    sides: SideTable


def nothing_seen() -> SeenLight:
    """Return the light that rays find where nothing reflects any."""
    return SeenLight(np.zeros((0, 4), _f), np.zeros((0, 4), _f), no_sides())


class SeenPatch(NamedTuple):
    """What form-factor rays find.

    image (sides * P * H * W,) int32: patch at each pixel, -1: none, `form_factor.SPLIT` - s: the texel in
    row s of `sides`; value (K,) int32: patch of each side of the split texels; sides : SideTable
    """

    image: NDArray[np.int32]
    value: NDArray[np.int32]
    sides: SideTable


@inner
def segment(rays, lane, x, y, z, tx, ty, tz):  # type: ignore[no-untyped-def]
    """Write the segment from (x, y, z) to (tx, ty, tz) into a lane; returns -1 if it has a length, else 0."""
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
def note_hit(hits, lane, rays, face, prim, front):  # type: ignore[no-untyped-def]
    """Copy what `find_side` needs of a lane's hit to `hits` (10 * 16,); face: rows of the hit table."""
    sign = _f(1.0) if front else _f(-1.0)
    for a in range(3):
        hits[(HIT_ORIGIN + a) * PACKET_WIDTH + lane] = rays[(ORG_X + a) * PACKET_WIDTH + lane]
        hits[(HIT_DIRECTION + a) * PACKET_WIDTH + lane] = rays[(DIR_X + a) * PACKET_WIDTH + lane]
        hits[(HIT_NORMAL + a) * PACKET_WIDTH + lane] = sign * face[prim, 8 + a]
    hits[HIT_DISTANCE * PACKET_WIDTH + lane] = rays[TFAR * PACKET_WIDTH + lane]


@inner
def find_side(point, normal, height, member, side, s, hits, lane, buffers):  # type: ignore[no-untyped-def]
    """Return the row of values of the side that a hit on split texel s lies on, or -1 if no point sees it.

    point, normal, height, member, side : arrays of a `SideTable`
    hits : (10 * 16,) float32, from `note_hit`; lane : int, which of them
    The buffers's sixteen rays are overwritten, but for their origins.
    """
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    set_blend_rule(buffers.blend, words, SOLID)
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
        # First from the ray, before it hits, which is on the right side whatever rounding did to the hit.
        step = smaller(_f(_BACK) * side[s], _f(0.5) * distance)
        vx, vy, vz = -dx, -dy, -dz
        if turn == 1:
            step = _f(_ABOVE) * side[s]
            vx, vy, vz = (
                hits[HIT_NORMAL * PACKET_WIDTH + lane], hits[(HIT_NORMAL + 1) * PACKET_WIDTH + lane],
                hits[(HIT_NORMAL + 2) * PACKET_WIDTH + lane],
            )  # fmt: skip
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
            buffers.occluded,
            buffers.scene,
            buffers.width,
            buffers.query,
            on,
            rays,
            buffers.valid,
            buffers.floats,
        )
        least = _f(np.inf)
        for k in range(N_POINTS):
            if on[k] != 0 and rays[TFAR * PACKET_WIDTH + k] >= _f(0.0):
                px, py, pz = point[s, k, 0] - x, point[s, k, 1] - y, point[s, k, 2] - z
                square = px * px + py * py + pz * pz
                if square < least:
                    least, found = square, member[s, k]
        if found >= 0:
            break
    for j in range(3 * PACKET_WIDTH):
        rays[ORG_X * PACKET_WIDTH + j] = saved[j]
    set_blend_rule(buffers.blend, words, np.uint32(0))
    return found
