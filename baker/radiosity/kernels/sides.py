# mypy: disable-error-code="no-untyped-def"
"""Finds texels that another surface passes through, and groups their points by side.

For example, a floor that continues under a wall has texels with points on both sides of the wall. Two points
of a texel are on the same side if a segment between them is not blocked. The segment runs above the surface.
The height of a point is

    height = min(HIGH s, headroom / 2)        s: side of the texel, metres

The headroom of a point is the free distance along its normal. Both ends of a segment are raised along the
normals by the smaller of the two points' heights. So a step lower than that height does not separate two
points, and an opening lower than that height does not connect them. The same test finds the side on which a
ray's hit lies (`radiosity.kernels.side_table`).
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.clip import clip_to_square, new_polygon, new_triangle
from baker.kernels.rays import FAR, aim_lanes, lane_seeds, load_frames, new_frame, new_seeds
from baker.kernels.surface import N_POINTS, inverse_uv, place_point
from baker.kernels.triangle_lookup import DOUBLE_SIDED, front_facing
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
# Heights of segments above the surface, in texel sides. Segments between points are at most at HIGH.
HIGH, LOW = 0.25, 0.02
# Half length of the test segments along the diagonals, as a share of the texel's diagonal. More than 0.5, so
# that a surface exactly between two texels is found in both.
_HALF_DIAGONAL = 0.55
# Distance of a tested corner from the mean of the polygon's corners, as a share of the true corner's
# distance.
_CORNER = 0.998
# Rows of `frame` (3 each): centre, both half diagonals, and the normal times the texel's side.
_CENTRE, _DIAGONAL_1, _DIAGONAL_2, _NORMAL = 0, 3, 6, 9
# Working memory of the kernels.
_points, _heights = scratch((1, PACKET_WIDTH, 3), np.float32), scratch((1, PACKET_WIDTH), np.float32)
_frame = scratch((12 * PACKET_WIDTH,), np.float32)


@kernel
def crossed_texels(surface, begin, end, buffers, crossed, side):
    """Find the texels that another surface may pass through, with segments just above each texel's square.

    surface : Surface; begin, end : first entry and end of the tested entries; buffers : PacketBuffers
    crossed : (n,) uint8 output, 1 if a diagonal of the square is blocked at height HIGH or LOW, or if an edge
        of the square is blocked at height HIGH
    side : (n,) float32 output, metres, root mean square of the texel's width and height
    Returns the number of rays cast.
    """
    position, uv, triangle, face = surface.position, surface.uv, surface.triangle, surface.face_normal
    pixels, fronts, back = surface.pixel, surface.front, surface.back
    starts, entry, entry_area, size = surface.first, surface.entry, surface.entry_area, surface.size
    scene, occluded, width, query = buffers.scene, buffers.occluded, buffers.width, buffers.query
    on, rays = buffers.lane_valid, buffers.lane_floats
    spare_on, spare = buffers.valid, buffers.floats
    frame = _frame()
    cast = 0
    for group in range(begin, end, PACKET_WIDTH):
        lanes = smaller(PACKET_WIDTH, end - group)
        for lane in range(lanes):
            # Write the texel's frame in the plane of the triangle with the largest area in the texel.
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
                frame[(_CENTRE + axis) * PACKET_WIDTH + lane] = p0 + b1 * e1 + b2 * e2
                frame[(_DIAGONAL_1 + axis) * PACKET_WIDTH + lane] = _HALF_DIAGONAL * (right + down)
                frame[(_DIAGONAL_2 + axis) * PACKET_WIDTH + lane] = _HALF_DIAGONAL * (right - down)
                across += right * right + down * down
            side[i] = math.sqrt(0.5 * across)
            sign = -side[i] if back[i] else side[i]
            for axis in range(3):
                frame[(_NORMAL + axis) * PACKET_WIDTH + lane] = sign * face[t, axis]
            crossed[group + lane] = 0
        for turn in range(8):
            # Turns 0 and 1: diagonals at HIGH; 2 and 3: diagonals at LOW; 4 to 7: edges at HIGH.
            height = _f(LOW if turn == 2 or turn == 3 else HIGH)
            row = _DIAGONAL_1 + 3 * (turn % 2)
            for lane in range(PACKET_WIDTH):
                on[lane] = 0
            for lane in range(lanes):
                if crossed[group + lane] != 0:
                    continue
                x = frame[lane] + height * frame[_NORMAL * PACKET_WIDTH + lane]
                y = frame[PACKET_WIDTH + lane] + height * frame[(_NORMAL + 1) * PACKET_WIDTH + lane]
                z = frame[2 * PACKET_WIDTH + lane] + height * frame[(_NORMAL + 2) * PACKET_WIDTH + lane]
                ex, ey, ez = (
                    frame[row * PACKET_WIDTH + lane], frame[(row + 1) * PACKET_WIDTH + lane],
                    frame[(row + 2) * PACKET_WIDTH + lane],
                )  # fmt: skip
                cast += 1
                if turn < 4:
                    on[lane] = segment(rays, lane, x - ex, y - ey, z - ez, x + ex, y + ey, z + ez)
                    continue
                # Write an edge: from an end of one diagonal to an end of the other diagonal.
                to = _DIAGONAL_1 + _DIAGONAL_2 - row
                fx, fy, fz = (
                    frame[to * PACKET_WIDTH + lane],
                    frame[(to + 1) * PACKET_WIDTH + lane],
                    frame[(to + 2) * PACKET_WIDTH + lane],
                )
                step = _f(1.0) if turn < 6 else _f(-1.0)
                other_step = step if row == _DIAGONAL_1 else -step
                on[lane] = segment(
                    rays, lane, x + step * ex, y + step * ey, z + step * ez,
                    x + other_step * fx, y + other_step * fy, z + other_step * fz,
                )  # fmt: skip
            trace_lanes(occluded, scene, width, query, on, rays, spare_on, spare)
            for lane in range(lanes):
                if on[lane] != 0 and rays[TFAR * PACKET_WIDTH + lane] < _f(0.0):
                    crossed[group + lane] = 1
    return cast


@inner
def _between(rays, lane, origin, normal, height, m, i, k):
    """Write the raised segment between points i and k of texel m into a lane; see `segment`.

    rays : (21 * 16,) float32, a packet; origin, normal : (m, 16, 3) float32; height : (m, 16) float32, metres
    """
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
    """Write the height of segments from each point, as the module defines it.

    origin, normal : (n, 3) float32, metres and unit vectors, world
    side : (n,) float32, metres, side length of each point's texel
    buffers : PacketBuffers; height : (n,) float32 output, metres
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
def group_points(origin, normal, height, valid_points, buffers, label):
    """Group the points of texels by mutual visibility; return the number of rays cast.

    origin, normal : (m, 16, 3) float32, metres and unit vectors, world
    height : (m, 16) float32, metres, from `point_heights`
    valid_points : (m,) uint16, bit k is set where point k is not inside geometry
    buffers : PacketBuffers
    label : (m, 16) int8 output, group of each point from 0, -1 for points inside geometry
    """
    scene, occluded, width, query = buffers.scene, buffers.occluded, buffers.width, buffers.query
    on, rays = buffers.lane_valid, buffers.lane_floats
    spare_on, spare = buffers.valid, buffers.floats
    cast = 0
    for m in range(len(origin)):
        bits = np.int64(valid_points[m])
        for k in range(N_POINTS):
            label[m, k] = -1
        # Start a group at each point without a group.
        groups = 0
        for seed in range(N_POINTS):
            if (bits >> seed) & 1 == 0 or label[m, seed] >= 0:
                continue
            own = np.int8(groups)
            groups += 1
            label[m, seed] = own
            n_rays = 0
            for k in range(N_POINTS):
                on[k] = 0
                if (bits >> k) & 1 and label[m, k] != own:
                    on[k] = _between(rays, k, origin, normal, height, m, seed, k)
                    n_rays += 1
                    if on[k] == 0:
                        label[m, k] = own
            if n_rays == 0:
                continue
            cast += n_rays
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
                # Merge the earlier group with this one, because one of its points is visible from the seed.
                for j in range(N_POINTS):
                    label[m, j] = own if label[m, j] == other else label[m, j]
        # Number the remaining groups from 0.
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
def hidden_corners(surface, chosen, origin, normal, height, valid_points, side, buffers, hidden):
    """Find texels with a corner that is visible from none of their points, or with a blocked outline.

    Each triangle is clipped to the texel's square; the corners and the outline are those of the clipped
    polygons. Two cases are found. Another surface may separate a part of the texel that contains a corner but
    none of the points, although rays can hit this part. Or the edge where two walls meet may cross one edge
    of the polygon and hide no corner, so that the outline between two corners is blocked.

    surface : Surface; chosen : (m,) int64, texel entries
    origin, normal : (m, 16, 3) float32, metres and unit vectors, world; height : (m, 16) float32, metres
    valid_points : (m,) uint16, see `group_points`; side : (m,) float32, metres
    buffers : PacketBuffers; hidden : (m,) uint8 output, 1 for the texels found
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
            # Clip the triangle to the texel's square, and compute ray origins at the corners of the polygon.
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
                place_point(
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
            cast += _trace_corners(
                point, facing, headroom, n, m, origin, normal, height, valid_points, side, buffers, hidden
            )
            if hidden[m] != 0:
                break
    return cast


@inner
def _to_point(rays, lane, point, facing, headroom, j, origin, normal, height, m, k):
    """Write the raised segment from corner j to point k of texel m into a lane; see `segment`.

    rays : (21 * 16,) float32, a packet
    point, facing : (1, 16, 3) float32, corners, metres, and unit normals; headroom : (1, 16) float32, metres
    origin, normal : (m, 16, 3) float32; height : (m, 16) float32, metres
    """
    h = smaller(headroom[0, j], height[m, k])
    return segment(
        rays, lane,
        point[0, j, 0] + h * facing[0, j, 0], point[0, j, 1] + h * facing[0, j, 1],
        point[0, j, 2] + h * facing[0, j, 2],
        origin[m, k, 0] + h * normal[m, k, 0], origin[m, k, 1] + h * normal[m, k, 1],
        origin[m, k, 2] + h * normal[m, k, 2],
    )  # fmt: skip


@inner
def _trace_corners(
    point, facing, headroom, found, m, origin, normal, height, valid_points, side, buffers, hidden
):
    """Set hidden[m] to 1 if a corner is not visible from the next corner, or from no point of texel m.

    point, facing : (1, 16, 3) float32, corners, metres, and unit normals; found : number of corners
    headroom : (1, 16) float32, metres, working memory
    origin, normal, height, valid_points, side, buffers, hidden : see `hidden_corners`
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
    # Compute the heights of segments from the corners.
    for j in range(found):
        headroom[0, j] = smaller(high, _f(0.5) * rays[TFAR * PACKET_WIDTH + j])
    # Trace the outline, from each corner to the next.
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
    bits = np.int64(valid_points[m])
    first = 0
    while first + 1 < N_POINTS and bits != 0 and (bits >> first) & 1 == 0:
        first += 1
    # Trace from the first valid point to all corners. Then trace from all points to the corners that are not
    # visible from the first valid point.
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
    """Test the mutual visibility of n pairs of points a and b.

    origin_a, normal_a, origin_b, normal_b : (n, 3) float32, metres and unit vectors, world
    height_a, height_b : (n,) float32, metres, from `point_heights`; the lower height of a pair is used
    buffers : PacketBuffers; free : (n,) uint8 output, 1 if the segment is not blocked
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
def count_backs(origin, normal, lookup, buffers, sobol_points, shared, count):
    """Cast one ray from each of a texel's 16 points; count the rays that first hit a black back.

    A black back is the back of a one-sided surface.

    origin, normal : (m, 16, 3) float32, metres and unit vectors, world; lookup : TriangleLookup
    buffers : PacketBuffers; sobol_points : (16, 2) uint32
    shared : uint32, from `kernels.sampling.shared_bits_mask`
    count : (m,) int32 output, 0 on entry
    """
    scene, intersect, width, query = buffers.scene, buffers.intersect, buffers.width, buffers.query
    on, rays, words = buffers.lane_valid, buffers.lane_floats, buffers.lane_words
    spare_on, spare = buffers.valid, buffers.floats
    row = lookup.row
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
                if row[prim, DOUBLE_SIDED] == _f(0.0) and not front_facing(row, prim, dx, dy, dz):
                    count[group + lane] += 1
