"""Everything that emits, as one table that paths aim at: triangles, lights without area, the sky.

A lamp is chosen by a fixed chance, half of it by power and half equally among kinds, so that neither a sun
nor a candle is starved. Whatever the chances, estimates stay unbiased: each is divided by its own.

Based on: Shirley, Wang and Zimmerman, Monte Carlo techniques for direct lighting calculations, 1996;
KHR_lights_punctual.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.core.colour import LUMINANCE_WEIGHTS
from baker.core.errors import InputError
from baker.core.geometry import Geometry
from baker.core.light_kind import Distribution, kind_of
from baker.core.scene import PunctualLight, Scene
from baker.kernels.sampling import triangle_barycentric
from baker.kernels.shading import Shading
from baker.lights.emissive import build_emitters
from baker.lights.families.point import range_window
from baker.trace.jit import inner

_LUMINANCE = np.array(LUMINANCE_WEIGHTS)
# Columns of an emissive triangle or part of one: three corners, face normal, area, two-sided, chance,
# radiance without texture, textured, which part it is (see `kernels.emitters`).
CORNER, NORMAL, AREA, TWO_SIDED, CHANCE, RADIANCE, TEXTURED, INSIDE = 0, 9, 12, 13, 14, 15, 18, 19
# Parts that textured triangles may be cut into: more than in bakes, as each point's radiance is looked up.
MOST_PARTS = 131072
# Columns of a light without area: 0 point, 1 spot, 2 directional; position, direction, intensity, outer
# cosine, one over the cone's width, chance, 1 / range^2 (0 without a range).
KIND, POSITION, DIRECTION, INTENSITY, OUTER, SCALE, POINT_CHANCE, INVERSE_RANGE = 0, 1, 4, 7, 10, 11, 12, 13
# Columns of any lamp as `vertex_simd` takes it: a corner (of a light without area its place, of parallel
# light the way towards it), two edges, normal (a spot's axis), area over chance (or 1 over chance),
# two-sided (of a light without area 1 / range^2), outer cosine, one over the cone's width, radiance or
# intensity, and what it is: 0 triangle, 1 point, 2 spot, 3 directional, 4 sky.
LANE_CORNER, LANE_EDGE, LANE_NORMAL, LANE_GAIN, LANE_TWO_SIDED = 0, 3, 9, 12, 13
LANE_OUTER, LANE_SCALE, LANE_RADIANCE, LANE_KIND = 14, 15, 16, 19
LANE_INVERSE_RANGE = LANE_TWO_SIDED
# The number of each distribution in column KIND: kernels compare it.
_KINDS = {Distribution.ISOTROPIC: 0.0, Distribution.CONE: 1.0, Distribution.PARALLEL: 2.0}
# A directional light and the sky end nowhere; rays to other lamps end this share of their way before them.
FAR = 1.0e30
SHORT = 0.9999


class LampTable(NamedTuple):
    """Lamps in the order triangles, lights without area, sky.

    triangle (E, 24), point (P, 16) float64, see the column names; number (E,) int32, triangle of the scene;
    emitter (T,) int32, what of `triangle` a scene triangle is, in the code of `kernels.emitters.emitter_at`;
    node (K, 4) int32, see there; cumulative (E + P + 1,) float64, last 1 (0 if nothing emits); sky (4,)
    float64: radiance, chance; every (E + P + 1, 20) float32, all lamps alike, see the column names; glows
    int: 1 if any has a texture.
    """

    triangle: NDArray[np.float64]
    point: NDArray[np.float64]
    number: NDArray[np.int32]
    emitter: NDArray[np.int32]
    node: NDArray[np.int32]
    cumulative: NDArray[np.float64]
    sky: NDArray[np.float64]
    every: NDArray[np.float32]
    glows: int


def build_lamps(
    scene: Scene, geometry: Geometry, shading: Shading, sky: tuple[float, float, float]
) -> LampTable:
    """Collect what emits.

    Parameters
    ----------
    sky : radiance of the constant sky, cd/m2, linear Rec.709
    """
    found = build_emitters(geometry, shading, MOST_PARTS)
    n = len(found.triangle)
    # `build_emitters` shares a cluster's power out among its triangles.
    power = (
        found.row[:, 14].astype(np.float64) * found.power[found.row[:, 16].astype(np.int64)]
        if n
        else np.zeros(0)
    )
    triangle = np.zeros((n, 24))
    triangle[:, CORNER : CORNER + 9] = found.row[:, :9]
    triangle[:, NORMAL : NORMAL + 3] = found.row[:, 9:12]
    triangle[:, AREA], triangle[:, TWO_SIDED] = found.row[:, 12], found.row[:, 13]
    # `build_emitters` says where to aim; what shines there is looked up in the material itself.
    material = geometry.material[found.triangle]
    triangle[:, RADIANCE : RADIANCE + 3] = shading.emission[material]
    triangle[:, TEXTURED] = shading.emission_texture[material] >= 0
    triangle[:, INSIDE : INSIDE + 3] = found.row[:, 21:24]
    disc = math.pi * (0.5 * geometry.diagonal) ** 2
    point, point_power = _without_area(scene.local_lights, disc)
    sky_power = float(np.array(sky) @ _LUMINANCE) * math.pi * 4.0 * disc
    every = np.concatenate([power, point_power, [sky_power]])
    chance = _chances(every, [slice(0, n), *(slice(n + i, n + i + 1) for i in range(len(point) + 1))])
    triangle[:, CHANCE] = chance[:n]
    point[:, POINT_CHANCE] = chance[n:-1]
    cumulative = np.cumsum(chance)
    if cumulative[-1] > 0:
        cumulative /= cumulative[-1]
    last = np.array([*sky, chance[-1]])
    glows = int((triangle[:, TEXTURED] > 0).any())
    every = all_alike(triangle, point, last)
    return LampTable(triangle, point, found.triangle, found.root, found.node, cumulative, last, every, glows)


def _without_area(
    lights: tuple[PunctualLight, ...], disc: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return rows (P, 16), without their chances, and power (P,) of the lights without area that shine.

    disc : float, m2, area of a disc as wide as the scene

    Raises
    ------
    InputError
        If a light is of an unknown kind, or of one that the kernels cannot trace.
    """
    number = [_kernel_number(light) for light in lights]
    shining = [(light, n) for light, n in zip(lights, number, strict=True) if max(light.intensity) > 0]
    point = np.zeros((len(shining), 16))
    power = np.zeros(len(shining))
    for row, (light, n) in enumerate(shining):
        kind, outer = kind_of(light), math.cos(light.outer_cone)
        point[row, KIND] = n
        point[row, POSITION : POSITION + 3] = light.position
        point[row, DIRECTION : DIRECTION + 3] = light.direction
        point[row, INTENSITY : INTENSITY + 3] = light.intensity
        point[row, OUTER] = outer
        point[row, SCALE] = 1.0 / max(0.001, math.cos(light.inner_cone) - outer)
        point[row, INVERSE_RANGE] = light.inverse_range if kind.has_position else 0.0
        power[row] = float(np.array(light.intensity) @ _LUMINANCE) * kind.power(light, disc)
    return point, power


def _kernel_number(light: PunctualLight) -> float:
    """Return the number by which kernels know a light without area."""
    kind = kind_of(light)
    number = _KINDS.get(kind.distribution)
    if number is None or not kind.delta:
        message = f"the path tracer has no kernels for {kind.name} lights; leave it out"
        raise InputError(message, object=f"light '{light.name}'")
    return number


def all_alike(
    triangle: NDArray[np.float64], point: NDArray[np.float64], sky: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return all lamps as rows of one kind."""
    n, p = len(triangle), len(point)
    row = np.zeros((n + p + 1, 20))
    area, spot, last = row[:n], row[n : n + p], row[n + p]
    corner = triangle[:, CORNER : CORNER + 9].reshape(n, 3, 3)
    area[:, LANE_CORNER : LANE_CORNER + 3] = corner[:, 0]
    area[:, LANE_EDGE : LANE_EDGE + 6] = (corner[:, 1:] - corner[:, :1]).reshape(n, 6)
    area[:, LANE_NORMAL : LANE_NORMAL + 3] = triangle[:, NORMAL : NORMAL + 3]
    area[:, LANE_GAIN] = triangle[:, AREA] / np.maximum(triangle[:, CHANCE], 1e-30)
    area[:, LANE_TWO_SIDED] = triangle[:, TWO_SIDED]
    area[:, LANE_RADIANCE : LANE_RADIANCE + 3] = triangle[:, RADIANCE : RADIANCE + 3]
    way = point[:, DIRECTION : DIRECTION + 3]
    parallel = point[:, KIND, None] == _KINDS[Distribution.PARALLEL]
    spot[:, LANE_CORNER : LANE_CORNER + 3] = np.where(parallel, -way, point[:, POSITION : POSITION + 3])
    spot[:, LANE_NORMAL : LANE_NORMAL + 3] = way
    spot[:, LANE_GAIN] = 1.0 / np.maximum(point[:, POINT_CHANCE], 1e-30)
    spot[:, LANE_OUTER], spot[:, LANE_SCALE] = point[:, OUTER], point[:, SCALE]
    spot[:, LANE_INVERSE_RANGE] = point[:, INVERSE_RANGE]
    spot[:, LANE_RADIANCE : LANE_RADIANCE + 3] = point[:, INTENSITY : INTENSITY + 3]
    spot[:, LANE_KIND] = 1.0 + point[:, KIND]
    last[LANE_GAIN] = 1.0 / max(sky[3], 1e-30)
    last[LANE_RADIANCE : LANE_RADIANCE + 3] = sky[:3]
    last[LANE_KIND] = 4.0
    return row.astype(np.float32)


def _chances(power: NDArray[np.float64], groups: list[slice]) -> NDArray[np.float64]:
    """Return chances: half by power over all, half equally among groups (inside a group by power)."""
    total = power.sum()
    if not total > 0:
        return np.zeros(len(power))
    lit = [group for group in groups if power[group].sum() > 0]
    chance: NDArray[np.float64] = 0.5 * power / total
    for group in lit:
        chance[group] += 0.5 / len(lit) * power[group] / power[group].sum()
    return chance


@inner
def pick_lamp(cumulative, u):  # type: ignore[no-untyped-def]
    """Return the number of the lamp that the uniform number u falls on."""
    low = 0
    high = len(cumulative) - 1
    while low < high:
        middle = (low + high) // 2
        if cumulative[middle] > u:
            high = middle
        else:
            low = middle + 1
    return low


@inner
def aim_at_triangle(triangle, e, u, w, x, y, z):  # type: ignore[no-untyped-def]
    """Return the way from (x, y, z) to a uniform point of emitter e: dx, dy, dz, density, b1, b2.

    The density is per steradian and contains the emitter's chance; 0 if its dark side faces the point.
    """
    b1, b2 = triangle_barycentric(np.float32(u), np.float32(w))
    dx = (1.0 - b1 - b2) * triangle[e, 0] + b1 * triangle[e, 3] + b2 * triangle[e, 6] - x
    dy = (1.0 - b1 - b2) * triangle[e, 1] + b1 * triangle[e, 4] + b2 * triangle[e, 7] - y
    dz = (1.0 - b1 - b2) * triangle[e, 2] + b1 * triangle[e, 5] + b2 * triangle[e, 8] - z
    density = triangle_density(triangle, e, dx, dy, dz)
    return dx, dy, dz, density, b1, b2


@inner
def on_whole_triangle(triangle, e, b1, b2):  # type: ignore[no-untyped-def]
    """Return barycentrics of the scene's triangle from those of emitter e, which may be a part of it."""
    size = triangle[e, INSIDE + 2]
    return triangle[e, INSIDE] + size * b1, triangle[e, INSIDE + 1] + size * b2


@inner
def triangle_density(triangle, e, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Return the density per steradian with which a point at the end of d on emitter e is aimed at."""
    square = dx * dx + dy * dy + dz * dz
    if square <= 0.0:
        return 0.0
    cosine = -(dx * triangle[e, NORMAL] + dy * triangle[e, NORMAL + 1] + dz * triangle[e, NORMAL + 2])
    cosine /= math.sqrt(square)
    if triangle[e, TWO_SIDED] > 0.0:
        cosine = abs(cosine)
    if cosine <= 1.0e-9:
        return 0.0
    return triangle[e, CHANCE] / triangle[e, AREA] * square / cosine


@inner
def aim_at_point_light(point, e, x, y, z):  # type: ignore[no-untyped-def]
    """Return the way from (x, y, z) to a light without area: dx, dy, dz, reach, irradiance per intensity.

    The direction is unit, the reach in metres; the irradiance is that of a surface facing the light.
    """
    if point[e, KIND] == 2.0:
        return -point[e, DIRECTION], -point[e, DIRECTION + 1], -point[e, DIRECTION + 2], FAR, 1.0
    dx, dy, dz = point[e, POSITION] - x, point[e, POSITION + 1] - y, point[e, POSITION + 2] - z
    square = max(dx * dx + dy * dy + dz * dz, 1.0e-20)
    length = math.sqrt(square)
    dx, dy, dz = dx / length, dy / length, dz / length
    cosine = -(dx * point[e, DIRECTION] + dy * point[e, DIRECTION + 1] + dz * point[e, DIRECTION + 2])
    share = spot_share(point, e, cosine)
    share *= range_window(square, point[e, INVERSE_RANGE])
    return dx, dy, dz, length * SHORT, share / square


@inner
def spot_share(point, e, cosine):  # type: ignore[no-untyped-def]
    """Return the share of its intensity that light e sends at this cosine to its axis; 1 if it is no spot."""
    if point[e, KIND] != 1.0:
        return 1.0
    share = min(max((cosine - point[e, OUTER]) * point[e, SCALE], 0.0), 1.0)
    return share * share
