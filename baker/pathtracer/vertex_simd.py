# mypy: disable-error-code="no-untyped-def"
"""Shades Lambertian vertices, eight paths at a time, in loops that the compiler vectorizes.

These functions compute in float32 what `pathtracer.vertex` computes for one path in float64: vertices from
hits, light samples, and the next directions. They use selections instead of branches.

    contribution of a light sample    beta albedo / pi cos L w / density
    its MIS weight w                  density / (density + cos / pi)        (balance heuristic)
    next direction                    density cos / pi; beta is multiplied by albedo

beta is the throughput, cos is the cosine of the sampled direction to the shading normal, L is the radiance of
the light, and density is per steradian.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.sampling import cosine_direction, tangent_frame, triangle_barycentric
from baker.pathtracer.light_table import (
    FAR,
    KIND_CONE,
    KIND_EMITTER,
    KIND_EVEN,
    KIND_PARALLEL,
    KIND_SKY,
    KIND_TABULATED,
    ROW_CONE_SCALE,
    ROW_EDGE,
    ROW_GAIN,
    ROW_INVERSE_RANGE,
    ROW_KIND,
    ROW_MIN_COSINE,
    ROW_NORMAL,
    ROW_ORIGIN,
    ROW_RADIANCE,
    ROW_TWO_SIDED,
    SHORT,
    tabulated,
)
from baker.pathtracer.path_blocks import (
    ALBEDO,
    ALIVE,
    B1,
    B2,
    BETA,
    BITANGENT,
    BLOCK_WIDTH,
    BOUNCES,
    COSINE,
    DENSITY,
    LIGHT_ROW,
    MAX_DISTANCE,
    NORMAL,
    ROULETTE,
    SHADED,
    TANGENT,
    TO_LIGHT,
    TRIANGLE,
    U_DIRECTION,
    U_LIGHT,
    VALUE,
    W_DIRECTION,
    W_LIGHT,
    unsigned,
)
from baker.pathtracer.scene import CORNER, FACE, SHADING, TWO_SIDED
from baker.pathtracer.vertex import MOST, OFFSET, ROUNDING, SURE
from baker.trace.jit import inner
from baker.trace.packets import DIR_X, DIR_Y, DIR_Z, HIT_U, HIT_V, ORG_X, ORG_Y, ORG_Z

_f = np.float32
# Constants are in float32, because a float64 constant would convert whole expressions to float64.
_ZERO, _ONE = _f(0.0), _f(1.0)
_PI, _INV_PI = _f(math.pi), _f(1.0 / math.pi)
_OFFSET, _ROUNDING, _SHORT, _FAR = _f(OFFSET), _f(ROUNDING), _f(SHORT), _f(FAR)
_SURE, _MOST = _f(SURE), _f(MOST)
_EMITTER, _CONE, _PARALLEL, _SKY = _f(KIND_EMITTER), _f(KIND_CONE), _f(KIND_PARALLEL), _f(KIND_SKY)
# Indices, in a block, of the first number of the triangle's copy and of the light's copy.
_T = TRIANGLE * BLOCK_WIDTH
_M = LIGHT_ROW * BLOCK_WIDTH
_L = BLOCK_WIDTH


@inner
def offset_and_frame(s, base, lane, x, y, z, min_offset_scale, size):
    """Write a lane's ray origin and tangent frame.

    The origin is (x, y, z), offset along `NORMAL`. The tangent frame is about `SHADED`.

    s : blocks, float32, with `NORMAL` and `SHADED` of the lane
    base : index of the block's first number
    min_offset_scale, size : float32, metres, see `vertex.offset_origin`
    """
    far = max(max(abs(x), abs(y)), abs(z))
    off = max(_ROUNDING * max(far, size), _OFFSET * min(max(far, min_offset_scale), size))
    s[base + ORG_X * _L + lane] = x + off * s[base + NORMAL * _L + lane]
    s[base + ORG_Y * _L + lane] = y + off * s[base + (NORMAL + 1) * _L + lane]
    s[base + ORG_Z * _L + lane] = z + off * s[base + (NORMAL + 2) * _L + lane]
    tx, ty, tz, bx, by, bz = tangent_frame(
        s[base + SHADED * _L + lane], s[base + (SHADED + 1) * _L + lane], s[base + (SHADED + 2) * _L + lane]
    )
    s[base + TANGENT * _L + lane] = tx
    s[base + (TANGENT + 1) * _L + lane] = ty
    s[base + (TANGENT + 2) * _L + lane] = tz
    s[base + BITANGENT * _L + lane] = bx
    s[base + (BITANGENT + 1) * _L + lane] = by
    s[base + (BITANGENT + 2) * _L + lane] = bz


@inner
def start_vertices(s, base, min_offset_scale, default_size):
    """Set up the first vertex of each lane at its surface point: ray origin and tangent frame.

    s : blocks, float32, with the points in the rows of the ray origin
    min_offset_scale, default_size : float32, metres, see `Surfaces`
    """
    base = unsigned(base)
    for lane in range(BLOCK_WIDTH):
        x, y, z = s[base + ORG_X * _L + lane], s[base + ORG_Y * _L + lane], s[base + ORG_Z * _L + lane]
        offset_and_frame(s, base, lane, x, y, z, min_offset_scale, default_size)


@inner
def edge_lane(s, base, lane, a):
    """Return the larger absolute component along axis a of the two edges at corner 0 of a lane's triangle.

    s : blocks, float32
    """
    at = base + _T + (CORNER + a) * _L + lane
    return max(abs(s[at + 3 * _L] - s[at]), abs(s[at + 6 * _L] - s[at]))


@inner
def weighted(s, base, column, lane, b, u, v):
    """Interpolate a vector of the three corners of a lane's triangle at barycentrics (b, u, v).

    s : blocks, float32; column : `CORNER` for positions, `SHADING` for shading normals
    """
    at = base + _T + column * _L + lane
    return (
        b * s[at] + u * s[at + 3 * _L] + v * s[at + 6 * _L],
        b * s[at + _L] + u * s[at + 4 * _L] + v * s[at + 7 * _L],
        b * s[at + 2 * _L] + u * s[at + 5 * _L] + v * s[at + 8 * _L],
    )


@inner
def arrive_lanes(s, base, min_offset_scale):
    """Set up the vertices at the lanes' hits; end paths that hit the black back of a one-sided surface.

    s : blocks, float32, with copies of the hit triangles
    min_offset_scale : float32, metres, see `Surfaces`
    """
    base = unsigned(base)
    for lane in range(BLOCK_WIDTH):
        u, v = s[base + HIT_U * _L + lane], s[base + HIT_V * _L + lane]
        b = _ONE - u - v
        fx, fy, fz = (
            s[base + _T + FACE * _L + lane],
            s[base + _T + (FACE + 1) * _L + lane],
            s[base + _T + (FACE + 2) * _L + lane],
        )
        facing = (
            s[base + DIR_X * _L + lane] * fx
            + s[base + DIR_Y * _L + lane] * fy
            + s[base + DIR_Z * _L + lane] * fz
        )
        sign = _ONE if facing < _ZERO else -_ONE
        two_sided = s[base + _T + TWO_SIDED * _L + lane] > _ZERO
        s[base + ALIVE * _L + lane] *= _ONE if facing < _ZERO or two_sided else _ZERO
        s[base + NORMAL * _L + lane] = sign * fx
        s[base + (NORMAL + 1) * _L + lane] = sign * fy
        s[base + (NORMAL + 2) * _L + lane] = sign * fz
        x, y, z = weighted(s, base, CORNER, lane, b, u, v)
        nx, ny, nz = weighted(s, base, SHADING, lane, b, u, v)
        square = nx * nx + ny * ny + nz * nz
        bent = square > _f(1.0e-12) and nx * fx + ny * fy + nz * fz > _ZERO
        scale = sign / math.sqrt(square if bent else _ONE)
        s[base + SHADED * _L + lane] = scale * (nx if bent else fx)
        s[base + (SHADED + 1) * _L + lane] = scale * (ny if bent else fy)
        s[base + (SHADED + 2) * _L + lane] = scale * (nz if bent else fz)
        size = max(max(edge_lane(s, base, lane, 0), edge_lane(s, base, lane, 1)), edge_lane(s, base, lane, 2))
        offset_and_frame(s, base, lane, x, y, z, min_offset_scale, size)


@inner
def look_up_falloff(s, base, lights, light):
    """Multiply ROW_GAIN of each lane's tabulated light by its fall-off, and set ROW_KIND to KIND_EVEN.

    s : blocks, with copies of the lights; lights : `LightTable`
    light : (8,) int64, numbers of the lanes' lights
    """
    base = unsigned(base)
    n = len(lights.emitter)
    for lane in range(BLOCK_WIDTH):
        if s[base + _M + ROW_KIND * _L + lane] != _f(KIND_TABULATED):
            continue
        dx = np.float64(s[base + ORG_X * _L + lane]) - s[base + _M + ROW_ORIGIN * _L + lane]
        dy = np.float64(s[base + ORG_Y * _L + lane]) - s[base + _M + (ROW_ORIGIN + 1) * _L + lane]
        dz = np.float64(s[base + ORG_Z * _L + lane]) - s[base + _M + (ROW_ORIGIN + 2) * _L + lane]
        length = math.sqrt(max(dx * dx + dy * dy + dz * dz, 1.0e-20))
        dx, dy, dz = dx / length, dy / length, dz / length
        cosine = (
            dx * s[base + _M + ROW_NORMAL * _L + lane]
            + dy * s[base + _M + (ROW_NORMAL + 1) * _L + lane]
            + dz * s[base + _M + (ROW_NORMAL + 2) * _L + lane]
        )
        share = tabulated(lights.falloff, lights.delta, light[lane] - n, cosine, dx, dy, dz)
        s[base + _M + ROW_GAIN * _L + lane] *= _f(share)
        s[base + _M + ROW_KIND * _L + lane] = _f(KIND_EVEN)


@inner
def aim_at_lights(s, base, mode, power):
    """Sample a ray from each lane's vertex to the lane's light.

    Writes the unit direction of the ray, its length in metres, and its contribution if nothing blocks it. The
    contribution is 0 if the ray points below the surface.

    s : blocks, float32, with copies of the lights; mode, power : `Estimator.aim` and `.power`
    """
    base = unsigned(base)
    for lane in range(BLOCK_WIDTH):
        u, w = s[base + U_LIGHT * _L + lane] - _ONE, s[base + W_LIGHT * _L + lane] - _ONE
        kind = s[base + _M + ROW_KIND * _L + lane]
        sky = kind == _SKY
        b1, b2 = triangle_barycentric(u, w)
        # Compute the vector to a point on the light. For lights without area, the edges are 0. For parallel
        # light and the sky, `near` is 0.
        near = _ONE if kind < _PARALLEL else _ZERO
        dx = (
            s[base + _M + ROW_ORIGIN * _L + lane]
            + b1 * s[base + _M + ROW_EDGE * _L + lane]
            + b2 * s[base + _M + (ROW_EDGE + 3) * _L + lane]
            - near * s[base + ORG_X * _L + lane]
        )
        dy = (
            s[base + _M + (ROW_ORIGIN + 1) * _L + lane]
            + b1 * s[base + _M + (ROW_EDGE + 1) * _L + lane]
            + b2 * s[base + _M + (ROW_EDGE + 4) * _L + lane]
            - near * s[base + ORG_Y * _L + lane]
        )
        dz = (
            s[base + _M + (ROW_ORIGIN + 2) * _L + lane]
            + b1 * s[base + _M + (ROW_EDGE + 2) * _L + lane]
            + b2 * s[base + _M + (ROW_EDGE + 5) * _L + lane]
            - near * s[base + ORG_Z * _L + lane]
        )
        # Sample a cosine-weighted direction for the sky
        a, b, c = cosine_direction(u, w)
        tx, ty, tz = (
            s[base + TANGENT * _L + lane],
            s[base + (TANGENT + 1) * _L + lane],
            s[base + (TANGENT + 2) * _L + lane],
        )
        bx, by, bz = (
            s[base + BITANGENT * _L + lane],
            s[base + (BITANGENT + 1) * _L + lane],
            s[base + (BITANGENT + 2) * _L + lane],
        )
        nx, ny, nz = (
            s[base + SHADED * _L + lane],
            s[base + (SHADED + 1) * _L + lane],
            s[base + (SHADED + 2) * _L + lane],
        )
        dx = a * tx + b * bx + c * nx if sky else dx
        dy = a * ty + b * by + c * ny if sky else dy
        dz = a * tz + b * bz + c * nz if sky else dz
        square = max(dx * dx + dy * dy + dz * dz, _f(1.0e-20))
        length = math.sqrt(square)
        shrink = _ONE / length
        dx, dy, dz = dx * shrink, dy * shrink, dz * shrink
        # Compute cosine and fall-off at the light
        at_light = -(
            dx * s[base + _M + ROW_NORMAL * _L + lane]
            + dy * s[base + _M + (ROW_NORMAL + 1) * _L + lane]
            + dz * s[base + _M + (ROW_NORMAL + 2) * _L + lane]
        )
        cosine = abs(at_light) if s[base + _M + ROW_TWO_SIDED * _L + lane] > _ZERO else at_light
        inside = (at_light - s[base + _M + ROW_MIN_COSINE * _L + lane]) * s[
            base + _M + ROW_CONE_SCALE * _L + lane
        ]
        inside = min(max(inside, _ZERO), _ONE)
        # Compute the gain. For emitters and the sky, it is 1 / density, per steradian. For lights without
        # area, it is the irradiance of a surface that faces the light, per unit intensity, divided by the
        # light's probability.
        here = dx * nx + dy * ny + dz * nz
        gain = s[base + _M + ROW_GAIN * _L + lane]
        area = kind == _EMITTER
        gain *= (cosine if cosine > _f(1.0e-9) else _ZERO) if area else _ONE
        gain *= inside * inside if kind == _CONE else _ONE
        faded = square * s[base + _M + ROW_INVERSE_RANGE * _L + lane]
        gain *= _ONE if area else max(_ONE - faded * faded, _ZERO)
        gain *= _PI / max(c, _f(1.0e-9)) if sky else near / square + (_ONE - near)
        above = (
            dx * s[base + NORMAL * _L + lane]
            + dy * s[base + (NORMAL + 1) * _L + lane]
            + dz * s[base + (NORMAL + 2) * _L + lane]
        )
        # Compute the MIS weight
        ratio = here * _INV_PI * gain
        ratio = ratio * ratio if power != 0 else ratio
        spread = area or sky
        weight = _ONE / (_ONE + ratio) if spread and mode == 2 else _ONE
        usable = above > _ZERO and here > _ZERO and s[base + ALIVE * _L + lane] > _ZERO
        scale = gain * weight * here * _INV_PI if usable and (mode > 0 or not spread) else _ZERO
        for k in range(3):
            s[base + (VALUE + k) * _L + lane] = (
                scale
                * s[base + (BETA + k) * _L + lane]
                * s[base + (ALBEDO + k) * _L + lane]
                * s[base + _M + (ROW_RADIANCE + k) * _L + lane]
            )
        (
            s[base + TO_LIGHT * _L + lane],
            s[base + (TO_LIGHT + 1) * _L + lane],
            s[base + (TO_LIGHT + 2) * _L + lane],
        ) = dx, dy, dz
        s[base + MAX_DISTANCE * _L + lane] = length * _SHORT if near > _ZERO else _FAR
        s[base + B1 * _L + lane], s[base + B2 * _L + lane] = b1, b2


@inner
def scatter_lanes(s, base):
    """Sample the next direction of each lane's path, and apply Russian roulette.

    s : blocks, float32
    """
    base = unsigned(base)
    for lane in range(BLOCK_WIDTH):
        u, w = s[base + U_DIRECTION * _L + lane] - _ONE, s[base + W_DIRECTION * _L + lane] - _ONE
        a, b, c = cosine_direction(u, w)
        dx = (
            a * s[base + TANGENT * _L + lane]
            + b * s[base + BITANGENT * _L + lane]
            + c * s[base + SHADED * _L + lane]
        )
        dy = (
            a * s[base + (TANGENT + 1) * _L + lane]
            + b * s[base + (BITANGENT + 1) * _L + lane]
            + c * s[base + (SHADED + 1) * _L + lane]
        )
        dz = (
            a * s[base + (TANGENT + 2) * _L + lane]
            + b * s[base + (BITANGENT + 2) * _L + lane]
            + c * s[base + (SHADED + 2) * _L + lane]
        )
        above = (
            dx * s[base + NORMAL * _L + lane]
            + dy * s[base + (NORMAL + 1) * _L + lane]
            + dz * s[base + (NORMAL + 2) * _L + lane]
        )
        red = s[base + BETA * _L + lane] * s[base + ALBEDO * _L + lane]
        green = s[base + (BETA + 1) * _L + lane] * s[base + (ALBEDO + 1) * _L + lane]
        blue = s[base + (BETA + 2) * _L + lane] * s[base + (ALBEDO + 2) * _L + lane]
        most = max(max(red, green), blue)
        survive = min(most, _MOST) if s[base + BOUNCES * _L + lane] >= _SURE else _ONE
        goes_on = (
            c > _ZERO and above > _ZERO and s[base + ROULETTE * _L + lane] - _ONE < survive and most > _ZERO
        )
        scale = _ONE / (survive if survive > _ZERO else _ONE)
        s[base + ALIVE * _L + lane] *= _ONE if goes_on else _ZERO
        s[base + DIR_X * _L + lane], s[base + DIR_Y * _L + lane], s[base + DIR_Z * _L + lane] = dx, dy, dz
        s[base + BETA * _L + lane] = red * scale
        s[base + (BETA + 1) * _L + lane] = green * scale
        s[base + (BETA + 2) * _L + lane] = blue * scale
        s[base + DENSITY * _L + lane] = c * _INV_PI
        s[base + COSINE * _L + lane] = c
