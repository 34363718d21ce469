"""Chooses random points on emissive triangles (emitters), to which shadow rays are cast.

Neighbouring triangles are grouped into clusters. A point is chosen in three steps:

1. a cluster, in proportion to an estimate of its contribution to a tile of texels (`cluster_chances`);
2. a triangle of the cluster, in proportion to its power;
3. a point, uniform in the triangle's area.

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

# Columns of `Emitters.row`:
#
#     CORNER, CORNER_1, CORNER_2   positions of the corners, metres (3 each)
#     NORMAL                       unit face normal (3)
#     AREA                         m2
#     TWO_SIDED                    1 if the back emits, too, else 0
#     SHARE                        probability of the emitter if its cluster is chosen
#     CUMULATIVE                   sum of SHARE of the cluster's emitters up to and including this emitter
#     CLUSTER                      index of the cluster
#     RADIANCE                     RGB, cd/m2, without the texture (3)
#     TEXTURED                     1 if the radiance is RADIANCE times the texture, 0 if it is RADIANCE, or
#                                  NO_CLOSED_FORM
#     INSIDE                       position in the triangle of the scene: barycentrics b1, b2 of corner 0, and
#                                  size (3). The size is the edge length divided by the triangle's edge
#                                  length, negative for parts rotated by 180 degrees. (0, 0, 1) for a whole
#                                  triangle
CORNER, CORNER_1, CORNER_2, NORMAL, AREA, TWO_SIDED = 0, 3, 6, 9, 12, 13
SHARE, CUMULATIVE, CLUSTER, RADIANCE, TEXTURED, INSIDE = 14, 15, 16, 17, 20, 21
ROW_LENGTH = 24
# Value of TEXTURED: the radiance is RADIANCE, but the closed form of its irradiance is not used.
NO_CLOSED_FORM = -1.0
_three = scratch((3,), np.float64)


class Emitters(NamedTuple):
    """M emitters in C clusters. An emitter is an emissive triangle, or a part of a textured triangle.

    Attributes
    ----------
    row : (M, 24) float32
        Data of each emitter, sorted by cluster; columns CORNER to INSIDE.
    triangle : (M,) int32
        Triangle of the scene that contains each emitter.
    first : (C + 1,) int32
        Cluster c contains the emitters first[c] to first[c + 1] - 1.
    centre : (C, 3) float32
        Centre of a sphere around each cluster, metres.
    radius : (C,) float32
        Radius of that sphere, metres.
    power : (C,) float32
        Sum of the powers of each cluster's emitters, see `lights.emissive`.
    axis : (C, 3) float32
        Unit axis of a cone that contains the cluster's normals.
    spread : (C,) float32
        Half angle of that cone, radians; pi for clusters with two-sided triangles.
    node : (K, 4) int32
        Subdivisions of textured triangles, see `emitter_at`.
    root : (T,) int32
        Code of each triangle of the scene, from which `emitter_at` finds the emitter at a point of the
        triangle.
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
    """The emitters, and the probability of each cluster for one tile of texels.

    Attributes
    ----------
    row, triangle, first, node : ndarray
        See `Emitters`.
    chance : (C,) float32
        Probability of each cluster.
    cumulative : (C,) float32
        Cumulative sum of `chance`.
    apart : (C,) uint8
        1 for clusters that are sampled as a separate stratum (`radiosity.emitter_choice`). Gather rays that
        hit these clusters contribute also to texels whose light from the other clusters is computed in closed
        form.
    """

    row: NDArray[np.float32]
    triangle: NDArray[np.int32]
    first: NDArray[np.int32]
    chance: NDArray[np.float32]
    cumulative: NDArray[np.float32]
    node: NDArray[np.int32]
    apart: NDArray[np.uint8]


def tile_emitters(emitters: Emitters, origin: NDArray[np.float32]) -> TileEmitters:
    """Return the emitters, with the probability of each cluster for a tile.

    Parameters
    ----------
    emitters : Emitters
        All emitters of the scene.
    origin : (m, w, 3) float32, metres, world
        Points of the tile's texels.

    Returns
    -------
    TileEmitters
        All clusters are in one stratum (`apart` is 0).
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
    """Return the materials if any emitter is textured or any triangle lets light through, else None.

    With None, Numba compiles kernels without texture lookups.

    Parameters
    ----------
    emitters : Emitters
        All emitters of the scene.
    shading : Shading
        Materials of the scene.

    Returns
    -------
    Shading or None
        `shading` or None.
    """
    varied = len(shading.alpha.slot) > 0 or (emitters.row[:, TEXTURED] > 0).any()
    return shading if varied else None


@inner
def bounding_sphere(origin):  # type: ignore[no-untyped-def]
    """Return x, y, z of the centre and half the diagonal of the bounding box of points.

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
    """Return the largest radius / distance of all clusters, as seen from points.

    The distance is from the cluster's centre to the bounding sphere of the points. If that bounding sphere
    touches the sphere of a cluster, inf is returned.

    emitters : Emitters; origin : (m, w, 3) float32, metres, points
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
    """Write the probability of each cluster for points, which are represented by their bounding sphere.

        weight = power / max(distance^2, (sum of both radii)^2) * max(cos(angle), 0.05)

    `distance` is between the centres of the cluster and of the bounding sphere. `angle` is a lower bound, at
    least 0, of the angle between a normal of the cluster and a direction from the cluster to the bounding
    sphere. If it is 90 degrees or more, the weight is 0, because all points are behind the emitting sides. If
    the two spheres touch or `Emitters.spread` is at least 3 radians, the factor max(...) of the cosine is 1.
    The probability of a cluster of positive weight is 0.95 weight / (sum of weights) + 0.05 / (number of
    clusters of positive weight).

    emitters : Emitters; origin : (m, w, 3) float32, metres, points
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
                # Limit the cosine from below, because the bound of the angle is not tight.
                weight *= larger(math.cos(angle), 0.05)
        chance[c] = weight
        total += weight
    # Normalise the weights, mix them with equal probabilities, and compute the cumulative sum.
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
    """Choose an emitter with the uniform number u.

    row (M, 24), first (C + 1,) : see `Emitters`; chance, cumulative : (C,) float32, see `TileEmitters`
    Returns the emitter, the probability density per m2 of each point on it, and a new uniform number,
    computed from u, in the interval [0, 1).
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
    """Choose an emitter, and write a random point on it.

    row (M, 24), first (C + 1,) : see `Emitters`; chance, cumulative : (C,) float32, see `TileEmitters`
    u, v : uniform numbers in [0, 1); point : (3,) output, metres
    Returns the emitter, the density per m2, and the barycentrics b1 and b2 of the point on the emitter.
    """
    m, density, u = choose_emitter(row, first, chance, cumulative, u)
    b1, b2 = triangle_barycentric(u, v)
    b0 = np.float32(1.0) - b1 - b2
    for a in range(3):
        point[a] = b0 * row[m, CORNER + a] + b1 * row[m, CORNER_1 + a] + b2 * row[m, CORNER_2 + a]
    return m, density, b1, b2


@inner
def emitter_at(node, code, b1, b2):  # type: ignore[no-untyped-def]
    """Return the emitter at barycentrics (b1, b2) of a triangle, -1 if nothing is emitted there.

    node : (K, 4) int32, see `Emitters`
    code : code of the triangle, see below

    Textured triangles are subdivided into emitters. A code m >= 0 means emitter m. A code -1 means that
    nothing is emitted. A code -2 - k means a subdivision into four parts, whose codes are node[k]. The first
    three parts are at corners 0, 1 and 2. The fourth is in the middle, rotated by 180 degrees.
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
    """Convert barycentrics (b1, b2) on emitter m to barycentrics on the triangle of the scene.

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
    """Write the radiance that triangle t emits at barycentrics (b1, b2), texture included.

    shading : Shading; out : (4,) float64 output; out[:3] is RGB in cd/m2, out[3] is working memory
    """
    m = shading.material[t]
    out[0] = out[1] = out[2] = 1.0
    if shading.emission_texture[m] >= 0:
        u, v = uv_at(shading.emission_uv, shading.triangle, t, b1, b2)
        sample_texture(shading.pack, shading.emission_texture[m], u, v, 0.0, out)
    for c in range(3):
        out[c] *= shading.emission[m, c]
