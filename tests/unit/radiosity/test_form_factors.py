"""Form-factor matrices: row sums, reciprocity, closed forms, open scenes, determinism."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import csr_matrix
from tiny_scenes import Quad, box_quads, grey, quad_world, seen_patches

from baker.radiosity.form_factors import build_form_factors
from baker.radiosity.patches import build_patches


def factors(world, patches, mask=None, threads=1, n_rays=256):
    return build_form_factors(
        patches,
        seen_patches(world.texels, patches.patch if patches.n else np.full(world.texels.n, -1, np.int32)),
        world.job(mask, threads),
        n_rays=n_rays,
    )


@pytest.fixture(scope="module")
def cube():
    world = quad_world(box_quads((0, 0, 0), (1, 1, 1), inward=True), 45, inset=0.2)
    patches = build_patches(world.texels, max_patches=400)
    return world, patches, factors(world, patches)


def by_wall(world, patches, matrix):
    """Return (6, 6) form factors between whole walls."""
    wall = world.texels.instance[patches.member[patches.first[:-1]]]
    dense = csr_matrix((matrix.value, matrix.column, matrix.first), shape=(patches.n, patches.n)).toarray()
    flux = patches.area[:, None] * dense
    return np.array(
        [
            [flux[np.ix_(wall == a, wall == b)].sum() / patches.area[wall == a].sum() for b in range(6)]
            for a in range(6)
        ]
    )


def test_rows_are_whole_in_a_closed_room(cube):
    _, patches, matrix = cube
    assert (matrix.sky == 0).all()
    assert (matrix.lost < 0.02).all()
    np.testing.assert_allclose(matrix.row_sums() + matrix.lost, 1, atol=1e-3)
    assert (matrix.value >= 0).all()
    assert matrix.rays == patches.n * 256
    assert all(
        (np.diff(matrix.column[a:b]) > 0).all() for a, b in zip(matrix.first, matrix.first[1:], strict=False)
    )
    assert 0 < matrix.row_error < 0.5
    assert 0 < matrix.reciprocity_error < 1


def test_fluxes_are_reciprocal(cube):
    _, patches, matrix = cube
    dense = csr_matrix((matrix.value, matrix.column, matrix.first), shape=(patches.n, patches.n)).toarray()
    flux = patches.area[:, None] * dense
    np.testing.assert_allclose(flux, flux.T, rtol=1e-4, atol=1e-9)


def test_walls_see_each_other_as_the_closed_forms_say(cube):
    """Form factors are 0.1998249 for opposite and 0.2000438 for adjacent unit squares (Howell C-11, C-14)."""
    world, patches, matrix = cube
    ours = by_wall(world, patches, matrix)
    for a in range(6):
        assert ours[a, a] == 0
        for b in range(6):
            if a != b:
                truth = 0.1998249 if a // 2 == b // 2 else 0.2000438
                assert ours[a, b] == pytest.approx(truth, abs=0.004)


def test_threads_change_no_byte(cube):
    world, patches, matrix = cube
    again = factors(world, patches, threads=2)
    for name in ("first", "column", "value", "sky", "lost"):
        assert getattr(again, name).tobytes() == getattr(matrix, name).tobytes()


def test_open_scenes_and_black_backs():
    """A floor below a one-sided lid that faces up, and a floor below a two-sided sheet."""
    floor = Quad((0, 0, 0), (0, 0, 1), (1, 0, 0))
    lid = Quad((-50, 1, -50), (0, 0, 100), (100, 0, 0))
    world = quad_world([floor, lid], 24, inset=0.1)
    patches = build_patches(world.texels, max_patches=80)
    matrix = factors(world, patches, n_rays=128)
    on_floor = world.texels.instance[patches.member[patches.first[:-1]]] == 0
    # The floor sees only the black back of the lid, and the front of the lid sees only sky.
    assert (matrix.lost[on_floor] > 0.99).all()
    assert (matrix.sky[~on_floor] == 1).all()
    np.testing.assert_array_equal(matrix.row_sums(), 0)
    np.testing.assert_allclose(matrix.row_sums() + matrix.sky + matrix.lost, 1, atol=0.01)
    low = Quad((-1, 0.2, -1), (0, 0, 3), (3, 0, 0), grey(double_sided=True))
    both = quad_world([floor, low], 24, inset=0.1)
    patches = build_patches(both.texels, max_patches=120)
    matrix = factors(both, patches, n_rays=256)
    on_floor = both.texels.instance[patches.member[patches.first[:-1]]] == 0
    assert (matrix.lost == 0).all()
    assert (matrix.row_sums()[on_floor] > 0.8).all()
    np.testing.assert_allclose(matrix.row_sums() + matrix.sky, 1, atol=0.03)


def test_no_patches_give_no_factors():
    world = quad_world(box_quads((0, 0, 0), (1, 1, 1), inward=True), 24)
    nothing = build_patches(
        type(
            "T",
            (),
            {
                "resolution": 24,
                "pixel": np.zeros(0, np.int64),
                "normal": np.zeros((0, 3), np.float32),
                "chart": np.zeros(0, np.int32),
                "back": np.zeros(0, bool),
                "area": np.zeros(0, np.float32),
            },
        )
    )
    matrix = factors(world, nothing)
    assert matrix.first.tolist() == [0]
    assert matrix.rays == 0


def test_small_patches_keep_what_large_ones_missed():
    """Few rays of a huge lid hit the floor below it, but all rays of the floor hit the lid."""
    floor = Quad((0, 0, 0), (0, 0, 1), (1, 0, 0))
    lid = Quad((-50, 1, -50), (0, 0, 100), (100, 0, 0), grey(double_sided=True))
    world = quad_world([floor, lid], 24, inset=0.1)
    patches = build_patches(world.texels, max_patches=120)
    matrix = factors(world, patches, n_rays=128)
    on_floor = world.texels.instance[patches.member[patches.first[:-1]]] == 0
    np.testing.assert_allclose(matrix.row_sums()[on_floor], 1, atol=0.01)
    # The walls of a house on open ground see ground and sky in equal shares.
    ground = Quad((-50, 0, -50), (0, 0, 100), (100, 0, 0))
    world = quad_world([*box_quads((-2, 0.01, -2), (2, 4, 2), inward=False), ground], 48, inset=0.1)
    patches = build_patches(world.texels, max_patches=1000)
    matrix = factors(world, patches, n_rays=128)
    wall = np.isin(world.texels.instance[patches.member[patches.first[:-1]]], [0, 1, 4, 5])
    seen = 1 - matrix.sky[wall] - matrix.lost[wall]
    assert matrix.row_sums()[wall].mean() == pytest.approx(seen.mean(), rel=0.03)
