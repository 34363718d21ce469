"""Sampling of emissive triangles.

Triangles are grouped into clusters of neighbours. A cluster is chosen in proportion to an estimate of its
contribution to a tile of texels (power, distance, facing), then a triangle of it in proportion to its power,
then a point uniform in its area.

Based on: Shirley, Wang and Zimmerman, Monte Carlo techniques for direct lighting calculations, 1996;
Conty Estevez and Kulla, Importance sampling of many lights with adaptive tree splitting, 2018.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from baker.kernels.sampling import triangle_barycentric
from baker.kernels.shading import Shading
from baker.kernels.texel_info import uv_at
from baker.kernels.textures import sample_texture
from baker.trace.jit import inner, kernel, larger, scratch, smaller

# Columns of an emitter's row:
#
#     CORNER, CORNER_1, CORNER_2   positions of the corners, metres (3 each)
#     NORMAL                       unit face normal (3)
#     AREA                         m2
#     TWO_SIDED                    1 if the back emits, too, else 0
#     SHARE                        probability of the emitter inside its cluster
#     CUMULATIVE                   running sum of these probabilities, this one included
#     CLUSTER                      index of the cluster
#     RADIANCE                     RGB, cd/m2, without the texture (3)
#     TEXTURED                     1 if the texture has to be looked up, 0 if not, or NO_CLOSED_FORM
#     INSIDE                       position in the scene's triangle: barycentrics b1, b2 of corner 0; edge
#                                  length as a share of the triangle's, negative for parts rotated by 180
#                                  degrees; (0, 0, 1) for a whole triangle
CORNER, CORNER_1, CORNER_2, NORMAL, AREA, TWO_SIDED = 0, 3, 6, 9, 12, 13
SHARE, CUMULATIVE, CLUSTER, RADIANCE, TEXTURED, INSIDE = 14, 15, 16, 17, 20, 21
ROW_LENGTH = 24
# Value of TEXTURED: the radiance is the row's, but the emitter is always sampled.
NO_CLOSED_FORM = -1.0
_three = scratch((3,), np.float64)


class Emitters(NamedTuple):
    """M emissive triangles, or parts of textured ones, in C clusters.

    Attributes
    ----------
    row : (M, 24) float32
        Cluster after cluster, see the column names.
    triangle : (M,) int32
        Triangle of the scene that the emitter is, or is a part of.
    first : (C + 1,) int32
        Emitters of cluster c are first[c] to first[c + 1].
    centre : (C, 3) float32
        Of a sphere around the cluster, metres.
    radius : (C,) float32
        Of that sphere, metres.
    power : (C,) float32
        Sum of the emitters' powers.
    axis : (C, 3) float32
        Unit axis of a cone that holds the cluster's normals.
    spread : (C,) float32
        Half angle of that cone, radians; pi for clusters with two-sided triangles.
    node : (K, 4) int32
        Subdivisions of textured triangles, see `emitter_at`.
    root : (T,) int32
        Code of each triangle of the scene, see `emitter_at`.
    """

    row: NDArray[np.float32]
    triangle: NDArray[np.int32]
    first: NDArray[np.int32]
    centre: NDArray[np.float32]
    radius: NDArray[np.float32]
    power: NDArray[np.float32]
    axis: NDArray[np.float32]
    spread: NDArray[np.float32]
    node: NDArray[np.int32]
    root: NDArray[np.int32]


class TileEmitters(NamedTuple):
    """Emitters with the probabilities of their clusters for one tile of texels.

    Attributes
    ----------
    row, triangle, first, node : ndarray
        See `Emitters`.
    chance : (C,) float32
        Probability of each cluster.
    cumulative : (C,) float32
        Running sum of `chance`.
    apart : (C,) uint8
        1 for clusters that are sampled as a separate stratum: gather rays that hit them contribute also at
        texels that have the complete light of all other emitters.
    """

    row: NDArray[np.float32]
    triangle: NDArray[np.int32]
    first: NDArray[np.int32]
    chance: NDArray[np.float32]
    cumulative: NDArray[np.float32]
    node: NDArray[np.int32]
    apart: NDArray[np.uint8]


def tile_emitters(emitters: Emitters, origin: NDArray[np.float32]) -> TileEmitters:
    """Return the emitters with the probabilities of their clusters for a tile.

    Parameters
    ----------
    emitters : Emitters
        All emitters of the scene.
    origin : (m, w, 3) float32, metres, world
        Points of the tile's texels.

    Returns
    -------
    TileEmitters
        With all clusters in one stratum (`apart` is 0).
    """
    chance = np.zeros(len(emitters.power), np.float32)
    cumulative = np.zeros_like(chance)
    if len(chance) and len(origin):
        cluster_chances(emitters, origin, chance, cumulative)
    apart = np.zeros(len(chance), np.uint8)
    return TileEmitters(
        emitters.row, emitters.triangle, emitters.first, chance, cumulative, emitters.node, apart
    )


def needed_shading(emitters: Emitters, shading: Shading) -> Shading | None:
    """Return the materials if emitters need them: any is textured, or any triangle lets light through.

    Numba compiles kernels for None without texture lookups.

    Parameters
    ----------
    emitters : Emitters
        All emitters of the scene.
    shading : Shading
        Materials of the scene.

    Returns
    -------
    Shading or None
        `shading`, None if no emitter needs it.
    """
    varied = len(shading.alpha.slot) > 0 or (emitters.row[:, TEXTURED] > 0).any()
    return shading if varied else None


@inner
def bounding_sphere(origin):  # type: ignore[no-untyped-def]
    """Return centre x, y, z and radius of a sphere around points: their box's centre and half diagonal.

    origin : (m, w, 3) float32, metres
    """
    low, high = _three(), _three()
    for a in range(3):
        low[a], high[a] = 1.0e30, -1.0e30
    for i in range(origin.shape[0]):
        for k in range(origin.shape[1]):
            for a in range(3):
                low[a] = smaller(low[a], origin[i, k, a])
                high[a] = larger(high[a], origin[i, k, a])
    half = 0.5 * math.sqrt((high[0] - low[0]) ** 2 + (high[1] - low[1]) ** 2 + (high[2] - low[2]) ** 2)
    return 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1]), 0.5 * (low[2] + high[2]), half


@kernel
def widest_view(emitters, origin):  # type: ignore[no-untyped-def]
    """Return the largest radius / distance of a cluster as seen from points; inf if their spheres touch.

    emitters : Emitters; origin : (m, w, 3) float32, metres
    """
    x, y, z, radius = bounding_sphere(origin)
    widest = 0.0
    for c in range(len(emitters.power)):
        dx = x - emitters.centre[c, 0]
        dy = y - emitters.centre[c, 1]
        dz = z - emitters.centre[c, 2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz) - radius
        if distance <= emitters.radius[c]:
            return np.inf
        widest = larger(widest, emitters.radius[c] / distance)
    return widest


@kernel
def cluster_chances(emitters, origin, chance, cumulative):  # type: ignore[no-untyped-def]
    """Write the probabilities of clusters for points, which are replaced by their bounding sphere.

        weight = power / max(distance^2, (sum of both radii)^2) * max(cos(angle), 0.05)

    `angle` is the smallest angle between a normal of the cluster and a direction to the sphere. A cluster's
    probability is 0 only if no point of the sphere can see the front of its triangles. 5 % of the probability
    are divided equally among the others.

    emitters : Emitters; origin : (m, w, 3) float32, metres
    chance, cumulative : (C,) float32 output, see `TileEmitters`
    """
    x, y, z, radius = bounding_sphere(origin)
    # Estimate the contribution of each cluster.
    total = 0.0
    n = len(chance)
    for c in range(n):
        dx = x - emitters.centre[c, 0]
        dy = y - emitters.centre[c, 1]
        dz = z - emitters.centre[c, 2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        touching = radius + emitters.radius[c]
        weight = emitters.power[c] / larger(distance * distance, touching * touching + 1.0e-12)
        if distance > touching and emitters.spread[c] < 3.0:
            facing = (
                dx * emitters.axis[c, 0] + dy * emitters.axis[c, 1] + dz * emitters.axis[c, 2]
            ) / distance
            angle = (
                math.acos(smaller(larger(facing, -1.0), 1.0))
                - emitters.spread[c]
                - math.asin(touching / distance)
            )
            if angle >= 0.5 * math.pi:
                weight = 0.0
            elif angle > 0.0:
                # Limit the factor, since the bound of the angle is rough.
                weight *= larger(math.cos(angle), 0.05)
        chance[c] = weight
        total += weight
    # Normalise, mix with equal shares, and sum up.
    lit = 0
    for c in range(n):
        lit += chance[c] > 0.0
    running = 0.0
    for c in range(n):
        if total > 0.0 and chance[c] > 0.0:
            chance[c] = 0.95 * chance[c] / total + 0.05 / lit
        running += chance[c]
        cumulative[c] = running


@inner
def choose_emitter(row, first, chance, cumulative, u):  # type: ignore[no-untyped-def]
    """Choose an emitter by a uniform number u.

    row (M, 24), first (C + 1,) : see `Emitters`; chance, cumulative : (C,) float32, see `TileEmitters`
    Returns its number, the probability density of a point on it per m2, and u rescaled to [0, 1) for reuse.
    """
    # Choose a cluster.
    n = len(cumulative)
    total = cumulative[n - 1]
    u *= total
    low = 0
    high = n - 1
    while low < high:
        middle = (low + high) // 2
        if cumulative[middle] > u:
            high = middle
        else:
            low = middle + 1
    picked = chance[low]
    u = smaller(larger((u - (cumulative[low] - picked)) / picked, np.float32(0.0)), np.float32(0.9999999))
    # Choose an emitter of the cluster.
    m = first[low]
    high = first[low + 1] - 1
    while m < high:
        middle = (m + high) // 2
        if row[middle, CUMULATIVE] > u:
            high = middle
        else:
            m = middle + 1
    share = row[m, SHARE]
    u = smaller(larger((u - (row[m, CUMULATIVE] - share)) / share, np.float32(0.0)), np.float32(0.9999999))
    return m, picked / total * share / row[m, AREA], u


@inner
def sample_emitter(row, first, chance, cumulative, u, v, point):  # type: ignore[no-untyped-def]
    """Choose an emitter and write a point on it.

    row (M, 24), first (C + 1,) : see `Emitters`; chance, cumulative : (C,) float32, see `TileEmitters`
    u, v : uniform numbers; point : (3,) output, metres
    Returns emitter number, density per m2, and the barycentrics b1 and b2 on the emitter.
    """
    m, density, u = choose_emitter(row, first, chance, cumulative, u)
    b1, b2 = triangle_barycentric(u, v)
    b0 = np.float32(1.0) - b1 - b2
    for a in range(3):
        point[a] = b0 * row[m, CORNER + a] + b1 * row[m, CORNER_1 + a] + b2 * row[m, CORNER_2 + a]
    return m, density, b1, b2


@inner
def emitter_at(node, code, b1, b2):  # type: ignore[no-untyped-def]
    """Return the emitter at barycentrics (b1, b2) of a triangle that may be subdivided, -1 where it is black.

    node : (K, 4) int32, see `Emitters`
    code : of the triangle: m >= 0, it is emitter m; -1, it emits nothing; -2 - k, it is cut into four parts
        whose codes are node[k]: at corners 0, 1, 2, then the rotated one in the middle
    """
    while code < -1:
        k = -2 - code
        b1, b2 = b1 + b1, b2 + b2
        if b1 >= 1.0:
            part, b1 = 1, b1 - np.float32(1.0)
        elif b2 >= 1.0:
            part, b2 = 2, b2 - np.float32(1.0)
        elif b1 + b2 <= 1.0:
            part = 0
        else:
            part, b1, b2 = 3, np.float32(1.0) - b1, np.float32(1.0) - b2
        code = np.int64(node[k, part])
    return code


@inner
def on_triangle(row, m, b1, b2):  # type: ignore[no-untyped-def]
    """Return barycentrics on the scene's triangle from barycentrics (b1, b2) on emitter m, a part of it.

    row : (M, 24) float32, see `Emitters`
    """
    return row[m, INSIDE] + row[m, INSIDE + 2] * b1, row[m, INSIDE + 1] + row[m, INSIDE + 2] * b2


@inner
def emitter_density(row, chance, cumulative, m):  # type: ignore[no-untyped-def]
    """Return the probability density per m2 with which `sample_emitter` chooses a point of emitter m.

    row : (M, 24) float32, see `Emitters`; chance, cumulative : (C,) float32, see `TileEmitters`
    """
    total = cumulative[len(cumulative) - 1]
    if total <= np.float32(0.0):
        return np.float32(0.0)
    return chance[np.int64(row[m, CLUSTER])] / total * row[m, SHARE] / row[m, AREA]


@inner
def emitted_radiance(shading, t, b1, b2, out):  # type: ignore[no-untyped-def]
    """Write the radiance that triangle t emits at barycentrics (b1, b2).

    shading : Shading; out : (4,) float64 output, RGB, cd/m2, and one item of working memory
    """
    m = shading.material[t]
    out[0] = out[1] = out[2] = 1.0
    if shading.emission_texture[m] >= 0:
        u, v = uv_at(shading.emission_uv, shading.triangle, t, b1, b2)
        sample_texture(shading.pack, shading.emission_texture[m], u, v, 0.0, out)
    for c in range(3):
        out[c] *= shading.emission[m, c]
