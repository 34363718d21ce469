# mypy: disable-error-code="no-untyped-def"
"""Texels that lie on both sides of a surface passing through them: which of their points see each other.

A floor that runs on under a wall has texels with points on both sides of that wall. Two points of a texel lie
on the same side if the segment between them is free at a small height above the surface:

    height = min(HIGH s, half the headroom of either point)        s: side of the texel, metres

A step lower than that separates nothing; a gap lower than that connects nothing. The same test chooses the
side of a ray's hit: the side of the nearest point that is visible from just before the hit.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.clip import clip_to_square, new_polygon, new_triangle
from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_frame, new_seeds
from baker.kernels.surface import N_POINTS, inverse_uv, place
from baker.kernels.triangle_lookup import front_facing
from baker.radiosity.kernels.side_table import segment
from baker.trace.jit import inner, kernel, scratch, smaller
from baker.trace.packets import (
    DIR_X,
    DIR_Y,
    DIR_Z,
    GEOM_ID,
    NO_HIT,
    ORG_X,
    PACKET_WIDTH,
    PRIM_ID,
    TFAR,
    trace_lanes,
)  # fmt: skip

_f = np.float32
# Heights of segments above the surface, in sides of a texel.
HIGH, LOW = 0.25, 0.02
# Half length of the diagonals that look for a crossing surface: a little beyond the texel, so that a surface
# exactly between two texels is met from both.
_REACH = 0.55
# Corners of a texel's surface are examined at this share of their distance from its middle.
_CORNER = 0.998
# Memory of the kernels.
_points, _heights = scratch((1, PACKET_WIDTH, 3), np.float32), scratch((1, PACKET_WIDTH), np.float32)
_frame = scratch((12 * PACKET_WIDTH,), np.float32)


@kernel
def crossed_texels(surface, begin, end, buffers, crossed, side):
    """Find texels that some surface may pass through: a line just above their square is blocked.

    Entries begin to end are examined.
    crossed : (n,) uint8 output, 1 where one of two diagonals is blocked at one of two heights, or one of the
        four edges at the upper one
    side : (n,) float32 output, metres, root mean square of the two sides of the whole texel
    Returns the number of rays cast.
    """
    position, uv, triangle, face = surface.position, surface.uv, surface.triangle, surface.face_normal
    pixels, fronts, back = surface.pixel, surface.front, surface.back
    starts, entry, entry_area, size = surface.first, surface.entry, surface.entry_area, surface.size
    scene, occluded, width, query = buffers.scene, buffers.occluded, buffers.width, buffers.query
    on, rays = buffers.lane_valid, buffers.lane_floats
    spare_on, spare = buffers.valid, buffers.floats
    # By lane: centre, the two half diagonals, the normal times the texel's side.
    frame = _frame()
    cast = 0
    for group in range(begin, end, PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, end - group)
        for lane in range(lanes):
            i = group + lane
            front = fronts[i]
            most = _f(-1.0)
            t = entry[starts[front]]
            for e in range(starts[front], starts[front + 1]):
                if entry_area[e] > most:
                    most, t = entry_area[e], entry[e]
            a, b, c, d, g, h = inverse_uv(uv, triangle, size, t)
            rest = pixels[i] % (size * size)
            x, y = rest % size + 0.5, rest // size + 0.5
            b1, b2 = a * x + b * y + c, d * x + g * y + h
            i0, i1, i2 = triangle[t, 0], triangle[t, 1], triangle[t, 2]
            across = 0.0
            for axis in range(3):
                p0 = float(position[i0, axis])
                e1, e2 = position[i1, axis] - p0, position[i2, axis] - p0
                right, down = a * e1 + d * e2, b * e1 + g * e2
                frame[axis * PACKET_WIDTH + lane] = p0 + b1 * e1 + b2 * e2
                frame[(3 + axis) * PACKET_WIDTH + lane] = _REACH * (right + down)
                frame[(6 + axis) * PACKET_WIDTH + lane] = _REACH * (right - down)
                across += right * right + down * down
            side[i] = math.sqrt(0.5 * across)
            sign = -side[i] if back[i] else side[i]
            for axis in range(3):
                frame[(9 + axis) * PACKET_WIDTH + lane] = sign * face[t, axis]
            crossed[group + lane] = 0
        for turn in range(8):
            # Two diagonals high and low, then four edges.
            height = _f(LOW if turn == 2 or turn == 3 else HIGH)
            row = 3 + 3 * (turn % 2)
            for lane in range(PACKET_WIDTH):
                on[lane] = 0
            for lane in range(lanes):
                if crossed[group + lane] != 0:
                    continue
                x = frame[lane] + height * frame[9 * PACKET_WIDTH + lane]
                y = frame[PACKET_WIDTH + lane] + height * frame[10 * PACKET_WIDTH + lane]
                z = frame[2 * PACKET_WIDTH + lane] + height * frame[11 * PACKET_WIDTH + lane]
                ex, ey, ez = (
                    frame[row * PACKET_WIDTH + lane], frame[(row + 1) * PACKET_WIDTH + lane],
                    frame[(row + 2) * PACKET_WIDTH + lane],
                )  # fmt: skip
                cast += 1
                if turn < 4:
                    on[lane] = segment(rays, lane, x - ex, y - ey, z - ez, x + ex, y + ey, z + ez)
                    continue
                # From one end of a diagonal to one of the other.
                to = 9 - row
                fx, fy, fz = (
                    frame[to * PACKET_WIDTH + lane],
                    frame[(to + 1) * PACKET_WIDTH + lane],
                    frame[(to + 2) * PACKET_WIDTH + lane],
                )
                way = _f(1.0) if turn < 6 else _f(-1.0)
                back_way = way if row == 3 else -way
                on[lane] = segment(
                    rays, lane, x + way * ex, y + way * ey, z + way * ez,
                    x + back_way * fx, y + back_way * fy, z + back_way * fz,
                )  # fmt: skip
            trace_lanes(occluded, scene, width, query, on, rays, spare_on, spare)
            for lane in range(lanes):
                if on[lane] != 0 and rays[TFAR * PACKET_WIDTH + lane] < _f(0.0):
                    crossed[group + lane] = 1
    return cast


@inner
def _between(rays, lane, origin, normal, height, m, i, k):
    """Write the segment between points i of item m and k of the same arrays into a lane."""
    h = smaller(height[m, i], height[m, k])
    return segment(
        rays, lane,
        origin[m, i, 0] + h * normal[m, i, 0], origin[m, i, 1] + h * normal[m, i, 1],
        origin[m, i, 2] + h * normal[m, i, 2],
        origin[m, k, 0] + h * normal[m, k, 0], origin[m, k, 1] + h * normal[m, k, 1],
        origin[m, k, 2] + h * normal[m, k, 2],
    )  # fmt: skip


@kernel
def point_heights(origin, normal, side, buffers, height):
    """Write the height at which segments from points run, (n,) float32: see the module.

    origin, normal : (n, 3) float32; side : (n,) float32, metres, of the texel of each
    """
    scene, intersect, width, query = buffers.scene, buffers.intersect, buffers.width, buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin) - group)
        for lane in range(PACKET_WIDTH):
            on[lane] = -1 if lane < lanes else 0
        for lane in range(lanes):
            i = group + lane
            for axis in range(3):
                rays[(ORG_X + axis) * PACKET_WIDTH + lane] = origin[i, axis]
                rays[(DIR_X + axis) * PACKET_WIDTH + lane] = normal[i, axis]
            rays[TFAR * PACKET_WIDTH + lane] = _f(2.0 * HIGH) * side[i]
            words[GEOM_ID * PACKET_WIDTH + lane] = np.uint32(0xFFFFFFFF)
        trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
        for lane in range(lanes):
            height[group + lane] = _f(0.5) * rays[TFAR * PACKET_WIDTH + lane]


@kernel
def group_points(origin, normal, height, mask, buffers, label):
    """Group the points of texels by mutual visibility.

    origin, normal : (m, 16, 3) float32; height : (m, 16) float32, from `point_heights`
    mask : (m,) uint16, bit k is set where point k is outside geometry
    label : (m, 16) int8 output, group of each point from 0, -1 for points inside geometry
    Returns the number of rays cast.
    """
    scene, occluded, width, query = buffers.scene, buffers.occluded, buffers.width, buffers.query
    on, rays = buffers.lane_valid, buffers.lane_floats
    spare_on, spare = buffers.valid, buffers.floats
    cast = 0
    for m in range(len(origin)):
        bits = np.int64(mask[m])
        for k in range(N_POINTS):
            label[m, k] = -1
        groups = 0
        for seed in range(N_POINTS):
            if (bits >> seed) & 1 == 0 or label[m, seed] >= 0:
                continue
            own = np.int8(groups)
            groups += 1
            label[m, seed] = own
            asked = 0
            for k in range(N_POINTS):
                on[k] = 0
                if (bits >> k) & 1 and label[m, k] != own:
                    on[k] = _between(rays, k, origin, normal, height, m, seed, k)
                    asked += 1
                    if on[k] == 0:
                        label[m, k] = own
            if asked == 0:
                continue
            cast += asked
            trace_lanes(occluded, scene, width, query, on, rays, spare_on, spare)
            for k in range(N_POINTS):
                if on[k] == 0 or rays[TFAR * PACKET_WIDTH + k] < _f(0.0):
                    continue
                other = label[m, k]
                if other == own:
                    continue
                if other < 0:
                    label[m, k] = own
                    continue
                # The seed sees a point of an earlier group: both are one.
                for j in range(N_POINTS):
                    label[m, j] = own if label[m, j] == other else label[m, j]
        # Close the gaps that merged groups left in the numbers.
        left = 0
        for number in range(groups):
            found = 0
            for k in range(N_POINTS):
                if label[m, k] == number:
                    label[m, k] = left
                    found = 1
            left += found
    return cast


@kernel
def hidden_corners(surface, chosen, origin, normal, height, mask, side, buffers, hidden):
    """Find texels with a corner of their surface that none of their points sees, or with a blocked outline.

    A surface that cuts off a corner leaves no point behind itself, but rays may hit what lies there. An edge
    between two walls may reach into a texel through one side of it: then the way along that side is blocked.

    chosen : (m,) int64, texel entries; origin, normal : (m, 16, 3) float32; height : (m, 16) float32
    mask : (m,) uint16, see `group_points`; side : (m,) float32, metres; hidden : (m,) uint8 output
    Returns the number of rays cast.
    """
    position, shading, face = surface.position, surface.normal, surface.face_normal
    uv, triangle, min_offset_scale = surface.uv, surface.triangle, surface.min_offset_scale
    pixels, fronts, back = surface.pixel, surface.front, surface.back
    starts, entry, size = surface.first, surface.entry, surface.size
    corner, cut, spare = new_triangle(), new_polygon(), new_polygon()
    point, facing, headroom = _points(), _points(), _heights()
    cast = 0
    for m in range(len(chosen)):
        hidden[m] = 0
        i = chosen[m]
        rest = pixels[i] % (size * size)
        x0, y0 = rest % size, rest // size
        front = fronts[i]
        for e in range(starts[front], starts[front + 1]):
            t = entry[e]
            for j in range(3):
                corner[j, 0] = uv[triangle[t, j], 0] * size
                corner[j, 1] = uv[triangle[t, j], 1] * size
            n = clip_to_square(corner, x0, y0, cut, spare)
            if n < 3:
                continue
            cx = cy = 0.0
            for j in range(n):
                cx += cut[j, 0] / n
                cy += cut[j, 1] / n
            a, b, c, d, g, h = inverse_uv(uv, triangle, size, t)
            for j in range(n):
                x = x0 + cx + _CORNER * (cut[j, 0] - cx)
                y = y0 + cy + _CORNER * (cut[j, 1] - cy)
                place(
                    position,
                    shading,
                    face,
                    triangle,
                    min_offset_scale,
                    t,
                    a * x + b * y + c,
                    d * x + g * y + h,
                    back[i],
                    point,
                    facing,
                    0,
                    j,
                )
            cast += _look_for_corners(
                point, facing, headroom, n, m, origin, normal, height, mask, side, buffers, hidden
            )
            if hidden[m] != 0:
                break
    return cast


@inner
def _to_point(rays, lane, point, facing, headroom, j, origin, normal, height, m, k):
    """Write the segment from corner j to point k of item m into a lane."""
    h = smaller(headroom[0, j], height[m, k])
    return segment(
        rays, lane,
        point[0, j, 0] + h * facing[0, j, 0], point[0, j, 1] + h * facing[0, j, 1],
        point[0, j, 2] + h * facing[0, j, 2],
        origin[m, k, 0] + h * normal[m, k, 0], origin[m, k, 1] + h * normal[m, k, 1],
        origin[m, k, 2] + h * normal[m, k, 2],
    )  # fmt: skip


@inner
def _look_for_corners(point, facing, headroom, found, m, origin, normal, height, mask, side, buffers, hidden):
    """Set hidden[m] if no point of item m sees one of `found` corners (1, 16, 3), or one not the next.

    Returns the number of rays cast.
    """
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    high = _f(HIGH) * side[m]
    for k in range(PACKET_WIDTH):
        on[k] = -1 if k < found else 0
    for k in range(found):
        for axis in range(3):
            rays[(ORG_X + axis) * PACKET_WIDTH + k] = point[0, k, axis]
            rays[(DIR_X + axis) * PACKET_WIDTH + k] = facing[0, k, axis]
        rays[TFAR * PACKET_WIDTH + k] = _f(2.0) * high
        words[GEOM_ID * PACKET_WIDTH + k] = np.uint32(0xFFFFFFFF)
    trace_lanes(
        buffers.intersect,
        buffers.scene,
        buffers.width,
        buffers.query,
        on,
        rays,
        buffers.valid,
        buffers.floats,
    )
    for j in range(found):
        headroom[0, j] = smaller(high, _f(0.5) * rays[TFAR * PACKET_WIDTH + j])
    for j in range(PACKET_WIDTH):
        on[j] = 0
    for j in range(found):
        to = j + 1 if j + 1 < found else 0
        h = smaller(headroom[0, j], headroom[0, to])
        on[j] = segment(
            rays, j,
            point[0, j, 0] + h * facing[0, j, 0], point[0, j, 1] + h * facing[0, j, 1],
            point[0, j, 2] + h * facing[0, j, 2],
            point[0, to, 0] + h * facing[0, to, 0], point[0, to, 1] + h * facing[0, to, 1],
            point[0, to, 2] + h * facing[0, to, 2],
        )  # fmt: skip
    trace_lanes(
        buffers.occluded, buffers.scene, buffers.width, buffers.query, on, rays, buffers.valid, buffers.floats
    )
    for j in range(found):
        if on[j] != 0 and rays[TFAR * PACKET_WIDTH + j] < _f(0.0):
            hidden[m] = 1
    if hidden[m] != 0:
        return 2 * found
    bits = np.int64(mask[m])
    first = 0
    while first + 1 < N_POINTS and bits != 0 and (bits >> first) & 1 == 0:
        first += 1
    # One point sees most corners; only for the others all are asked.
    for j in range(found):
        on[j] = _to_point(rays, j, point, facing, headroom, j, origin, normal, height, m, first)
    trace_lanes(
        buffers.occluded, buffers.scene, buffers.width, buffers.query, on, rays, buffers.valid, buffers.floats
    )
    left = np.int64(0)
    for j in range(found):
        if on[j] == 0 or rays[TFAR * PACKET_WIDTH + j] < _f(0.0):
            left |= np.int64(1) << j
    cast = 3 * found
    for j in range(found):
        if (left >> j) & 1 == 0:
            continue
        for k in range(N_POINTS):
            on[k] = 0
            if bits == 0 or (bits >> k) & 1:
                on[k] = _to_point(rays, k, point, facing, headroom, j, origin, normal, height, m, k)
                cast += 1
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
        seen = False
        for k in range(N_POINTS):
            seen = seen or (on[k] != 0 and rays[TFAR * PACKET_WIDTH + k] >= _f(0.0))
        if not seen:
            hidden[m] = 1
            break
    return cast


@kernel
def free_segments(origin_a, normal_a, height_a, origin_b, normal_b, height_b, buffers, free):
    """Find out which pairs of points see each other.

    origin_*, normal_* : (n, 3) float32; height_* : (n,) float32; free : (n,) uint8 output
    """
    scene, occluded, width, query = buffers.scene, buffers.occluded, buffers.width, buffers.query
    on, rays = buffers.lane_valid, buffers.lane_floats
    spare_on, spare = buffers.valid, buffers.floats
    for group in range(0, len(origin_a), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin_a) - group)
        for lane in range(PACKET_WIDTH):
            on[lane] = 0
        for lane in range(lanes):
            i = group + lane
            h = smaller(height_a[i], height_b[i])
            on[lane] = segment(
                rays, lane,
                origin_a[i, 0] + h * normal_a[i, 0], origin_a[i, 1] + h * normal_a[i, 1],
                origin_a[i, 2] + h * normal_a[i, 2],
                origin_b[i, 0] + h * normal_b[i, 0], origin_b[i, 1] + h * normal_b[i, 1],
                origin_b[i, 2] + h * normal_b[i, 2],
            )  # fmt: skip
        trace_lanes(occluded, scene, width, query, on, rays, spare_on, spare)
        for lane in range(lanes):
            free[group + lane] = 1 if on[lane] == 0 or rays[TFAR * PACKET_WIDTH + lane] >= _f(0.0) else 0


@kernel
def count_backs(origin, normal, table, buffers, sobol_points, shared, count):
    """Count how many rays, one from each point of a texel, meet the back of a one-sided surface first.

    origin, normal : (m, 16, 3) float32; sobol_points : (16, 2) uint32; shared : uint32, see `sampling`
    count : (m,) int32 output
    """
    scene, intersect, width, query = buffers.scene, buffers.intersect, buffers.width, buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row = table.row
    seeds, frame = new_seeds(), new_frame()
    for group in range(0, len(origin), PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, len(origin) - group)
        lane_seeds(group, lanes, 12, seeds)
        for lane in range(PACKET_WIDTH):
            on[lane] = -1 if lane < lanes else 0
        for k in range(N_POINTS):
            load_frames(rays, frame, origin, normal, group, lanes, k)
            aim_lanes(rays, words, frame, seeds, sobol_points[k, 0], sobol_points[k, 1], shared, FAR)
            trace_lanes(intersect, scene, width, query, on, rays, spare_on, spare)
            for lane in range(lanes):
                if words[GEOM_ID * PACKET_WIDTH + lane] == NO_HIT:
                    continue
                prim = np.int64(words[PRIM_ID * PACKET_WIDTH + lane])
                dx, dy, dz = (
                    rays[DIR_X * PACKET_WIDTH + lane],
                    rays[DIR_Y * PACKET_WIDTH + lane],
                    rays[DIR_Z * PACKET_WIDTH + lane],
                )
                if row[prim, 7] == _f(0.0) and not front_facing(row, prim, dx, dy, dz):
                    count[group + lane] += 1
