"""Texels in narrow gaps are detected, and share no patch with texels outside the gap."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import Quad, quad_world, seen_patches

from baker.core.progress import silent
from baker.radiosity.form_factors import build_form_factors
from baker.radiosity.narrow_gaps import gap_level
from baker.radiosity.patches import build_patches
from baker.radiosity.solve import solve_radiosity

SIDE = 4.0 / 31


@pytest.fixture(scope="module")
def world():
    """Return the world of a floor, a sheet 0.5 texels above half of it, and a shelf at 1.5 texels."""
    floor = Quad((0, 0, 0), (0, 0, 4), (4, 0, 0))
    sheet = Quad((0, 0.5 * SIDE, 0), (2, 0, 0), (0, 0, 4))
    shelf = Quad((3, 1.5 * SIDE, 0), (1, 0, 0), (0, 0, 4))
    return quad_world([floor, sheet, shelf], 64, inset=0.0)


def depth(world, threads=1):
    return gap_level(world.texels, world.job(threads=threads))


def test_depth_follows_the_height_of_the_gap(world):
    found, rays = depth(world)
    assert 4 * world.texels.n < rays < 32 * world.texels.n
    assert found.dtype == np.uint8
    x, z = world.texels.position[:, 0], world.texels.position[:, 2]
    floor = world.texels.instance == 0
    under = (x > 2 * SIDE) & (x < 2 - 2 * SIDE) & (np.abs(z - 2) < 2 - 2 * SIDE)
    assert (found[floor & under] == 2).all()
    assert (found[floor & (x > 2 + SIDE) & (x < 3 - 5 * SIDE)] == 0).all()
    middle = floor & (x > 3.4) & (x < 3.7) & (np.abs(z - 2) < 1)
    assert (found[middle] == 1).all()
    # The sheet faces down, so its texels lie in the same gap.
    sheet = world.texels.instance == 1
    assert world.texels.normal[sheet][0, 1] < 0
    assert (found[sheet & under] == 2).mean() > 0.9


def test_a_room_s_corners_are_no_gaps():
    floor, wall = Quad((0, 0, 0), (0, 0, 4), (4, 0, 0)), Quad((0, 0, 0), (0, 4, 0), (0, 0, 4))
    found, _ = depth(quad_world([floor, wall], 64))
    assert (found == 0).all()


def test_texels_in_the_open_take_four_rays_each():
    found, rays = depth(quad_world([Quad((0, 0, 0), (0, 0, 4), (4, 0, 0))], 64))
    assert (found == 0).all()
    assert rays == 4 * len(found)


def test_any_number_of_threads_finds_the_same(world):
    assert depth(world)[0].tobytes() == depth(world, threads=2)[0].tobytes()


def test_patches_end_at_the_mouth_of_a_gap(world):
    found, _ = depth(world)
    patches = build_patches(world.texels, found, max_patches=1000)
    mixed = build_patches(world.texels, max_patches=1000)
    assert patches.block == mixed.block > 1
    for p in range(patches.n):
        assert len(np.unique(found[patches.member[patches.first[p] : patches.first[p + 1]]])) == 1
    assert mixed.n < patches.n
    assert patches.area.sum() == pytest.approx(mixed.area.sum())


def test_in_a_narrow_gap_each_texel_is_a_patch_and_light_does_not_cross_it():
    """A sheet lies a tenth of a texel above a floor. Only the floor near the sheet's +x edge is lit."""
    floors = [Quad((9 * k, 0, 0), (0, 0, 4), (4, 0, 0)) for k in range(8)]
    sheet = Quad((1, 0.02, 1), (1.5, 0, 0), (0, 0, 1.5))
    world = quad_world([*floors, sheet], 64, inset=0.0)
    texels = world.texels
    found, _ = depth(world)
    x = texels.position[:, 0]
    lit = (texels.instance == 0) & (np.abs(x - 2.5) < 0.2)
    light = np.repeat(1000 * lit[:, None].astype(np.float32), 3, axis=1)
    deep = (found == 2) & (x > 1.4) & (x < 1.9)
    indirect = {}
    for name, used in (("texels", found), ("blocks", found.clip(max=1))):
        patches = build_patches(texels, used, max_patches=500)
        members = np.diff(patches.first)[patches.patch]
        assert patches.block == 4
        assert members[used == 0].max() == 16
        assert (members[deep].max() == 1) == (name == "texels")
        matrix = build_form_factors(patches, seen_patches(texels, patches.patch), world.job(), n_rays=64)
        source, albedo = patches.mean(light, texels.area), np.full((patches.n, 3), 0.7)
        solution = solve_radiosity(matrix, source, albedo, patches.area, bounces=None, progress=silent)
        indirect[name] = solution.irradiance[patches.patch[deep], 0].mean()
    assert indirect["texels"] < 0.05 * indirect["blocks"]


def test_many_texels_in_gaps_share_patches_again(world):
    found, _ = depth(world)
    most = int((found == 2).sum()) // 2
    patches = build_patches(world.texels, found, max_patches=most)
    shared = np.diff(patches.first)[patches.patch[found == 2]]
    assert 1 < shared.max() <= patches.block**2
    assert len(np.unique(patches.patch[found == 2])) <= most
