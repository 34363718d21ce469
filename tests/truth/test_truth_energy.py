"""Energy is conserved, and the light of N bounces is a partial sum of the Neumann series."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder, form_factors
from scipy.sparse import csr_matrix
from ztest import assert_unbiased

from baker.core.progress import silent
from baker.radiosity.solve import solve_radiosity


def open_room(albedo=0.7, texels=12):
    """Return (builder, quads of the room) of a room without ceiling, with an emitter and two screens."""
    builder = SceneBuilder(64)
    walls = builder.material((albedo, 0.5 * albedo, 0.1))
    quads = builder.box((0, 0, 0), (3, 2, 2), walls, texels, inward=True)
    del builder.meshes[3], builder.instances[3]
    builder.quad((1, 1.9, 1), (1, 0, 0), (0, 0, 0.5), builder.material(0.3, (5.0, 4.0, 3.0)), (6, 6))
    builder.quad((0.5, 0.1, 0.5), (0, 1, 0), (0.3, 0, 0.8), walls, (6, 6))
    builder.quad((2.2, 0.1, 0.4), (0, 1, 0), (0.3, 0, 0.8), builder.material(0.6, double_sided=True), (6, 6))
    builder.light("point", 20.0, position=(1.3, 1.0, 0.4))
    return builder, quads


@pytest.mark.parametrize("sky", ["0", "1,2,3"])
@pytest.mark.parametrize("albedo", [0.2, 0.95])
def test_what_is_emitted_is_absorbed_or_escapes(albedo, sky):
    builder, _ = open_room(albedo)
    solve = builder.bake(sky=sky).solve
    energy = solve["energy"]
    assert energy["emitted"] > 0
    assert energy["escaped"] > 0.02 * energy["emitted"]
    # The row sums of the form factor matrix have errors of a few 1e-4, and the solve stops at an estimated
    # relative error of 3e-5.
    assert energy["absorbed"] + energy["escaped"] == pytest.approx(energy["emitted"], rel=1e-3)
    assert solve["residual"] < 1e-4


def test_closed_black_room_absorbs_the_flux_of_its_lights():
    """`solve["energy"]["emitted"]` is 4 pi I of the point light, plus pi L A of each emitter side."""
    emitted = []
    for seed in range(6):
        builder = SceneBuilder(64)
        builder.box((0, 0, 0), (2, 2, 2), builder.material(0.0), 12, inward=True)
        builder.quad(
            (0.5, 1.0, 0.5), (1, 0, 0), (0, 0, 1), builder.material(0.0, 8.0, double_sided=True), (6, 6)
        )
        builder.light("point", 3.0, position=(0.4, 0.3, 1.2))
        energy = builder.bake(seed=seed).solve["energy"]
        emitted.append(energy["emitted"])
        assert energy["absorbed"] == pytest.approx(energy["emitted"], rel=1e-6)
    # `slack`: direct light of a point light 30 cm away, sampled at 16 points a texel, has an error of 0.3 %.
    assert_unbiased(emitted, 4 * np.pi * 3.0 + 2 * np.pi * 8.0, least=0.01, slack=0.003)


@pytest.fixture(scope="module")
def system():
    """Return patches, form factors, albedo, random exitance and the dense matrix of the open room."""
    builder, _ = open_room(texels=6)
    world, patches, matrix = form_factors(builder, n_rays=128)
    weight = np.maximum(world.texels.area, 1e-12)
    albedo = patches.mean(world.texels.albedo, weight)
    source = albedo * np.random.default_rng(5).random((patches.n, 3))
    full = csr_matrix((matrix.value, matrix.column, matrix.first), shape=(patches.n, patches.n)).toarray()
    return patches, matrix, albedo, source, full.astype(np.float64)


@pytest.mark.parametrize("bounces", [0, 1, 2, 3, 7])
def test_bounces_are_terms_of_the_neumann_series(system, bounces):
    """The solve gives the first `bounces` - 1 terms of F s + F rho F s + ...; the final gather adds one.

    F are the form factors, rho is the albedo and s the exitance due to direct light.
    """
    patches, matrix, albedo, source, full = system
    found = solve_radiosity(matrix, source, albedo, patches.area, bounces=bounces, progress=silent)
    term, total = source, np.zeros_like(source)
    for _ in range(bounces - 1):
        arrives = full @ term
        total += arrives
        term = albedo * arrives
    assert np.allclose(found.irradiance, total, rtol=1e-5, atol=1e-9)


def test_converged_solution_is_that_of_the_dense_system(system):
    patches, matrix, albedo, source, full = system
    found = solve_radiosity(matrix, source, albedo, patches.area, bounces=None, progress=silent)
    for c in range(3):
        exitance = np.linalg.solve(np.eye(patches.n) - albedo[:, c, None] * full, source[:, c])
        truth = full @ exitance
        # The solve stops when the estimated error of each patch is at most 3e-5 of the patch's light.
        assert np.linalg.norm(found.irradiance[:, c] - truth) < 1e-4 * np.linalg.norm(truth)
    assert found.residual < 1e-4


def test_furnace_after_each_bounce():
    """E = pi L (1 + rho + ... + rho^N) after N bounces."""
    rho = 0.6
    for bounces in (0, 1, 4):
        means = []
        for seed in range(8):
            builder = SceneBuilder(64)
            quads = builder.box((0, 0, 0), (1, 2, 3), builder.material(rho, 1.0), 10, inward=True)
            result = builder.bake(seed=seed, bounces=bounces)
            means.append(np.mean([q.values(result).mean() for q in quads.values()]))
        assert_unbiased(means, np.pi * sum(rho**n for n in range(bounces + 1)), least=0.01)


def test_many_bounces_converge_to_the_default():
    builder, _quads = open_room(0.8)
    default = builder.bake(samples=32)
    # Compare only texels on surfaces; dilated texels are extrapolated.
    on = (default.status != 0) & (default.status != 2)
    page = default.lightmaps["irradiance"].value[on]
    before = np.inf
    for bounces in (0, 1, 3, 40):
        value = builder.bake(samples=32, bounces=bounces).lightmaps["irradiance"].value[on]
        # Each bounce adds light, and the rays do not depend on `bounces`. The tolerance is for the error of
        # the solve.
        assert (value <= page + 1e-4 * page.max()).all()
        away = float((page - value).max())
        assert away < before
        before = away
    assert before < 1e-3 * page.max()


def test_brighter_walls_brighten_everything():
    first, second = (open_room(albedo)[0].bake(samples=32) for albedo in (0.3, 0.6))
    dark, light = (
        r.lightmaps["irradiance"].value[(first.status != 0) & (first.status != 2)] for r in (first, second)
    )
    assert len(dark) > 500
    assert (light >= dark * (1 - 1e-5)).all()
    assert light.mean() > 1.05 * dark.mean()


def test_twice_the_light_is_twice_the_map():
    def bake(factor):
        builder = SceneBuilder(64)
        builder.box((0, 0, 0), (1, 1, 1), builder.material(0.5), 12, inward=True)
        builder.quad((0.4, 0.9, 0.4), (0.2, 0, 0), (0, 0, 0.2), builder.material(0.2, 7.0 * factor), (6, 6))
        builder.light("point", 2.0 * factor, position=(0.5, 0.5, 0.3))
        return builder.bake().lightmaps["irradiance"].value

    assert np.allclose(bake(1000.0), 1000.0 * bake(1.0), rtol=1e-5)
