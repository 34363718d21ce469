"""Emissive triangles: which one to sample from where, and with what density.

Triangles are grouped into clusters of neighbours. For a tile of texels each cluster gets a chance
that bounds its contribution (power, distance, facing); inside a cluster the chance follows power.

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

# Columns of an emitter's row: three corners, face normal, area, 1 if two-sided, chance inside its cluster,
# running sum of these chances, cluster, radiance without texture, 1 if the texture has to be looked up, and
# which part of a triangle it is: barycentrics b1, b2 of corner 0 and size (negative: turned; 1: all of it).
CORNER, NORMAL, AREA, TWO_SIDED, SHARE, CUMULATIVE, CLUSTER, RADIANCE, TEXTURED, INSIDE = (
    0,
    9,
    12,
    13,
    14,
    15,
    16,
    17,
    20,
    21,
)
ROW_LENGTH = 24
# Instead of 0 in TEXTURED: the radiance is the row's, but the emitter is always sampled.
NO_CLOSED_FORM = -1.0
_three = scratch((3,), np.float64)


class Emitters(NamedTuple):
    """M emissive triangles, or parts of textured ones, in C clusters.

    row (M, 24) float32, see the column names; triangle (M,) int32, numbers in the scene, cluster
    after cluster; first (C + 1,) int32; centre (C, 3), radius (C,), power (C,), axis (C, 3) float32;
    spread (C,) float32, radians, pi for clusters with two-sided triangles; node (K, 4) int32, see
    `emitter_at`; root (T,) int32, what each triangle of the scene is, in the same code.
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
    """Emitters as a tile of texels samples them: `Emitters` with the chances of its clusters.

    row, triangle, first, node: see `Emitters`; chance, cumulative (C,) float32; apart (C,) uint8, 1 for
    clusters that have samples of their own: rays that find them count also where all other light is complete.
    """

    row: NDArray[np.float32]
    triangle: NDArray[np.int32]
    first: NDArray[np.int32]
    chance: NDArray[np.float32]
    cumulative: NDArray[np.float32]
    node: NDArray[np.int32]
    apart: NDArray[np.uint8]


def tile_emitters(emitters: Emitters, origin: NDArray[np.float32]) -> TileEmitters:
    """Return the emitters with the chances that points (m, w, 3) float32, metres, give their clusters."""
    chance = np.zeros(len(emitters.power), np.float32)
    cumulative = np.zeros_like(chance)
    if len(chance) and len(origin):
        cluster_chances(emitters, origin, chance, cumulative)
    apart = np.zeros(len(chance), np.uint8)
    return TileEmitters(
        emitters.row, emitters.triangle, emitters.first, chance, cumulative, emitters.node, apart
    )


def needed_shading(emitters: Emitters, shading: Shading) -> Shading | None:
    """Return what kernels have to know of materials: None if no emitter is textured and nothing has holes.

    Numba compiles them for None without what looks up textures.
    """
    varied = len(shading.alpha.slot) > 0 or (emitters.row[:, TEXTURED] > 0).any()
    return shading if varied else None


@inner
def bounding_sphere(origin):  # type: ignore[no-untyped-def]
    """Return x, y, z, radius of a sphere around points (m, w, 3): their box's centre and half diagonal."""
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
    """Return the largest radius / distance of a cluster seen from points (m, w, 3); inf where one is met."""
    x, y, z, radius = bounding_sphere(origin)
    widest = 0.0
    for c in range(len(emitters.power)):
        dx = x - emitters.centre[c, 0]
        dy = y - emitters.centre[c, 1]
        dz = z - emitters.centre[c, 2]
        clear = math.sqrt(dx * dx + dy * dy + dz * dz) - radius
        if clear <= emitters.radius[c]:
            return np.inf
        widest = larger(widest, emitters.radius[c] / clear)
    return widest


@kernel
def cluster_chances(emitters, origin, chance, cumulative):  # type: ignore[no-untyped-def]
    """Fill `chance` and `cumulative` (C,) float32 for points (m, w, 3), taken as their bounding sphere.

    A cluster's chance is zero only if no point of the sphere can see the front of its triangles.
    """
    x, y, z, radius = bounding_sphere(origin)
    total = 0.0
    n = len(chance)
    for c in range(n):
        dx = x - emitters.centre[c, 0]
        dy = y - emitters.centre[c, 1]
        dz = z - emitters.centre[c, 2]
        distance = math.sqrt(dx * dx + dy * dy + dz * dz)
        reach = radius + emitters.radius[c]
        weight = emitters.power[c] / larger(distance * distance, reach * reach + 1.0e-12)
        if distance > reach and emitters.spread[c] < 3.0:
            facing = (
                dx * emitters.axis[c, 0] + dy * emitters.axis[c, 1] + dz * emitters.axis[c, 2]
            ) / distance
            angle = (
                math.acos(smaller(larger(facing, -1.0), 1.0))
                - emitters.spread[c]
                - math.asin(reach / distance)
            )
            if angle >= 0.5 * math.pi:
                weight = 0.0
            elif angle > 0.0:
                # Never let a chance fall far below the others': the bound is rough.
                weight *= larger(math.cos(angle), 0.05)
        chance[c] = weight
        total += weight
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
    """Return an emitter's number, its density per m2, and what is left of the uniform number u.

    `row` and `first` are those of `Emitters`; `chance` and `cumulative` those of `cluster_chances`.
    """
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
    """Choose a triangle and a point (3,) on it; return emitter number, density per m2, b1, b2."""
    m, density, u = choose_emitter(row, first, chance, cumulative, u)
    b1, b2 = triangle_barycentric(u, v)
    b0 = np.float32(1.0) - b1 - b2
    for a in range(3):
        point[a] = b0 * row[m, a] + b1 * row[m, 3 + a] + b2 * row[m, 6 + a]
    return m, density, b1, b2


@inner
def emitter_at(node, code, b1, b2):  # type: ignore[no-untyped-def]
    """Return the emitter at barycentrics of a triangle that is cut into parts, -1 where it is black.

    code : what the triangle is: a row of `Emitters`, -1 for none, -2 - k for the four parts in node[k]: those
        at the three corners, then the turned one in the middle, whose parts are of the same kinds
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
    """Return barycentrics of the scene's triangle from those of emitter m, which may be a part of it."""
    return row[m, INSIDE] + row[m, INSIDE + 2] * b1, row[m, INSIDE + 1] + row[m, INSIDE + 2] * b2


@inner
def emitter_density(row, chance, cumulative, m):  # type: ignore[no-untyped-def]
    """Return the density per m2 with which `sample_emitter` picks a point of emitter m."""
    total = cumulative[len(cumulative) - 1]
    if total <= np.float32(0.0):
        return np.float32(0.0)
    return chance[np.int64(row[m, CLUSTER])] / total * row[m, SHARE] / row[m, AREA]


@inner
def emitted_radiance(shading, t, b1, b2, out):  # type: ignore[no-untyped-def]
    """Write the radiance (cd/m2) that triangle t emits at barycentrics to `out` (4,)."""
    m = shading.material[t]
    out[0] = out[1] = out[2] = 1.0
    if shading.emission_texture[m] >= 0:
        u, v = uv_at(shading.emission_uv, shading.triangle, t, b1, b2)
        sample_texture(shading.pack, shading.emission_texture[m], u, v, 0.0, out)
    for c in range(3):
        out[c] *= shading.emission[m, c]
