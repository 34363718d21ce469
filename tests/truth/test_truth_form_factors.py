"""Form factors agree with closed forms, are reciprocal, and conserve light."""

from __future__ import annotations

import numpy as np
import pytest
from scenes import SceneBuilder, form_factors, icosphere
from scipy.sparse import csr_matrix
from ztest import assert_unbiased

PARALLEL, PERPENDICULAR = 0.1998249, 0.2000438
SEEDS = 6


def dense(patches, matrix):
    return csr_matrix((matrix.value, matrix.column, matrix.first), shape=(patches.n, patches.n)).toarray()


def between(group, patches, matrix):
    """Return F (G, G) between groups of patches: the sum of A_i F_ij over pairs / area of the first group."""
    full = dense(patches, matrix).astype(np.float64) * patches.area[:, None]
    member = np.eye(group.max() + 1)[group]
    return (member.T @ full @ member) / (member.T @ patches.area)[:, None]


def by_instance(world, patches):
    """Return the instance of each patch, (P,) int."""
    group = np.zeros(patches.n, int)
    group[patches.patch] = world.texels.instance
    return group


def two_squares(build, truth):
    found = []
    for seed in range(SEEDS):
        builder = SceneBuilder(64)
        build(builder, builder.material(0.5))
        world, patches, matrix = form_factors(builder, seed=seed)
        found.append(between(by_instance(world, patches), patches, matrix))
    # A flat square has F_ii = 0; rays that miss the other square leave to the sky.
    assert_unbiased(found, [[0.0, truth], [truth, 0.0]], least=0.005)


def test_parallel_unit_squares():
    def build(builder, material):
        builder.quad((0, 0, 0), (0, 0, 1), (1, 0, 0), material)
        builder.quad((0, 1, 0), (1, 0, 0), (0, 0, 1), material)

    two_squares(build, PARALLEL)


def test_perpendicular_unit_squares_with_a_common_edge():
    def build(builder, material):
        builder.quad((0, 0, 0), (0, 0, 1), (1, 0, 0), material)
        builder.quad((0, 0, 0), (0, 1, 0), (0, 0, 1), material)

    two_squares(build, PERPENDICULAR)


def test_the_cube_closes():
    assert pytest.approx(1, abs=1e-6) == PARALLEL + 4 * PERPENDICULAR
    truth = np.full((6, 6), PERPENDICULAR)
    for k in range(6):
        truth[k, k], truth[k, k ^ 1] = 0.0, PARALLEL
    found = []
    for seed in range(SEEDS):
        builder = SceneBuilder(64)
        builder.box((0, 0, 0), (1, 1, 1), builder.material(0.5), 12, inward=True)
        world, patches, matrix = form_factors(builder, seed=seed)
        found.append(between(by_instance(world, patches), patches, matrix))
    assert_unbiased(found, truth, least=0.01)


def test_inside_a_sphere_every_pair_depends_on_the_target_only():
    corner = icosphere(2, inward=True)
    builder = SceneBuilder(128)
    builder.triangles(corner, builder.material(0.5), 3)
    world, patches, matrix = form_factors(builder, n_rays=512)
    texels = world.texels
    triangle = texels.entry[texels.first[:-1]]
    group = np.zeros(patches.n, int)
    # `icosphere` stores the children of icosahedron face k at indices i with i mod 20 = k.
    group[patches.patch] = triangle % 20
    area = np.bincount(group, patches.area)
    found = between(group, patches, matrix)
    ratio = found / (area / area.sum())
    # A group casts 16 x 6 x 512 rays, and 1/20 of the rays hit each other group. About 2400 hits in each
    # direction give a pair of groups a noise of 1.4 %. The 320 flat faces differ from the sphere by up to
    # 2 %. The form factor of a group to itself is 15/16 of that on a sphere, because a flat face does not see
    # itself.
    apart = ratio[~np.eye(20, dtype=bool)]
    assert np.abs(apart - 1).max() < 0.04
    assert apart.std() < 0.015
    assert np.abs(np.diag(ratio) - 15 / 16).max() < 0.08


def unequal_room(builder):
    """Build a closed room of 1 x 2 x 5 m with a slab inside, and texels of very different sizes."""
    material = builder.material(0.5)
    low, high = np.zeros(3), np.array([5.0, 2.0, 1.0])
    for axis, texels in enumerate(((5, 9), (16, 6), (11, 4))):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        u, v = np.zeros(3), np.zeros(3)
        u[a], v[b] = high[a], high[b]
        builder.quad(low, u, v, material, texels)
        far = low.copy()
        far[axis] = high[axis]
        builder.quad(far, v, u, material, texels)
    # A slab in the room blocks some pairs of patches.
    builder.box((2.0, 0.5, 0.3), (3.5, 0.7, 0.6), material, 4)


@pytest.mark.parametrize("n_rays", [64, 512])
def test_closed_room_of_unequal_areas_loses_nothing(n_rays):
    builder = SceneBuilder(64)
    unequal_room(builder)
    _world, patches, matrix = form_factors(builder, n_rays=n_rays)
    assert patches.area.max() / patches.area.min() > 3
    # No ray leaks through an edge: none hits the sky or the outside of a wall.
    assert matrix.sky.max() == 0
    assert matrix.lost.max() == 0
    # After the balancing sweeps, row sums are 1 within 0.1 %. Float32 values are reciprocal up to rounding.
    assert np.abs(matrix.row_sums() - 1).max() < 1e-3
    flux = dense(patches, matrix).astype(np.float64) * patches.area[:, None]
    assert np.abs(flux - flux.T).max() <= 3e-7 * flux.max()
    assert (matrix.value >= 0).all()
    assert (np.diff(matrix.first) > 0).all()
    for i in range(patches.n):
        assert (np.diff(matrix.column[matrix.first[i] : matrix.first[i + 1]]) > 0).all()


def test_flat_patches_never_see_their_own_plane():
    builder = SceneBuilder(64)
    unequal_room(builder)
    world, patches, matrix = form_factors(builder)
    group = by_instance(world, patches)
    found = between(group, patches, matrix)
    assert np.abs(np.diag(found)).max() == 0.0


def test_open_scene_rows_close_with_the_sky():
    builder = SceneBuilder(64)
    material = builder.material(0.5)
    builder.quad((0, 0, 0), (0, 0, 1), (1, 0, 0), material)
    # The back of the second square faces the first: it blocks light but reflects none.
    builder.quad((0, 1, 0), (0, 0, 1), (1, 0, 0), material)
    world, patches, matrix = form_factors(builder)
    assert np.allclose(matrix.row_sums() + matrix.sky + matrix.lost, 1, atol=1e-6)
    group = by_instance(world, patches)
    lost = np.average(matrix.lost, weights=patches.area * (group == 0))
    assert lost == pytest.approx(PARALLEL, rel=0.02)
    assert matrix.lost[group == 1].max() == 0
    assert matrix.row_sums().max() == 0


def test_estimates_of_both_directions_agree():
    """The reciprocity error falls with the number of rays, so it is noise and not bias."""
    error = []
    for n_rays in (32, 128, 512):
        builder = SceneBuilder(64)
        unequal_room(builder)
        error.append(form_factors(builder, n_rays=n_rays)[2].reciprocity_error)
    assert error[0] > 1.3 * error[1] > 1.3**2 * error[2]
