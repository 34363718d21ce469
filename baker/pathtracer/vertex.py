# mypy: disable-error-code="no-untyped-def"
"""Sets up a vertex of a path at a hit, samples a light from the vertex, and samples the next direction.

Column `lane` of `path` is the state of one path, in the rows that this module defines. Column `lane` of `row`
contains the BSDF parameters of the surface at the path's vertex (see `pathtracer.bsdf`). Directions in `path`
are in world space, except `TO`, which is in the frame of the shading normal.
"""

from __future__ import annotations

import math

import numpy as np

from baker.kernels.alpha import opacity_at
from baker.kernels.sampling import tangent_frame
from baker.kernels.texel_info import uv_at
from baker.kernels.textures import sample_texture
from baker.pathtracer.bsdf import (
    BASE,
    METALLIC,
    SMOOTH,
    WIDTH,
    bsdf_eval,
    bsdf_sample,
    cosine_sample,
    specular_chance,
)
from baker.pathtracer.emitters import EMITTER_RADIANCE
from baker.pathtracer.light_table import (
    DELTA_CHANCE,
    DELTA_INTENSITY,
    FAR,
    SHORT,
    SKY_CHANCE,
    aim_at_delta,
    aim_at_emitter,
    pick_light,
)
from baker.pathtracer.scene import (
    BASE_COLOUR,
    CORNER,
    FACE,
    MATERIAL,
    MATERIAL_METALLIC,
    MATERIAL_ROUGHNESS,
    MATERIAL_TEXTURED,
    SHADING,
    TWO_SIDED,
)
from baker.trace.jit import inner

# Rows of `path`:
#
#     POSITION    origin of the next ray, metres (3)
#     GO          unit direction of the next ray (3)
#     BETA        throughput (3)
#     COLLECTED   light found so far (3)
#     DENSITY     density, per steradian, with which GO was sampled; 0 if emission at the next hit has MIS
#                 weight 1
#     NORMAL      unit geometric normal, on the side that was hit (3)
#     FRAME       tangent, bitangent and shading normal (9)
#     TO          unit direction to the previous vertex, in FRAME (3)
#     BOUNCES     number of reflections; -1 before the first hit of a camera ray
#     SHADED      interpolated normal, on the side that was hit (3)
POSITION, GO, BETA, COLLECTED, DENSITY, NORMAL, FRAME, TO, BOUNCES, SHADED = (
    0,
    3,
    6,
    9,
    12,
    13,
    16,
    25,
    28,
    29,
)
N_ROWS = 32
# Columns of `ray`, a ray to a light: unit direction (3), length in metres, barycentrics of its end on an
# emitter.
RAY_LENGTH, RAY_B1, RAY_B2 = 3, 4, 5
# Limit of the cosine between the interpolated normal and the view direction. Up to this limit, surfaces that
# are not Lambertian use the geometric normal instead of the interpolated normal.
GRAZE = 1.0e-3
# Factors of the offset of ray origins, as in `kernels.surface`. The offset is OFFSET times the smaller of two
# lengths: the largest coordinate of the origin, and the size of the triangle. It is at least ROUNDING
# (sixteen float32 epsilons) times the larger of the two lengths.
OFFSET, ROUNDING = 1.0e-5, 1.9e-6
# SURE: number of bounces before Russian roulette starts. MOST: upper limit of the survival probability.
SURE, MOST = 3, 0.98


@inner
def set_frame(path, lane, nx, ny, nz):
    """Write the tangent frame of the unit shading normal (nx, ny, nz) to `FRAME` of a path.

    path : (N_ROWS, n) float64
    """
    tx, ty, tz, bx, by, bz = tangent_frame(np.float32(nx), np.float32(ny), np.float32(nz))
    path[FRAME, lane], path[FRAME + 1, lane], path[FRAME + 2, lane] = tx, ty, tz
    path[FRAME + 3, lane], path[FRAME + 4, lane], path[FRAME + 5, lane] = bx, by, bz
    path[FRAME + 6, lane], path[FRAME + 7, lane], path[FRAME + 8, lane] = nx, ny, nz


@inner
def local(path, lane, dx, dy, dz):
    """Return world direction d in the tangent frame of the vertex: three floats.

    path : (N_ROWS, n) float64
    """
    return (
        dx * path[FRAME, lane] + dy * path[FRAME + 1, lane] + dz * path[FRAME + 2, lane],
        dx * path[FRAME + 3, lane] + dy * path[FRAME + 4, lane] + dz * path[FRAME + 5, lane],
        dx * path[FRAME + 6, lane] + dy * path[FRAME + 7, lane] + dz * path[FRAME + 8, lane],
    )


@inner
def offset_origin(path, lane, x, y, z, min_offset_scale, size):
    """Write the surface point (x, y, z), offset along its geometric normal, to `POSITION` of path.

    path : (N_ROWS, n) float64, with `NORMAL`
    min_offset_scale : metres, lower limit of the largest coordinate, see `Surfaces`
    size : metres, size of the triangle, or `Surfaces.default_size` if the triangle is unknown
    """
    far = max(abs(x), abs(y), abs(z))
    off = max(ROUNDING * max(far, size), OFFSET * min(max(far, min_offset_scale), size))
    path[POSITION, lane] = x + off * path[NORMAL, lane]
    path[POSITION + 1, lane] = y + off * path[NORMAL + 1, lane]
    path[POSITION + 2, lane] = z + off * path[NORMAL + 2, lane]


@inner
def size_of(corner, t):
    """Return the size of triangle t, metres: the largest absolute component of its two edges at corner 0.

    corner : (T, 9 or more) float32; row t begins with the positions of its three corners
    """
    size = 0.0
    for a in range(3):
        size = max(size, max(abs(corner[t, 3 + a] - corner[t, a]), abs(corner[t, 6 + a] - corner[t, a])))
    return size


@inner
def start_path(path, row, lane, where, toward, normal, at_surface, sizes):
    """Start a path at a surface point (`at_surface`), or start a camera ray.

    The surface point is treated as white and Lambertian, so its radiance is E / pi.

    path : (N_ROWS, n) float64; row : (5, n) float64
    where, toward, normal : (3,) float64. For a surface point, they are position, shading normal and geometric
        normal. For a camera ray, they are origin and direction, and `normal` is unused
    sizes : `Surfaces.min_offset_scale` and `.default_size`
    """
    for c in range(3):
        path[BETA + c, lane] = 1.0
        path[COLLECTED + c, lane] = 0.0
    path[DENSITY, lane] = 0.0
    path[BOUNCES, lane] = 0.0
    if not at_surface:
        for a in range(3):
            path[POSITION + a, lane] = where[a]
            path[GO + a, lane] = toward[a]
        path[BOUNCES, lane] = -1.0
        return
    for a in range(3):
        path[NORMAL + a, lane] = normal[a]
        row[BASE + a, lane] = 1.0
    row[METALLIC, lane], row[WIDTH, lane] = 0.0, -1.0
    offset_origin(path, lane, where[0], where[1], where[2], sizes[0], sizes[1])
    set_frame(path, lane, toward[0], toward[1], toward[2])
    path[TO, lane], path[TO + 1, lane], path[TO + 2, lane] = 0.0, 0.0, 1.0


@inner
def arrive(path, row, lane, surface, material, prim, u, v, min_offset_scale, lambertian):
    """Set up the vertex at a hit on triangle `prim`; return False at the black back of a one-sided surface.

    path : (N_ROWS, n) float64, whose `GO` is the direction of the ray; row : (5, n) float64
    surface : (T, 32), material : (M, 8) float32, see `Surfaces`
    u, v : barycentrics of the hit; min_offset_scale, lambertian : see `Surfaces`
    """
    b0 = 1.0 - u - v
    dx, dy, dz = path[GO, lane], path[GO + 1, lane], path[GO + 2, lane]
    fx, fy, fz = surface[prim, FACE], surface[prim, FACE + 1], surface[prim, FACE + 2]
    sign = 1.0
    if dx * fx + dy * fy + dz * fz >= 0.0:
        if surface[prim, TWO_SIDED] == 0.0:
            return False
        sign = -1.0
    path[NORMAL, lane], path[NORMAL + 1, lane], path[NORMAL + 2, lane] = sign * fx, sign * fy, sign * fz
    x = b0 * surface[prim, CORNER] + u * surface[prim, CORNER + 3] + v * surface[prim, CORNER + 6]
    y = b0 * surface[prim, CORNER + 1] + u * surface[prim, CORNER + 4] + v * surface[prim, CORNER + 7]
    z = b0 * surface[prim, CORNER + 2] + u * surface[prim, CORNER + 5] + v * surface[prim, CORNER + 8]
    offset_origin(path, lane, x, y, z, min_offset_scale, size_of(surface, prim))
    nx = b0 * surface[prim, SHADING] + u * surface[prim, SHADING + 3] + v * surface[prim, SHADING + 6]
    ny = b0 * surface[prim, SHADING + 1] + u * surface[prim, SHADING + 4] + v * surface[prim, SHADING + 7]
    nz = b0 * surface[prim, SHADING + 2] + u * surface[prim, SHADING + 5] + v * surface[prim, SHADING + 8]
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    if length < 1.0e-6 or nx * fx + ny * fy + nz * fz <= 0.0:
        nx, ny, nz, length = fx, fy, fz, 1.0
    nx, ny, nz = sign * nx / length, sign * ny / length, sign * nz / length
    path[SHADED, lane], path[SHADED + 1, lane], path[SHADED + 2, lane] = nx, ny, nz
    glossy = lambertian == 0
    if glossy and nx * dx + ny * dy + nz * dz >= -GRAZE:
        # Use the geometric normal, because the interpolated normal does not face the viewer.
        nx, ny, nz = path[NORMAL, lane], path[NORMAL + 1, lane], path[NORMAL + 2, lane]
    set_frame(path, lane, nx, ny, nz)
    tx, ty, tz = local(path, lane, -dx, -dy, -dz)
    # On Lambertian surfaces, clamp a view direction below the horizon of the shading normal to the horizon.
    # This changes no radiance, which is the same in all directions.
    path[TO, lane], path[TO + 1, lane], path[TO + 2, lane] = tx, ty, tz if glossy else max(tz, 1.0e-6)
    m = np.int64(surface[prim, MATERIAL])
    for c in range(3):
        row[BASE + c, lane] = material[m, BASE_COLOUR + c]
    row[METALLIC, lane] = material[m, MATERIAL_METALLIC] if glossy else 0.0
    roughness = material[m, MATERIAL_ROUGHNESS]
    row[WIDTH, lane] = roughness * roughness if glossy else -1.0
    return True


@inner
def paint(row, lane, shading, prim, u, v, material, rgba):
    """Multiply the BSDF parameters by textures and vertex colours at barycentrics (u, v) of triangle `prim`.

    row : (5, n) float64; material : (M, 8) float32, see `Surfaces`; rgba : (4,) float64, working memory
    """
    m = shading.material[prim]
    base_colour(shading, prim, m, u, v, rgba)
    for c in range(3):
        row[BASE + c, lane] *= rgba[c]
    if row[WIDTH, lane] >= 0.0 and material[m, MATERIAL_TEXTURED] > 0.0:
        s, t = uv_at(shading.reflection_uv, shading.triangle, prim, u, v)
        sample_texture(shading.pack, shading.reflection_texture[m], s, t, 0.0, rgba)
        row[METALLIC, lane] *= rgba[2]
        row[WIDTH, lane] *= rgba[1] * rgba[1]


@inner
def base_colour(shading, prim, m, u, v, out):
    """Write base colour texture times vertex colour at barycentrics (u, v) of triangle `prim` to `out` (4,).

    m : number of the triangle's material
    """
    out[0] = out[1] = out[2] = 1.0
    if shading.base_texture[m] >= 0:
        s, t = uv_at(shading.base_uv, shading.triangle, prim, u, v)
        sample_texture(shading.pack, shading.base_texture[m], s, t, 0.0, out)
    if len(shading.colour) > 1:
        i, j, k = shading.triangle[prim, 0], shading.triangle[prim, 1], shading.triangle[prim, 2]
        for c in range(3):
            out[c] *= (
                (1.0 - u - v) * shading.colour[i, c] + u * shading.colour[j, c] + v * shading.colour[k, c]
            )


@inner
def heuristic(own, other, power):
    """Return the MIS weight of the technique with density `own`, if the other technique has density `other`.

    power : 1 for the power heuristic with exponent 2, 0 for the balance heuristic
    """
    if power:
        own, other = own * own, other * other
    return own / (own + other) if own > 0.0 else 0.0


@inner
def aim(path, row, lane, lights, mode, power, choice, u, w, value, ray):
    """Choose a light and sample a ray to it; return the light's number, or -1 if the contribution is 0.

    path : (N_ROWS, n) float64; row : (5, n) float64; lights : `LightTable`
    mode, power : `Estimator.aim` and `.power`
    choice, u, w : random numbers in [0, 1), for the light and for the point on it
    value : (3,) float64, output, contribution if nothing blocks the ray, without the emitter's texture
    ray : (6,) float64, output: unit direction, length in metres, barycentrics of its end
    """
    emitter, delta, sky = lights.emitter, lights.delta, lights.sky
    n, p = len(emitter), len(delta)
    x, y, z = path[POSITION, lane], path[POSITION + 1, lane], path[POSITION + 2, lane]
    light = pick_light(lights.cumulative, choice)
    max_distance = FAR
    density = 0.0
    b1 = b2 = 0.0
    if light < n:
        if mode == 0:
            return -1
        dx, dy, dz, density, b1, b2 = aim_at_emitter(emitter, light, u, w, x, y, z)
        if density <= 0.0:
            return -1
        length = math.sqrt(dx * dx + dy * dy + dz * dz)
        dx, dy, dz = dx / length, dy / length, dz / length
        max_distance = length * SHORT
        scale = 1.0 / density
        red, green, blue = (
            emitter[light, EMITTER_RADIANCE],
            emitter[light, EMITTER_RADIANCE + 1],
            emitter[light, EMITTER_RADIANCE + 2],
        )
    elif light < n + p:
        e = light - n
        dx, dy, dz, max_distance, share = aim_at_delta(lights, e, x, y, z)
        scale = share / delta[e, DELTA_CHANCE]
        red, green, blue = (
            delta[e, DELTA_INTENSITY],
            delta[e, DELTA_INTENSITY + 1],
            delta[e, DELTA_INTENSITY + 2],
        )
    else:
        if mode == 0:
            return -1
        a, b, c = cosine_sample(u, w)
        dx = a * path[FRAME, lane] + b * path[FRAME + 3, lane] + c * path[FRAME + 6, lane]
        dy = a * path[FRAME + 1, lane] + b * path[FRAME + 4, lane] + c * path[FRAME + 7, lane]
        dz = a * path[FRAME + 2, lane] + b * path[FRAME + 5, lane] + c * path[FRAME + 8, lane]
        density = sky[SKY_CHANCE] * c / math.pi
        scale = 1.0 / density if density > 0.0 else 0.0
        red, green, blue = sky[0], sky[1], sky[2]
    above = dx * path[NORMAL, lane] + dy * path[NORMAL + 1, lane] + dz * path[NORMAL + 2, lane]
    if scale <= 0.0 or above <= 0.0:
        return -1
    lx, ly, lz = local(path, lane, dx, dy, dz)
    other = bsdf_eval(row, lane, path[TO, lane], path[TO + 1, lane], path[TO + 2, lane], lx, ly, lz, value)
    if density > 0.0 and mode == 2:
        scale *= heuristic(density, other, power)
    value[0] *= path[BETA, lane] * red * scale
    value[1] *= path[BETA + 1, lane] * green * scale
    value[2] *= path[BETA + 2, lane] * blue * scale
    ray[0], ray[1], ray[2] = dx, dy, dz
    ray[RAY_LENGTH], ray[RAY_B1], ray[RAY_B2] = max_distance, b1, b2
    return light if value[0] + value[1] + value[2] > 0.0 else -1


@inner
def multiply_emission_texture(shading, prim, u, v, value, rgba, aimed):
    """Multiply `value` (3,) by the emission texture of triangle `prim` at barycentrics (u, v).

    rgba : (4,) float64, working memory
    aimed : whether the ray was sampled towards the triangle. If so, `value` is multiplied by alpha as well.
        For rays that hit the triangle by chance, the hit filter has already applied alpha
    """
    m = shading.material[prim]
    there = opacity_at(shading, prim, u, v) if aimed else 1.0
    for c in range(3):
        value[c] *= there
    if shading.emission_texture[m] >= 0:
        s, t = uv_at(shading.emission_uv, shading.triangle, prim, u, v)
        sample_texture(shading.pack, shading.emission_texture[m], s, t, 0.0, rgba)
        for c in range(3):
            value[c] *= rgba[c]


@inner
def scatter(path, row, lane, hemisphere, choice, u, w, weight):
    """Sample the next direction of a path, and update its throughput; return False if the path ends.

    path : (N_ROWS, n) float64; row : (5, n) float64; weight : (3,) float64, working memory
    hemisphere : `Estimator.hemisphere`
    choice, u, w : random numbers in [0, 1), for the lobe and for the direction
    """
    vx, vy, vz = path[TO, lane], path[TO + 1, lane], path[TO + 2, lane]
    mirror = 0.0
    if row[WIDTH, lane] >= 0.0 and hemisphere != 0:
        # Choose mirror reflections with this probability, because only BSDF sampling finds their direction.
        mirror = specular_chance(row, lane, vz) if row[WIDTH, lane] < SMOOTH else 0.0
    if hemisphere == 0 or choice < mirror:
        lx, ly, lz, density, smooth = bsdf_sample(row, lane, vx, vy, vz, choice, u, w, weight)
        if smooth:
            density = 0.0
        elif density <= 0.0:
            return False
    else:
        if hemisphere == 1:
            lz = u
            r = math.sqrt(max(1.0 - u * u, 0.0))
            lx, ly = r * math.cos(2.0 * math.pi * w), r * math.sin(2.0 * math.pi * w)
            density = 0.5 / math.pi
        else:
            lx, ly, lz = cosine_sample(u, w)
            density = lz / math.pi
        bsdf_eval(row, lane, vx, vy, vz, lx, ly, lz, weight)
        if density <= 0.0:
            return False
        for c in range(3):
            weight[c] /= density * (1.0 - mirror)
    dx = lx * path[FRAME, lane] + ly * path[FRAME + 3, lane] + lz * path[FRAME + 6, lane]
    dy = lx * path[FRAME + 1, lane] + ly * path[FRAME + 4, lane] + lz * path[FRAME + 7, lane]
    dz = lx * path[FRAME + 2, lane] + ly * path[FRAME + 5, lane] + lz * path[FRAME + 8, lane]
    if dx * path[NORMAL, lane] + dy * path[NORMAL + 1, lane] + dz * path[NORMAL + 2, lane] <= 0.0:
        return False
    path[GO, lane], path[GO + 1, lane], path[GO + 2, lane] = dx, dy, dz
    path[DENSITY, lane] = density
    most = 0.0
    for c in range(3):
        path[BETA + c, lane] *= weight[c]
        most = max(most, path[BETA + c, lane])
    return most > 0.0
