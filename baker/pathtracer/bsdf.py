# mypy: disable-error-code="no-untyped-def"
"""Evaluates and samples BSDFs: Lambert, and glTF's metallic-roughness model with a GGX or mirror lobe.

    f = c_diff (1 - F) / pi + F D V        c_diff = base (1 - metallic), F0 = mix(0.04, base, metallic)
    D = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2)      a = roughness^2
    V = 0.5 / (n.l sqrt((n.v)^2 (1 - a^2) + a^2) + n.v sqrt((n.l)^2 (1 - a^2) + a^2))
    F = F0 + (1 - F0)(1 - v.h)^5

n is the shading normal, l and v are the unit directions to the light and to the viewer, h is their half
vector. Directions are in the frame of the shading normal (+z). The specular lobe F D V is sampled by visible
normals, the diffuse lobe by the cosine. If a is below `SMOOTH`, the specular lobe is a mirror: `bsdf_sample`
samples it, and `bsdf_eval` leaves it out.

Based on: Khronos Group, glTF 2.0 Specification, appendix B; Heitz, Sampling the GGX distribution of
visible normals, 2018; Heitz, Understanding the masking-shadowing function, 2014; Schlick, 1994.
"""

from __future__ import annotations

import math

from baker.trace.jit import inner

INV_PI = 1.0 / math.pi
# Limit of the GGX width a. Below this limit, the specular lobe is treated as a mirror.
SMOOTH = 1.0e-3
# F0 (reflectance at normal incidence) of a non-metal.
DIELECTRIC = 0.04
# Rows of `row`, the parameters of a BSDF: base colour (3), metallic, GGX width a. A negative width means
# Lambert.
BASE, METALLIC, WIDTH = 0, 3, 4
N_PARAMETERS = 5


@inner
def fresnel(f0, cosine):
    """Return Schlick's reflectance F; cosine : v.h."""
    m = min(max(1.0 - cosine, 0.0), 1.0)
    return f0 + (1.0 - f0) * m * m * m * m * m


@inner
def ggx_density(nh, a):
    """Return the GGX distribution D for n.h = nh and width a."""
    t = nh * nh * (a * a - 1.0) + 1.0
    return a * a / max(math.pi * t * t, 1.0e-300)


@inner
def ggx_masking(nv, a):
    """Return Smith's masking function G1 for n.v = nv and width a."""
    return 2.0 * nv / max(nv + math.sqrt(a * a + (1.0 - a * a) * nv * nv), 1.0e-300)


@inner
def ggx_visibility(nl, nv, a):
    """Return V = G2 / (4 nl nv) with Smith's height-correlated G2, for n.l = nl, n.v = nv and width a."""
    s = nl * math.sqrt(nv * nv * (1.0 - a * a) + a * a) + nv * math.sqrt(nl * nl * (1.0 - a * a) + a * a)
    return 0.5 / max(s, 1.0e-300)


@inner
def specular_chance(row, lane, nv):
    """Return the probability with which `bsdf_sample` chooses the specular lobe, for n.v = nv.

    row : (5, n) float64; column `lane` contains the parameters of the BSDF
    """
    if row[WIDTH, lane] < 0.0:
        return 0.0
    metallic = row[METALLIC, lane]
    base = (row[BASE, lane] + row[BASE + 1, lane] + row[BASE + 2, lane]) / 3.0
    specular = fresnel(DIELECTRIC + (base - DIELECTRIC) * metallic, nv)
    diffuse = base * (1.0 - metallic) * (1.0 - specular)
    if diffuse <= 0.0:
        return 1.0
    return min(max(specular / (specular + diffuse), 0.1), 0.9)


@inner
def bsdf_eval(row, lane, vx, vy, vz, lx, ly, lz, out):
    """Write f(v, l) n.l (RGB) to `out` (3,), and return the density with which `bsdf_sample` samples l.

    The density is per steradian.

    row : (5, n) float64; column `lane` contains the parameters of the BSDF
    v, l : unit directions away from the surface, in the frame of the shading normal
    """
    return bsdf_cosines(row, lane, vz, lz, vx * lx + vy * ly + vz * lz, out)


@inner
def bsdf_cosines(row, lane, nv, nl, vl, out):
    """Compute the results of `bsdf_eval` from the cosines nv = n.v, nl = n.l and vl = v.l.

    row : (5, n) float64, parameters; out : (3,) float64, output, f n.l
    """
    out[0] = out[1] = out[2] = 0.0
    if nv <= 0.0 or nl <= 0.0:
        return 0.0
    a = row[WIDTH, lane]
    if a < 0.0:
        for c in range(3):
            out[c] = row[BASE + c, lane] * INV_PI * nl
        return nl * INV_PI
    metallic = row[METALLIC, lane]
    # h = (v + l) / |v + l|, |v + l|^2 = 2 + 2 v.l
    length = math.sqrt(max(2.0 + 2.0 * vl, 1.0e-30))
    lobe = 0.0
    if a >= SMOOTH:
        lobe = ggx_density((nv + nl) / length, a) * ggx_visibility(nl, nv, a)
    vh = 0.5 * length
    for c in range(3):
        base = row[BASE + c, lane]
        f = fresnel(DIELECTRIC + (base - DIELECTRIC) * metallic, vh)
        out[c] = (base * (1.0 - metallic) * (1.0 - f) * INV_PI + f * lobe) * nl
    return cosines_pdf(row, lane, nv, nl, vl)


@inner
def cosines_pdf(row, lane, nv, nl, vl):
    """Return the density per steradian with which `bsdf_sample` samples l, without mirror reflections.

    nv, nl, vl : cosines n.v, n.l and v.l

    row : (5, n) float64, parameters
    """
    if nv <= 0.0 or nl <= 0.0:
        return 0.0
    a = row[WIDTH, lane]
    if a < 0.0:
        return nl * INV_PI
    chance = specular_chance(row, lane, nv)
    density = (1.0 - chance) * nl * INV_PI
    if a >= SMOOTH:
        nh = (nv + nl) / math.sqrt(max(2.0 + 2.0 * vl, 1.0e-30))
        density += chance * ggx_masking(nv, a) * ggx_density(nh, a) / (4.0 * nv)
    return density


@inner
def visible_normal(vx, vy, vz, a, u, w):
    """Sample a half vector from the distribution of GGX normals visible from v (Heitz 2018, listing 1).

    a : width; u, w : random numbers in [0, 1)
    """
    sx, sy, sz = a * vx, a * vy, vz
    length = math.sqrt(sx * sx + sy * sy + sz * sz)
    sx, sy, sz = sx / length, sy / length, sz / length
    flat = sx * sx + sy * sy
    tx, ty = 1.0, 0.0
    if flat > 0.0:
        tx, ty = -sy / math.sqrt(flat), sx / math.sqrt(flat)
    bx, by, bz = -sz * ty, sz * tx, sx * ty - sy * tx
    r = math.sqrt(u)
    phi = 2.0 * math.pi * w
    p = r * math.cos(phi)
    q = r * math.sin(phi)
    s = 0.5 * (1.0 + sz)
    q = (1.0 - s) * math.sqrt(max(1.0 - p * p, 0.0)) + s * q
    z = math.sqrt(max(1.0 - p * p - q * q, 0.0))
    hx = a * (p * tx + q * bx + z * sx)
    hy = a * (p * ty + q * by + z * sy)
    hz = max(q * bz + z * sz, 1.0e-12)
    length = math.sqrt(hx * hx + hy * hy + hz * hz)
    return hx / length, hy / length, hz / length


@inner
def cosine_sample(u, w):
    """Map (u, w) of the unit square to a cosine-weighted unit direction of the hemisphere about +z."""
    r = math.sqrt(u)
    phi = 2.0 * math.pi * w
    return r * math.cos(phi), r * math.sin(phi), math.sqrt(max(1.0 - u, 0.0))


@inner
def bsdf_sample(row, lane, vx, vy, vz, choice, u, w, weight):
    """Sample a direction l for the view direction v; write f n.l / density (RGB) to `weight` (3,).

    row : (5, n) float64, parameters
    choice, u, w : random numbers in [0, 1), for the lobe and for the direction

    Returns
    -------
    tuple
        l (three floats); its density per steradian; and whether l is a mirror reflection, whose density is
        returned as 0.
    """
    weight[0] = weight[1] = weight[2] = 0.0
    a = row[WIDTH, lane]
    chance = specular_chance(row, lane, vz)
    if choice >= chance:
        lx, ly, lz = cosine_sample(u, w)
    else:
        hx, hy, hz = 0.0, 0.0, 1.0
        if a >= SMOOTH:
            hx, hy, hz = visible_normal(vx, vy, vz, a, u, w)
        vh = vx * hx + vy * hy + vz * hz
        lx, ly, lz = 2.0 * vh * hx - vx, 2.0 * vh * hy - vy, 2.0 * vh * hz - vz
        if a < SMOOTH:
            for c in range(3):
                f0 = DIELECTRIC + (row[BASE + c, lane] - DIELECTRIC) * row[METALLIC, lane]
                weight[c] = fresnel(f0, vz) / chance
            return lx, ly, lz, 0.0, True
    density = bsdf_eval(row, lane, vx, vy, vz, lx, ly, lz, weight)
    if density > 0.0:
        for c in range(3):
            weight[c] /= density
    return lx, ly, lz, density, False
