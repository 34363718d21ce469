"""Builds the table of all lights that paths sample: emitters, lights without area, and the sky.

Each light is chosen with a fixed probability. Half of the total probability is distributed in proportion to
power. The other half is divided equally among groups. All emitters together are one group, each light without
area is a group, and the sky is a group. So weak lights get enough samples beside a strong light such as the
sun. Each estimate is divided by the probability of its light, so that its expectation does not depend on the
probabilities.

The modules of `baker.lights.kinds` describe lights without area as `EmissionProfile`s. Kernels distinguish
four forms of profile: even, cone, parallel and tabulated. A tabulated profile is a table of fall-off values,
which the kernels interpolate. Such a table can express any fall-off, so new kinds of light need no change in
this file.

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
from baker.core.light_kind import EmissionProfile, kind_of
from baker.core.scene import PunctualLight, Scene
from baker.kernels.sampling import triangle_barycentric
from baker.kernels.shading import Shading
from baker.pathtracer.emitters import (
    EMITTER_AREA,
    EMITTER_CHANCE,
    EMITTER_CORNER,
    EMITTER_NORMAL,
    EMITTER_PART,
    EMITTER_RADIANCE,
    EMITTER_TEXTURED,
    EMITTER_TWO_SIDED,
    find_emitters,
)
from baker.trace.jit import inner

_LUMINANCE = np.array(LUMINANCE_WEIGHTS)
# Columns of a light without area, from its `EmissionProfile`. A quantity has one column, or as many as the
# number in parentheses says:
#
#     DELTA_FORM            form of the profile: EVEN, CONE, PARALLEL or TABULATED
#     DELTA_POSITION        metres, relative to the geometry's origin; 0 for parallel light (3)
#     DELTA_AXIS            unit direction in which the light shines (3)
#     DELTA_INTENSITY       cd, or lx for parallel light (3)
#     DELTA_MIN_COSINE      cosine of the largest angle to the axis
#     DELTA_CONE_SCALE      `EmissionProfile.cone_scale`; 0 if None
#     DELTA_CHANCE          probability with which the light is chosen
#     DELTA_INVERSE_RANGE   1 / range^2, 1/m2; 0 without a range
#     DELTA_TANGENT         unit direction of azimuth 0, if tabulated (3)
#     DELTA_TABLE           index in `LightTable.falloff` of the first number of its fall-off table
#     DELTA_COSINES         number of rows of the table, one for each cosine
#     DELTA_AZIMUTHS        number of columns of the table, one for each azimuth
DELTA_FORM, DELTA_POSITION, DELTA_AXIS, DELTA_INTENSITY, DELTA_MIN_COSINE, DELTA_CONE_SCALE = (
    0,
    1,
    4,
    7,
    10,
    11,
)
DELTA_CHANCE, DELTA_INVERSE_RANGE, DELTA_TANGENT = 12, 13, 14
DELTA_TABLE, DELTA_COSINES, DELTA_AZIMUTHS = 17, 18, 19
DELTA_COLUMNS = 20
# Values of DELTA_FORM.
EVEN, CONE, PARALLEL, TABULATED = 0.0, 1.0, 2.0, 3.0
# Columns of any light in `LightTable.row`, which `vertex_simd` reads. Numbers in parentheses as above:
#
#     ROW_ORIGIN          corner 0 of an emitter, position of a light, or direction towards parallel light (3)
#     ROW_EDGE            the two edges at corner 0 of an emitter; 0 for other lights (6)
#     ROW_NORMAL          unit normal of an emitter, axis of a light without area (3)
#     ROW_GAIN            area / probability of an emitter; 1 / probability of other lights
#     ROW_TWO_SIDED       1 for two-sided emitters
#     ROW_INVERSE_RANGE   1 / range^2 of a light without area; shares the column of ROW_TWO_SIDED
#     ROW_MIN_COSINE      DELTA_MIN_COSINE of a light without area
#     ROW_CONE_SCALE      DELTA_CONE_SCALE of a light without area
#     ROW_RADIANCE        radiance of an emitter without texture or of the sky; intensity of other lights (3)
#     ROW_KIND            a constant from KIND_EMITTER to KIND_TABULATED
ROW_ORIGIN, ROW_EDGE, ROW_NORMAL, ROW_GAIN, ROW_TWO_SIDED = 0, 3, 9, 12, 13
ROW_MIN_COSINE, ROW_CONE_SCALE, ROW_RADIANCE, ROW_KIND = 14, 15, 16, 19
ROW_INVERSE_RANGE = ROW_TWO_SIDED
ROW_COLUMNS = 20
# Values of ROW_KIND. `vertex_simd` treats kinds below KIND_PARALLEL as lights at a finite distance. For a
# tabulated light, it first multiplies ROW_GAIN by the fall-off, and then treats the light as KIND_EVEN.
KIND_EMITTER, KIND_EVEN, KIND_CONE, KIND_PARALLEL, KIND_SKY, KIND_TABULATED = 0.0, 1.0, 2.0, 3.0, 4.0, 5.0
_ROW_KIND = {EVEN: KIND_EVEN, CONE: KIND_CONE, PARALLEL: KIND_PARALLEL, TABULATED: KIND_TABULATED}
# Columns of the sky: radiance, cd/m2, three columns; probability with which it is chosen.
SKY_RADIANCE, SKY_CHANCE = 0, 3
# FAR: length of rays to parallel light and to the sky, metres. SHORT: length of rays to other lights, as a
# share of the distance to the light.
FAR = 1.0e30
SHORT = 0.9999


class LightTable(NamedTuple):
    """All lights that paths sample, numbered in this order: E emitters, P lights without area, the sky.

    Attributes
    ----------
    emitter : (E, 24) float64
        Emitters. Columns: EMITTER_CORNER to EMITTER_PART of `pathtracer.emitters`.
    delta : (P, 20) float64
        Lights without area. Columns: `DELTA_FORM` to `DELTA_AZIMUTHS`.
    triangle : (E,) int32
        Triangle of the scene that contains each emitter.
    code : (T,) int32
        For each triangle of the scene, a number for its emitter or its parts, see `FoundEmitters.code`.
    node : (K, 4) int32
        For each division of a triangle into four parts, a number for each part, see `FoundEmitters.node`.
    cumulative : (E + P + 1,) float64
        Cumulative probabilities of the lights. The last is 1, or 0 if nothing emits.
    sky : (4,) float64
        Radiance of the sky, cd/m2, and its probability.
    row : (E + P + 1, 20) float32
        All lights. Columns: `ROW_ORIGIN` to `ROW_KIND`.
    falloff : (N,) float32
        Fall-off tables of tabulated profiles, one after another. A table has one row for each cosine and one
        column for each azimuth.
    textured : int
        1 if any emitter has a texture.
    """

    emitter: NDArray[np.float64]
    delta: NDArray[np.float64]
    triangle: NDArray[np.int32]
    code: NDArray[np.int32]
    node: NDArray[np.int32]
    cumulative: NDArray[np.float64]
    sky: NDArray[np.float64]
    row: NDArray[np.float32]
    falloff: NDArray[np.float32]
    textured: int


def build_light_table(
    scene: Scene, geometry: Geometry, shading: Shading, sky: tuple[float, float, float]
) -> LightTable:
    """Collect emitters, lights without area and the sky.

    Parameters
    ----------
    scene : Scene
        The scene; only its lights without area are read.
    geometry : Geometry
        The scene's triangles.
    shading : Shading
        The materials of the triangles.
    sky : tuple of 3 float
        Radiance of the constant sky, cd/m2, linear Rec.709.

    Returns
    -------
    LightTable
        All lights, with their probabilities.

    Raises
    ------
    InputError
        If the kind of a light is unknown, or has no `EmissionProfile`.
    """
    found = find_emitters(geometry, shading)
    emitter, n = found.row, len(found.row)
    disc = math.pi * (0.5 * geometry.diagonal) ** 2
    delta, delta_power, falloff = _without_area(scene.local_lights, disc)
    sky_power = float(np.array(sky) @ _LUMINANCE) * math.pi * 4.0 * disc
    power = np.concatenate([found.power, delta_power, [sky_power]])
    chance = _chances(power, [slice(0, n), *(slice(n + i, n + i + 1) for i in range(len(delta) + 1))])
    emitter[:, EMITTER_CHANCE] = chance[:n]
    delta[:, DELTA_CHANCE] = chance[n:-1]
    cumulative = np.cumsum(chance)
    if cumulative[-1] > 0:
        cumulative /= cumulative[-1]
    last = np.array([*sky, chance[-1]])
    textured = int((emitter[:, EMITTER_TEXTURED] > 0).any())
    row = light_rows(emitter, delta, last)
    return LightTable(
        emitter, delta, found.triangle, found.code, found.node, cumulative, last, row, falloff, textured
    )


def _without_area(
    lights: tuple[PunctualLight, ...], disc: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float32]]:
    """Return `LightTable.delta`, the powers (P,) in lm, and `LightTable.falloff` of lights without area.

    Black lights are left out. The column DELTA_CHANCE is still 0.

    disc : float, m2, area of a disc whose diameter is the scene's diagonal
    """
    profiles = [(light, _profile(light)) for light in lights]
    shining = [(light, profile) for light, profile in profiles if max(light.intensity) > 0]
    delta, power = np.zeros((len(shining), DELTA_COLUMNS)), np.zeros(len(shining))
    tables: list[NDArray[np.float32]] = [np.zeros(0, np.float32)]
    for row, (light, profile) in enumerate(shining):
        delta[row, DELTA_FORM] = _form(profile)
        if profile.position is not None:
            delta[row, DELTA_POSITION : DELTA_POSITION + 3] = profile.position
            delta[row, DELTA_INVERSE_RANGE] = profile.inverse_range
        delta[row, DELTA_AXIS : DELTA_AXIS + 3] = profile.axis
        delta[row, DELTA_INTENSITY : DELTA_INTENSITY + 3] = light.intensity
        delta[row, DELTA_MIN_COSINE] = profile.min_cosine
        delta[row, DELTA_CONE_SCALE] = profile.cone_scale or 0.0
        if profile.table is not None:
            delta[row, DELTA_TANGENT : DELTA_TANGENT + 3] = profile.tangent
            delta[row, DELTA_TABLE] = sum(map(len, tables))
            delta[row, DELTA_COSINES : DELTA_COSINES + 2] = profile.table.shape
            tables.append(profile.table.astype(np.float32).ravel())
        power[row] = float(np.array(light.intensity) @ _LUMINANCE) * kind_of(light).power(light, disc)
    return delta, power, np.concatenate(tables)


def _profile(light: PunctualLight) -> EmissionProfile:
    """Return the emission profile of a light; raise InputError if its kind has none."""
    kind = kind_of(light)
    if kind.emission is None or not kind.delta:
        message = f"the path tracer has no kernels for {kind.name} lights; leave it out"
        raise InputError(message, object=f"light '{light.name}'")
    return kind.emission(light)


def _form(profile: EmissionProfile) -> float:
    """Return the form of a profile, a value of DELTA_FORM."""
    if profile.position is None:
        return PARALLEL
    if profile.table is not None:
        return TABULATED
    return EVEN if profile.cone_scale is None else CONE


def light_rows(
    emitter: NDArray[np.float64], delta: NDArray[np.float64], sky: NDArray[np.float64]
) -> NDArray[np.float32]:
    """Return all lights in the layout that `vertex_simd` reads.

    Parameters
    ----------
    emitter : (E, 24) float64
        Emitters, see `LightTable`.
    delta : (P, 20) float64
        Lights without area, see `LightTable`.
    sky : (4,) float64
        The sky, see `LightTable`.

    Returns
    -------
    (E + P + 1, 20) float32
        `LightTable.row`.
    """
    n, p = len(emitter), len(delta)
    row = np.zeros((n + p + 1, ROW_COLUMNS))
    area, point, last = row[:n], row[n : n + p], row[n + p]
    corner = emitter[:, EMITTER_CORNER : EMITTER_CORNER + 9].reshape(n, 3, 3)
    area[:, ROW_ORIGIN : ROW_ORIGIN + 3] = corner[:, 0]
    area[:, ROW_EDGE : ROW_EDGE + 6] = (corner[:, 1:] - corner[:, :1]).reshape(n, 6)
    area[:, ROW_NORMAL : ROW_NORMAL + 3] = emitter[:, EMITTER_NORMAL : EMITTER_NORMAL + 3]
    area[:, ROW_GAIN] = emitter[:, EMITTER_AREA] / np.maximum(emitter[:, EMITTER_CHANCE], 1e-30)
    area[:, ROW_TWO_SIDED] = emitter[:, EMITTER_TWO_SIDED]
    area[:, ROW_RADIANCE : ROW_RADIANCE + 3] = emitter[:, EMITTER_RADIANCE : EMITTER_RADIANCE + 3]
    axis = delta[:, DELTA_AXIS : DELTA_AXIS + 3]
    parallel = delta[:, DELTA_FORM, None] == PARALLEL
    position = delta[:, DELTA_POSITION : DELTA_POSITION + 3]
    point[:, ROW_ORIGIN : ROW_ORIGIN + 3] = np.where(parallel, -axis, position)
    point[:, ROW_NORMAL : ROW_NORMAL + 3] = axis
    point[:, ROW_GAIN] = 1.0 / np.maximum(delta[:, DELTA_CHANCE], 1e-30)
    point[:, ROW_MIN_COSINE] = delta[:, DELTA_MIN_COSINE]
    point[:, ROW_CONE_SCALE] = delta[:, DELTA_CONE_SCALE]
    point[:, ROW_INVERSE_RANGE] = delta[:, DELTA_INVERSE_RANGE]
    point[:, ROW_RADIANCE : ROW_RADIANCE + 3] = delta[:, DELTA_INTENSITY : DELTA_INTENSITY + 3]
    point[:, ROW_KIND] = [_ROW_KIND[form] for form in delta[:, DELTA_FORM]]
    last[ROW_GAIN] = 1.0 / max(sky[SKY_CHANCE], 1e-30)
    last[ROW_RADIANCE : ROW_RADIANCE + 3] = sky[:3]
    last[ROW_KIND] = KIND_SKY
    return row.astype(np.float32)


def _chances(power: NDArray[np.float64], groups: list[slice]) -> NDArray[np.float64]:
    """Return the probability (n,) of each of n lights with power (n,); all 0 if no light has power.

    Half of the total is distributed in proportion to power. The other half is divided equally among the
    groups that have power. Inside a group, it is divided in proportion to power.
    """
    total = power.sum()
    if not total > 0:
        return np.zeros(len(power))
    lit = [group for group in groups if power[group].sum() > 0]
    chance: NDArray[np.float64] = 0.5 * power / total
    for group in lit:
        chance[group] += 0.5 / len(lit) * power[group] / power[group].sum()
    return chance


@inner
def pick_light(cumulative, u):  # type: ignore[no-untyped-def]
    """Return the number of the light chosen by the random number u in [0, 1).

    cumulative : (n,) float64, see `LightTable`
    """
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
def point_on_emitter(emitter, e, b0, b1, b2):  # type: ignore[no-untyped-def]
    """Return the point of emitter e at barycentrics (b0, b1, b2): three floats, metres.

    emitter : (E, 24) float64, see `pathtracer.emitters`
    """
    return (
        b0 * emitter[e, EMITTER_CORNER]
        + b1 * emitter[e, EMITTER_CORNER + 3]
        + b2 * emitter[e, EMITTER_CORNER + 6],
        b0 * emitter[e, EMITTER_CORNER + 1]
        + b1 * emitter[e, EMITTER_CORNER + 4]
        + b2 * emitter[e, EMITTER_CORNER + 7],
        b0 * emitter[e, EMITTER_CORNER + 2]
        + b1 * emitter[e, EMITTER_CORNER + 5]
        + b2 * emitter[e, EMITTER_CORNER + 8],
    )


@inner
def aim_at_emitter(emitter, e, u, w, x, y, z):  # type: ignore[no-untyped-def]
    """Sample a point uniformly on emitter e; return the vector d to it, its density and its barycentrics.

    Returns dx, dy, dz, density, b1, b2. The vector d is in metres, from (x, y, z) to the point. The density
    is per steradian and includes the emitter's probability. It is 0 if the side that faces (x, y, z) does not
    emit.

    emitter : (E, 24) float64, see `pathtracer.emitters`; u, w : random numbers in [0, 1)
    """
    b1, b2 = triangle_barycentric(np.float32(u), np.float32(w))
    px, py, pz = point_on_emitter(emitter, e, 1.0 - b1 - b2, b1, b2)
    dx, dy, dz = px - x, py - y, pz - z
    density = emitter_density(emitter, e, dx, dy, dz)
    return dx, dy, dz, density, b1, b2


@inner
def on_whole_triangle(emitter, e, b1, b2):  # type: ignore[no-untyped-def]
    """Convert barycentrics (b1, b2) of emitter e to barycentrics of the scene's triangle that contains it.

    emitter : (E, 24) float64, see `pathtracer.emitters`
    """
    size = emitter[e, EMITTER_PART + 2]
    return emitter[e, EMITTER_PART] + size * b1, emitter[e, EMITTER_PART + 1] + size * b2


@inner
def emitter_density(emitter, e, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Return the density per steradian with which light sampling chooses a point of emitter e.

    The vector (dx, dy, dz) leads from the shaded point to that point. The density includes the emitter's
    probability. It is 0 if the side that faces the shaded point does not emit.

    emitter : (E, 24) float64, see `pathtracer.emitters`; dx, dy, dz : metres, vector to the point
    """
    square = dx * dx + dy * dy + dz * dz
    if square <= 0.0:
        return 0.0
    cosine = -(
        dx * emitter[e, EMITTER_NORMAL]
        + dy * emitter[e, EMITTER_NORMAL + 1]
        + dz * emitter[e, EMITTER_NORMAL + 2]
    )
    cosine /= math.sqrt(square)
    if emitter[e, EMITTER_TWO_SIDED] > 0.0:
        cosine = abs(cosine)
    if cosine <= 1.0e-9:
        return 0.0
    return emitter[e, EMITTER_CHANCE] / emitter[e, EMITTER_AREA] * square / cosine


@inner
def aim_at_delta(lights, e, x, y, z):  # type: ignore[no-untyped-def]
    """Return the unit direction to a light without area, the length of a ray to it, and the irradiance.

    Returns dx, dy, dz, length, irradiance. The ray starts at (x, y, z), and its length, metres, is slightly
    less than the distance to the light. The irradiance is that of a surface at (x, y, z) that faces the
    light, divided by the light's intensity.

    lights : `LightTable`; e : row of `LightTable.delta`
    """
    delta = lights.delta
    if delta[e, DELTA_FORM] == PARALLEL:
        return -delta[e, DELTA_AXIS], -delta[e, DELTA_AXIS + 1], -delta[e, DELTA_AXIS + 2], FAR, 1.0
    dx = delta[e, DELTA_POSITION] - x
    dy = delta[e, DELTA_POSITION + 1] - y
    dz = delta[e, DELTA_POSITION + 2] - z
    square = max(dx * dx + dy * dy + dz * dz, 1.0e-20)
    length = math.sqrt(square)
    dx, dy, dz = dx / length, dy / length, dz / length
    cosine = -(dx * delta[e, DELTA_AXIS] + dy * delta[e, DELTA_AXIS + 1] + dz * delta[e, DELTA_AXIS + 2])
    share = falloff(lights, e, cosine, -dx, -dy, -dz)
    share *= range_window(square, delta[e, DELTA_INVERSE_RANGE])
    return dx, dy, dz, length * SHORT, share / square


@inner
def range_window(square, inverse_range):  # type: ignore[no-untyped-def]
    """Return clamp(1 - (r / range)^4, 0, 1).

    square : r^2, m2; inverse_range : 1 / range^2, 1/m2; 0 without a range
    """
    share = square * inverse_range
    return max(1.0 - share * share, 0.0)


@inner
def falloff(lights, e, cosine, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Return the fall-off f of light e in a direction, see `EmissionProfile`. The light must have a position.

    lights : `LightTable`; dx, dy, dz : unit direction from the light
    cosine : cosine of the angle between that direction and the light's axis
    """
    delta = lights.delta
    if delta[e, DELTA_FORM] == EVEN:
        return 1.0
    if delta[e, DELTA_FORM] == TABULATED:
        return tabulated(lights.falloff, delta, e, cosine, dx, dy, dz)
    share = (cosine - delta[e, DELTA_MIN_COSINE]) * delta[e, DELTA_CONE_SCALE]
    share = min(max(share, 0.0), 1.0)
    return share * share


@inner
def tabulated(table, delta, e, cosine, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Return the fall-off of the tabulated light e, interpolated bilinearly; 0 outside its cone.

    table : (N,) float32, `LightTable.falloff`; delta : (P, 20) float64, see `LightTable`
    cosine : cosine of d to the light's axis; dx, dy, dz : unit direction d from the light
    """
    low = delta[e, DELTA_MIN_COSINE]
    rows, columns = np.int64(delta[e, DELTA_COSINES]), np.int64(delta[e, DELTA_AZIMUTHS])
    if cosine < low:
        return 0.0
    # Compute the row of the table from the cosine.
    r = min(max((cosine - low) / max(1.0 - low, 1.0e-12), 0.0), 1.0) * (rows - 1)
    i = min(np.int64(r), rows - 2)
    r -= i
    # Compute the column of the table from the azimuth. It increases from the tangent towards
    # cross(axis, tangent).
    start = np.int64(delta[e, DELTA_TABLE]) + i * columns
    j = next_j = np.int64(0)
    q = 0.0
    if columns > 1:
        ax, ay, az = delta[e, DELTA_AXIS], delta[e, DELTA_AXIS + 1], delta[e, DELTA_AXIS + 2]
        tx, ty, tz = delta[e, DELTA_TANGENT], delta[e, DELTA_TANGENT + 1], delta[e, DELTA_TANGENT + 2]
        along = dx * tx + dy * ty + dz * tz
        across = dx * (ay * tz - az * ty) + dy * (az * tx - ax * tz) + dz * (ax * ty - ay * tx)
        q = math.atan2(across, along) / (2.0 * math.pi)
        q = (q - math.floor(q)) * columns
        j = np.int64(q)
        q -= j
        j %= columns
        next_j = (j + 1) % columns
    lower = (1.0 - q) * table[start + j] + q * table[start + next_j]
    upper = (1.0 - q) * table[start + columns + j] + q * table[start + columns + next_j]
    return (1.0 - r) * lower + r * upper
