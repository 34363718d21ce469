"""Texels in narrow gaps are found, and share no patch with what lies outside."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_scenes import Quad, quad_world

from baker.core.progress import silent
from baker.radiosity.crevices import gap_depth
from baker.radiosity.patches import build_patches

SIDE = 4.0 / 31


@pytest.fixture(scope="module")
def world():
    """A floor; over one half of it a sheet as near as half a texel, over a quarter one 1.5 texels up."""
    floor = Quad((0, 0, 0), (0, 0, 4), (4, 0, 0))
    sheet = Quad((0, 0.5 * SIDE, 0), (2, 0, 0), (0, 0, 4))
    shelf = Quad((3, 1.5 * SIDE, 0), (1, 0, 0), (0, 0, 4))
    return quad_world([floor, sheet, shelf], 64, inset=0.0)


def depth(world, threads=1):
    return gap_depth(
        world.texels, world.surface, world.free, world.rays.tracer, seed=0, threads=threads, progress=silent
    )


def test_depth_follows_the_height_of_the_gap(world):
    found, rays = depth(world)
    assert rays == 32 * world.texels.n
    assert found.dtype == np.uint8
    x, z = world.texels.position[:, 0], world.texels.position[:, 2]
    floor = world.texels.instance == 0
    under = (x > 2 * SIDE) & (x < 2 - 2 * SIDE) & (np.abs(z - 2) < 2 - 2 * SIDE)
    assert (found[floor & under] == 2).all()
    assert (found[floor & (x > 2 + SIDE) & (x < 3 - 5 * SIDE)] == 0).all()
    middle = floor & (x > 3.4) & (x < 3.7) & (np.abs(z - 2) < 1)
    assert (found[middle] == 1).all()
    # What looks down on the floor lies in the same gap; what looks up does not.
    sheet = world.texels.instance == 1
    assert world.texels.normal[sheet][0, 1] < 0
    assert (found[sheet & under] == 2).mean() > 0.9


def test_a_room_s_corners_are_no_gaps():
    floor, wall = Quad((0, 0, 0), (0, 0, 4), (4, 0, 0)), Quad((0, 0, 0), (0, 4, 0), (0, 0, 4))
    found, _ = depth(quad_world([floor, wall], 64))
    assert (found == 0).all()


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
