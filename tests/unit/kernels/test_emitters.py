"""Sampling of emissive triangles matches its density, and both MIS estimates sum to the integrand."""

from __future__ import annotations

import naive
import numpy as np
import pytest
from inner import compiled
from tiny_scenes import Quad, grey, quad_world

from baker.core.geometry import Geometry, face_normals
from baker.core.scene import Material, Texture
from baker.kernels.emitters import (
    CLUSTER,
    SHARE,
    bounding_sphere,
    cluster_chances,
    emitted_radiance,
    emitter_density,
    sample_emitter,
    tile_emitters,
)
from baker.kernels.shading import Shading
from baker.kernels.textures import pack_textures
from baker.lights.emissive import MAX_CLUSTERS, build_emitters
from baker.radiosity.kernels.area_light import emitter_hit, mis_weighted

bounding_sphere, emitted_radiance, emitter_density = compiled(
    bounding_sphere, emitted_radiance, emitter_density
)
emitter_hit, mis_weighted, sample_emitter = compiled(emitter_hit, mis_weighted, sample_emitter)


def random_emitters(n, seed, two_sided=0.2):
    """Return (geometry, shading, emitters) of n random triangles that face down.

    Size and radiance vary by orders of magnitude. Some triangles are two-sided, and some do not emit.
    """
    rng = np.random.default_rng(seed)
    middle = rng.uniform(-2, 2, (n, 1, 3)) * [1, 0.1, 1]
    position = np.float32(
        middle + rng.normal(0, 1, (n, 3, 3)) * [1, 0.2, 1] * 10 ** rng.uniform(-2, -0.5, (n, 1, 1))
    )
    position = position.reshape(-1, 3)
    triangle = np.arange(3 * n, dtype=np.int32).reshape(-1, 3)
    normal, area = face_normals(position, triangle)
    down = normal[:, 1] > 0
    triangle[down] = triangle[down][:, ::-1]
    normal, area = face_normals(position, triangle)
    zero = np.zeros(n, np.int32)
    material = rng.integers(0, 5, n).astype(np.int32)
    sides = (rng.random(n) < two_sided) & (material != 4)
    geometry = Geometry(
        position,
        np.repeat(normal, 3, axis=0),
        np.zeros((3 * n, 2), np.float32),
        np.arange(3 * n, dtype=np.int32),
        triangle,
        normal,
        area,
        zero,
        zero,
        zero,
        material,
        sides,
    )
    emission = np.float32([[1, 1, 1], [10, 0, 0], [0.1, 0.2, 0.3], [0, 0, 0], [5, 5, 50]])
    none, uv = np.full(5, -1, np.int32), np.zeros((1, 2), np.float32)
    shading = Shading(
        pack_textures([]),
        emission,
        emission,
        none,
        none,
        uv,
        uv,
        np.ones((1, 3), np.float32),
        triangle,
        material,
    )
    return geometry, shading, build_emitters(geometry, shading)


def chances(emitters, centre, radius):
    chance, running = np.zeros((2, len(emitters.power)), np.float32)
    # Two ray origins are opposite corners of a box with this centre. Half of the box's diagonal is `radius`.
    reach = np.full(3, radius / np.sqrt(3.0))
    origin = np.float32([[centre - reach, centre + reach]])
    cluster_chances(emitters, origin, chance, running)
    assert chance.any()
    return chance, running


@pytest.mark.parametrize("n", [1, 40, 900])
def test_the_table_holds_every_emitter_once(n):
    geometry, shading, emitters = random_emitters(n, 2)
    emits = np.flatnonzero(shading.emission[geometry.material].max(axis=1) > 0)
    np.testing.assert_array_equal(np.sort(emitters.triangle), emits)
    assert len(emitters.power) == min(len(emits), MAX_CLUSTERS)
    assert (np.diff(emitters.first) > 0).all()
    assert emitters.first[-1] == len(emits)
    luminance = shading.emission[geometry.material[emitters.triangle]] @ [0.2126, 0.7152, 0.0722]
    power = (
        np.pi
        * geometry.area[emitters.triangle]
        * luminance
        * np.where(geometry.double_sided[emitters.triangle], 2, 1)
    )
    for c in range(len(emitters.power)):
        span = slice(emitters.first[c], emitters.first[c + 1])
        assert emitters.power[c] == pytest.approx(power[span].sum(), rel=1e-5)
        np.testing.assert_allclose(emitters.row[span, SHARE], power[span] / power[span].sum(), rtol=1e-5)
        corner = geometry.position[geometry.triangle[emitters.triangle[span]]].reshape(-1, 3)
        assert (np.linalg.norm(corner - emitters.centre[c], axis=1) <= emitters.radius[c] * 1.0001).all()
        if emitters.spread[c] < 3:
            lean = geometry.face_normal[emitters.triangle[span]] @ emitters.axis[c]
            assert (np.arccos(np.clip(lean, -1, 1)) <= emitters.spread[c] + 1e-3).all()
            assert not geometry.double_sided[emitters.triangle[span]].any()


@pytest.mark.parametrize("n", [30, 900])
def test_triangles_and_points_are_chosen_by_their_density(n):
    geometry, _, emitters = random_emitters(n, 3)
    rng = np.random.default_rng(0)
    chance_of_all = []
    for centre, radius in (((0, -2, 0), 0.3), ((1.5, 0.1, 1), 0.05), ((0, -30, 4), 1.0)):
        chance, running = chances(emitters, centre, radius)
        m_all = np.arange(len(emitters.triangle))
        density = np.array([emitter_density(emitters.row, chance, running, m) for m in m_all], float)
        area = geometry.area[emitters.triangle].astype(float)
        assert (density * area).sum() == pytest.approx(1, abs=2e-5)
        count, bary, point = np.zeros(len(m_all)), [], np.zeros(3, np.float32)
        for u, v in rng.random((12000, 2), np.float32):
            m, told, b1, b2 = sample_emitter(emitters.row, emitters.first, chance, running, u, v, point)
            count[m] += 1
            bary.append((m, b1, b2))
            assert told == pytest.approx(density[m], rel=1e-5)
            if len(bary) % 100 == 0:
                corner = geometry.position[geometry.triangle[emitters.triangle[m]]].astype(float)
                truth = corner[0] * (1 - b1 - b2) + corner[1] * b1 + corner[2] * b2
                np.testing.assert_allclose(point, truth, atol=1e-5)
        chance_of_all.append(naive.chi_square_chance(count, density * area * count.sum()))
        _, b1, b2 = np.array(bary, float).T
        table = np.histogram2d((b1 + b2) ** 2, b1 / np.maximum(b1 + b2, 1e-9), 8, [[0, 1], [0, 1]])[0]
        chance_of_all.append(naive.chi_square_chance(table, np.full(table.shape, table.sum() / table.size)))
    assert min(chance_of_all) > naive.sidak(len(chance_of_all))


def test_extreme_numbers_choose_a_triangle_that_can_be_chosen():
    _, _, emitters = random_emitters(400, 4)
    chance, running = chances(emitters, (0, -3, 0), 0.2)
    point = np.zeros(3, np.float32)
    ends = np.float32([0, 2**-24, 0.5, 1 - 2**-24])
    borders = np.nextafter(running[running < 1], np.float32(2))
    for u in np.concatenate([ends, running[running < 1], borders]).astype(np.float32):
        m, density, b1, b2 = sample_emitter(
            emitters.row, emitters.first, chance, running, min(u, ends[-1]), ends[3], point
        )
        assert 0 <= m < len(emitters.triangle)
        assert density > 0
        assert chance[int(emitters.row[m, CLUSTER])] > 0
        assert min(b1, b2) >= 0
        assert b1 + b2 <= 1


def test_no_cluster_that_could_shine_is_left_out():
    geometry, _, emitters = random_emitters(900, 5, two_sided=0.01)
    rng = np.random.default_rng(1)
    zero = 0
    for _ in range(60):
        centre = rng.uniform(-3, 3, 3) * [1, 0.5, 1]
        radius = 10 ** rng.uniform(-2, 0)
        chance, running = chances(emitters, centre, radius)
        assert chance.sum() == pytest.approx(1, abs=1e-5)
        np.testing.assert_allclose(running, np.cumsum(chance, dtype=float), atol=1e-5)
        shift = rng.normal(size=(30, 3))
        inside = centre + radius * shift / np.linalg.norm(shift, axis=1, keepdims=True) * rng.random(
            (30, 1)
        ) ** (1 / 3)
        corner = geometry.position[geometry.triangle[emitters.triangle]][:, 0].astype(float)
        seen = (
            np.einsum("pma,ma->pm", inside[:, None] - corner, geometry.face_normal[emitters.triangle]) > 1e-6
        )
        seen = seen.any(axis=0) | geometry.double_sided[emitters.triangle]
        for c in np.flatnonzero(chance == 0):
            assert not seen[emitters.first[c] : emitters.first[c + 1]].any()
        zero += (chance == 0).sum()
    assert zero > 100


def test_nothing_to_choose():
    geometry, shading, emitters = random_emitters(5, 6)
    dark = build_emitters(geometry, shading._replace(emission=np.zeros((5, 3), np.float32)))
    assert len(dark.triangle) == len(dark.power) == 0
    assert tile_emitters(dark, np.zeros((1, 16, 3), np.float32)).chance.shape == (0,)
    # An emitter that faces down cannot be seen from above.
    one_sided = quad_world([Quad((0, 0, 0), (1, 0, 0), (0, 0, 1), grey(0.5, 1.0))]).emitters
    assert not tile_emitters(one_sided, np.full((1, 16, 3), [0, 50, 0], np.float32)).chance.any()
    below = tile_emitters(one_sided, np.full((1, 16, 3), [0, -50, 0], np.float32))
    assert (below.chance > 0).all()
    np.testing.assert_array_equal(below.chance, chances(one_sided, (0, -50, 0), 0)[0])
    zero = np.zeros(len(emitters.power), np.float32)
    assert emitter_density(emitters.row, zero, zero, 0) == 0


def test_a_sphere_around_points():
    point = np.float32(np.random.default_rng(0).normal(size=(50, 3)))
    x, y, z, radius = bounding_sphere(point[10:40].reshape(10, 3, 3))
    distance = np.linalg.norm(point[10:40] - [x, y, z], axis=1)
    assert (distance <= radius * (1 + 1e-6)).all()
    assert radius <= np.sqrt(3) * distance.max()


def test_both_mis_estimates_sum_to_the_integrand():
    """For each direction, n_l p_l w_l + n_h p_h w_h is the integrand, here the cosine.

    n is the number of samples, p their density per solid angle, and w the MIS-weighted integrand, of light
    samples (l) and of hemisphere samples (h).
    """
    world = quad_world(
        [
            Quad((0, 1, 0), (1, 0, 0), (0, 0, 1), grey(0.5, 3.0)),
            Quad((2, 1, 0), (1, 0, 0), (0, 0.4, 1), grey(0.5, 1.0, double_sided=True)),
            Quad((0, 0, 0), (1, 0, 0), (0, 0, -1), grey(0.5)),
        ]
    )
    emitters, row = world.emitters, world.table.row
    rng = np.random.default_rng(2)
    weights, dark = [], 0
    for _ in range(400):
        origin, normal = rng.uniform([-1, -1, -1], [3, 2.5, 2]), rng.normal(size=3)
        normal /= np.linalg.norm(normal)
        chance, running = chances(emitters, origin, 0.01)
        m = int(rng.integers(len(emitters.triangle)))
        t = int(emitters.triangle[m])
        b = rng.dirichlet([1, 1, 1])
        d = b @ world.geometry.position[world.geometry.triangle[t]].astype(float) - origin
        distance = np.linalg.norm(d)
        d /= distance
        n_light, n_hemisphere = rng.integers(1, 300, 2)
        found = emitter_hit(
            row,
            emitters.row,
            chance,
            running,
            t,
            m,
            tuple(np.float32(d)),
            tuple(np.float32(normal)),
            np.float32(distance),
            float(n_light),
            int(n_hemisphere),
        )
        facing = -d @ world.geometry.face_normal[t]
        cosine = float(d @ normal)
        lit = cosine > 0 and (facing > 0 or world.geometry.double_sided[t])
        assert (found > 0) == lit
        dark += not lit
        if not lit:
            continue
        # Compute the density of light samples per solid angle.
        c = int(emitters.row[m, CLUSTER])
        density = chance[c] * emitters.row[m, SHARE] / world.geometry.area[t] * distance**2 / abs(facing)
        light = mis_weighted(cosine, float(density), float(n_light), float(n_hemisphere))
        total = n_light * density * light + n_hemisphere * cosine / np.pi * found
        assert total == pytest.approx(cosine, rel=2e-4)
        weights.append(n_light * density * light / cosine)
    assert dark > 100
    assert 0 <= min(weights) < 0.1
    assert 0.9 < max(weights) < 1


def test_textured_emission():
    image = np.zeros((8, 8, 4), np.float32)
    image[:, 4:, :3] = [1.0, 0.5, 0.0]
    picture = Material(emission=(4, 4, 4), emission_texture=Texture(image, wrap=("clamp", "clamp")))
    black = Material(emission=(4, 4, 4), emission_texture=Texture(image * 0))
    world = quad_world(
        [Quad((0, 0, 0), (1, 0, 0), (0, 1, 0), picture), Quad((0, 0, 1), (1, 0, 0), (0, 1, 0), black)]
    )
    # A quad with a black texture is not an emitter. Power is proportional to the mean of the texture.
    np.testing.assert_array_equal(np.unique(world.emitters.triangle), [0, 1])
    truth = np.pi * 0.5 * 4 * (1 + 0.5) / 3
    assert world.emitters.power.sum() == pytest.approx(truth, rel=1e-6)
    out = np.zeros(4)
    emitted_radiance(world.shading, 0, 0.8, 0.1, out)
    np.testing.assert_allclose(out[:3], [4, 2, 0], atol=1e-6)
    emitted_radiance(world.shading, 0, 0.1, 0.1, out)
    np.testing.assert_allclose(out[:3], 0, atol=1e-6)
